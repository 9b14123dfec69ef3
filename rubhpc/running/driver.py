"""Runs a study: study x store x pool, from the first look at the store to the last packed array."""

from __future__ import annotations

import time
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import StoppedEarly
from rubhpc.integrate.compilation import announced_by, seconds_compiling
from rubhpc.running.computing import Computing
from rubhpc.running.ending import ended_together
from rubhpc.running.job import RunRequest, prepare_job
from rubhpc.running.pool import Pool, RankLost, connect, together
from rubhpc.running.refining import Refining
from rubhpc.running.stopping import Stopping
from rubhpc.running.workers import start_workers
from rubhpc.schema import DONE, FAILED, MISSING
from rubhpc.storage.disk import disk_errors, remove
from rubhpc.storage.in_progress import forget
from rubhpc.storage.ledger import count
from rubhpc.storage.lock import InUse
from rubhpc.storage.manifest import PRIVATE
from rubhpc.storage.refined import status_of
from rubhpc.storage.runs import end_run
from rubhpc.storage.store import Store
from rubhpc.storage.summary import Summary, verdicts
from rubhpc.streams import lasting_streams
from rubhpc.study.parts import Part, check_parts
from rubhpc.study.study import Study, read_study
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from rubhpc.running.job import Job
    from rubhpc.storage.ledger import Ledger


@on_one_thread
@lasting_streams()
def run(
    study: Study | str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    retry_failed: bool = False,
    max_failures: int | None = None,
    time_limit: float | None = None,
    accept_version: bool = False,
    trust_rig: bool = False,
    workers: int | None = None,
    part: str | None = None,
    quiet: bool = False,
    stopping: Stopping | None = None,
) -> Summary:
    """Run or resume a study in this process, on `workers`, or on all MPI ranks that call it.

    Parameters
    ----------
    study : Study or path
        What to run; a path is read on the first rank.
    output : path, optional
        The store, in place of that of the study.
    retry_failed : bool
        Compute failed cases again.
    max_failures : int, optional
        Stop when more cases than this have failed in this run; overrides the study's.
    time_limit : float, optional
        Stop after so many seconds; overrides the study's.
    accept_version : bool
        Keep the cases of a store that another version of the physics has computed, and continue.
    trust_rig : bool
        Whether a rig that is Python code, `rig = "my_rig.py:build"`, may be run.
    workers : int, optional
        Processes of this machine that share the work, this one among them; they need no MPI.
    part : str, optional
        Compute this part of the study only, as "3/64": the third of 64, which may be computed at the same
        time, on other machines, or one after another, into one store.
    quiet : bool
        Print no progress.
    stopping : Stopping, optional
        A stop request that is already being handled.

    Returns
    -------
    Summary

    Raises
    ------
    InputError
        The study cannot be run.
    StoreError
        The store belongs to another study, is in use, or cannot be written.
    StoppedEarly
        A signal, the file STOP or the time limit came before the end.
    """
    chosen = None if part is None else Part.parse(part)

    def resolve() -> Study:
        found = study if isinstance(study, Study) else read_study(Path(study), trust_rig=trust_rig)
        if chosen is not None:
            check_parts(chosen, found)
        limits = replace(
            found.run,
            time_limit=found.run.time_limit if time_limit is None else time_limit,
            max_failures=found.run.max_failures if max_failures is None else max_failures,
        )
        return replace(found, run=limits, output=found.output if output is None else Path(output))

    with nullcontext(connect()) if workers is None else start_workers(workers, take_part) as pool:
        return _run_in(
            pool,
            resolve,
            stopping or Stopping(),
            retry_failed=retry_failed,
            accept_version=accept_version,
            part=chosen,
            quiet=quiet,
        )


@on_one_thread
@lasting_streams()
def take_part(pool: Pool, stopping: Stopping) -> None:
    """Do a worker's part of a run; all information comes from the first rank."""

    def unknown() -> Study:
        raise AssertionError("a worker is not the first rank")

    _run_in(pool, unknown, stopping, retry_failed=False, accept_version=False, quiet=True)


def _run_in(
    pool: Pool,
    resolve: Callable[[], Study],
    stopping: Stopping,
    *,
    retry_failed: bool,
    accept_version: bool,
    quiet: bool,
    part: Part | None = None,
) -> Summary:
    """Run what the first rank resolves, on all ranks of a pool."""
    resolved: Study | None = None

    def logs() -> Path | None:
        return resolved.output / PRIVATE / "logs" if resolved else None

    with ended_together(pool, logs), stopping as watch, ExitStack() as held:
        watch.forward_to(pool.stop)
        held.enter_context(announced_by(_say if pool.rank == 0 and not quiet else lambda _: None))
        resolved = pool.from_first(resolve)
        watch.watch(resolved.output / "STOP", resolved.run.time_limit)
        request = RunRequest(
            study=resolved,
            stopping=watch,
            retry_failed=retry_failed,
            accept_version=accept_version,
            quiet=quiet,
            part=part,
            held=held,
        )
        return _run(request, pool)


def _say(text: str) -> None:
    print(text, flush=True)


def _run(request: RunRequest, pool: Pool) -> Summary:
    """Run the study; where ranks are lost, the remaining ones continue."""
    began, compiled, n_rank = time.monotonic(), seconds_compiling(), pool.size

    def elapsed() -> float:
        """Seconds without compilation, by the rank that compiled longest, for which the others waited."""
        compiling = max(pool.gather(seconds_compiling() - compiled))
        return max(time.monotonic() - began - compiling, 0.0)

    is_broken = False
    while True:
        try:
            if is_broken:
                pool.leave_lost()
                is_broken = False
            return replace(_round(request, pool, elapsed), lost=n_rank - pool.size)
        except RankLost:
            is_broken = True


def _round(request: RunRequest, pool: Pool, elapsed: Callable[[], float]) -> Summary:
    """Compute what is missing, together."""
    job = pool.from_first(lambda: prepare_job(request, pool.size))
    request.token = job.token
    if job.part is None:
        together(pool, lambda: _pack_blocks(job, pool, request.stopping, is_end=False))
    computing = (Computing if job.refinement is None else Refining)(job, pool, request)
    computing.compute()
    together(pool, computing.sync)
    reason = next((reason for reason in pool.gather(request.stopping.verdict) if reason), "")
    if not reason and job.part is None:
        together(pool, lambda: _pack_blocks(job, pool, request.stopping, is_end=True))
    finish = finish_run if job.part is None else finish_part
    seconds = elapsed()
    summary = pool.from_first(lambda: finish(job, request, pool.totals().n_case, seconds))
    n_missing = summary.counts[MISSING]
    if n_missing and reason:
        raise StoppedEarly(
            f"{summary.name}: stopped by {reason} with {n_missing} of {sum(summary.counts)} cases missing; "
            "run the same command again"
        )
    return summary


def _pack_blocks(job: Job, pool: Pool, stopping: Stopping, *, is_end: bool) -> None:
    """Pack this rank's part of the shards; at the beginning of a run, only those that are mostly unpacked."""
    files = Store(job.study.output).block_files
    least = 1 if is_end else files.n_inner // 2 + 1
    with disk_errors(job.study.output):
        files.pack(pool.rank, pool.size, least=least, is_over=stopping.look)


_REASONS = 100  # most failed cases named in a summary


def finish_run(job: Job, request: RunRequest, computed: int, seconds: float) -> Summary:
    """Pack the journals into arrays and count the cases."""
    store = Store(job.study.output)
    ledger = store.replay()
    store.pack(ledger)
    ledger.status = status_of(store.manifest, ledger.status, ledger.measures)
    _clean_up(store, ledger)
    with disk_errors(store.path):
        end_run(store.path, job.run)
    return _summary(job, store, ledger, computed, seconds)


def finish_part(job: Job, request: RunRequest, computed: int, seconds: float) -> Summary:
    """Release the part and pack the journals; if it is the last part, pack as after a whole run.

    The part is released first, so that the last of several parts that end together finds no other at work.
    Where the store is not available (a whole run has begun, or this one must stop at once) packing is left to
    others.
    """
    part, store = job.part, Store(job.study.output)
    assert part is not None
    if request.lock is not None:
        request.lock.release()
        request.lock = None
    stopping = request.stopping
    try:
        with disk_errors(store.path):
            end_run(store.path, job.run)
        with (
            disk_errors(store.path),
            store.parts.alone(part, stopping.look, lambda: stopping.ask("the loss of its lock")),
        ):
            ledger = store.replay()
            store.pack(ledger)
            if not store.parts.running():
                _clean_up(store, ledger)
                if not (ledger.status == MISSING).any():
                    store.block_files.pack(is_over=stopping.look)
                    if not stopping.look():
                        store.parts.forget()
    except InUse:
        ledger = store.replay(with_measures=False)
    return _summary(job, store, ledger, computed, seconds)


def _clean_up(store: Store, ledger: Ledger) -> None:
    """Remove stop requests, and the in-progress records of cases that have an outcome."""
    with disk_errors(store.path):
        remove(store.path / "STOP")
        forget(store.in_progress_directory, ledger.status != MISSING)


def _summary(job: Job, store: Store, ledger: Ledger, computed: int, seconds: float) -> Summary:
    own = ledger.status[job.share]
    failed = np.flatnonzero(job.share & (ledger.status == FAILED))[:_REASONS].tolist()
    measures = ledger.measures
    is_done = job.share & (ledger.status == DONE)
    return Summary(
        store=store.path,
        counts=count(own),
        computed=computed,
        seconds=seconds,
        reasons=tuple((store.manifest.name_case(i), ledger.reasons.get(i, "")) for i in failed),
        verdicts="" if measures is None else verdicts(store.manifest, is_done, measures),
        flawed=sum(1 for i in ledger.reasons if job.share[i] and ledger.status[i] == DONE),
        part="" if job.part is None else str(job.part),
        n_elsewhere=int((ledger.status == MISSING).sum()) - count(own)[MISSING],
    )
