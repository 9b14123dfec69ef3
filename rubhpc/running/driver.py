"""Runs a study: study x store x pool, from the first look at the store to the last packed array."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import RubError, StoppedEarly
from rubhpc.integrate.case import compile_kernels
from rubhpc.integrate.prepare import prepare
from rubhpc.running.crash import crash
from rubhpc.running.pool import Pool, Tally, connect
from rubhpc.running.progress import Progress
from rubhpc.running.stopping import Stopped, Stopping
from rubhpc.running.worker import Worker
from rubhpc.schema import FAILED, MISSING
from rubhpc.storage.disk import disk_errors
from rubhpc.storage.journal import Ledger, count, next_run
from rubhpc.storage.manifest import PRIVATE
from rubhpc.storage.resume import bring_up_to_date, find_gone, missing_share, open_store, sweep_for
from rubhpc.storage.runs import record_run
from rubhpc.storage.store import Store
from rubhpc.storage.summary import Summary
from rubhpc.study import Study, read_study
from rubhpc.sweep import Sweep

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from rubhpc.sweep import Block

_PACKING_GAP = 600.0  # s between packings while a run is on; one takes 5 s for a million cases
_REASONS = 100  # failed cases a summary names, at most


@dataclass(frozen=True, kw_only=True)
class _Job:
    """What the first rank tells the others; `pending` are positions in Sweep.blocks() that lack a case."""

    study: Study
    chunk: tuple[int, ...]
    run: int
    ledger: Ledger
    missing: NDArray[np.bool_]
    pending: NDArray[np.int64]


def run(
    study: Study | str | os.PathLike[str],
    *,
    output: str | os.PathLike[str] | None = None,
    retry_failed: bool = False,
    max_failures: int | None = None,
    time_limit: float | None = None,
    quiet: bool = False,
    stopping: Stopping | None = None,
) -> Summary:
    """Run a study, or what is left of it, on this process or on all MPI ranks it is called on.

    Parameters
    ----------
    study : Study or path
        What to run; a path is read on the first rank.
    output : path, optional
        The store, instead of the study's.
    retry_failed : bool
        Compute the cases anew that have failed before.
    max_failures : int, optional
        Stop when more cases than this have failed in this run; overrides the study's.
    time_limit : float, optional
        Stop after so many seconds; overrides the study's.
    quiet : bool
        Print no progress.
    stopping : Stopping, optional
        Signals that are being answered already.

    Returns
    -------
    Summary

    Raises
    ------
    InputError
        The study cannot be run as it stands.
    StoreError
        The store belongs to another study, is in use, or cannot be written.
    StoppedEarly
        A signal, the file STOP or the time limit came before the end.
    """

    def resolve() -> Study:
        found = study if isinstance(study, Study) else read_study(Path(study))
        limits = replace(
            found.run,
            time_limit=found.run.time_limit if time_limit is None else time_limit,
            max_failures=found.run.max_failures if max_failures is None else max_failures,
        )
        return replace(found, run=limits, output=found.output if output is None else Path(output))

    pool = connect()
    resolved: Study | None = None
    try:
        with stopping or Stopping() as watch, ExitStack() as held:
            resolved = pool.from_first(resolve)
            summary = _run(resolved, pool, watch, held, retry_failed=retry_failed, quiet=quiet)
    except RubError:  # raised on all ranks alike
        pool.close()
        raise
    except Exception as error:
        crashed = crash(error, resolved.output / PRIVATE / "logs" if resolved else None)
        if pool.size > 1:  # the others wait for this rank
            print(f"rubhpc: {crashed}", file=sys.stderr)
            pool.abort(crashed.exit_code)
        raise crashed from error
    pool.close()
    return summary


def _run(
    study: Study, pool: Pool, stopping: Stopping, held: ExitStack, *, retry_failed: bool, quiet: bool
) -> Summary:
    began = time.monotonic()
    stopping.watch(study.output / "STOP", study.run.time_limit)
    job = pool.from_first(lambda: _prepare(study, stopping, held, retry_failed=retry_failed))
    if job.pending.size:
        pool.from_first(lambda: _record(study.output, job.run, pool.size))
    error = _compute(job, pool, stopping, quiet=quiet)
    for other in pool.gather(error):
        if other is not None:
            raise other
    reason = next((told for told in pool.gather(stopping.verdict) if told), "")
    summary = pool.from_first(lambda: _finish(job, pool.sums().n_case, time.monotonic() - began))
    n_missing = summary.counts[MISSING]
    if n_missing and reason:
        raise StoppedEarly(
            f"{summary.store}: stopped by {reason} with {n_missing} of {sum(summary.counts)} cases missing; "
            "run the same command again"
        )
    return summary


def _prepare(study: Study, stopping: Stopping, held: ExitStack, *, retry_failed: bool) -> _Job:
    """Find or make the store, lock it, see what is missing, compile the kernels: the first rank's part."""
    sweep = sweep_for(study)
    store = open_store(sweep)
    with disk_errors(study.output):
        held.enter_context(store.lock(on_loss=lambda: stopping.ask("the loss of its lock")))
    bring_up_to_date(store, sweep)
    ledger = store.replay(with_metrics=not store.is_packed())
    store.pack(ledger)  # readers see what a killed run has left, from now on
    ledger.metrics = None  # the other ranks need none
    run = next_run(store.journal_directory)
    store.take_back(ledger, find_gone(store, ledger), run, "gone")
    missing = ledger.status == MISSING
    if retry_failed:
        missing |= ledger.status == FAILED
    blocks = sweep.blocks()
    grid = missing.reshape(sweep.shape)
    pending = [i for i, block in enumerate(blocks) if missing_share(block, grid)]
    if pending:
        _warm_up(sweep, blocks[pending[-1]], stopping)
    return _Job(
        study=study,
        chunk=sweep.chunk,
        run=run,
        ledger=ledger,
        missing=missing,
        pending=np.array(pending, dtype=np.int64),
    )


def _record(store: Path, run: int, n_rank: int) -> None:
    with disk_errors(store):
        record_run(store, run, n_rank)


def _warm_up(sweep: Sweep, block: Block, stopping: Stopping) -> None:
    """Compile every kernel once, on two revolutions: concurrent compilations into one cache have crashed."""

    def check() -> None:
        if stopping.look():
            raise Stopped

    study = sweep.study
    with suppress(Exception):  # what is wrong with this case will be its reason to fail
        case = sweep.cases(block)[0]
        setup = prepare(
            case.rig,
            case.speed,
            contact=study.contact,
            integrator=study.integrator,
            samples_per_revolution=study.recording.samples_per_revolution,
        )
        compile_kernels(
            setup,
            clearance=case.clearance,
            friction=case.friction,
            recording=study.recording,
            check=check,
        )


def _compute(job: _Job, pool: Pool, stopping: Stopping, *, quiet: bool) -> RubError | None:
    """Compute blocks until there are none left; what keeps this rank from its store, to be told to all."""
    try:
        sweep = Sweep(job.study, chunk=job.chunk)
        store = Store(job.study.output)
        every = sweep.blocks()
        blocks = [every[i] for i in job.pending]
        with (
            store.journal(job.run, f"rank{pool.rank:05d}") as journal,
            _progress(job, sweep, blocks, quiet=quiet or pool.rank > 0, has_bar=pool.size == 1) as progress,
        ):

            def attend() -> None:
                if pool.rank == 0:
                    progress.update(pool.sums())

            worker = Worker(sweep, store, job.ledger, job.missing, journal, stopping, pool.add, attend)
            next_packing = time.monotonic() + _PACKING_GAP
            for i_block in _claimed(job, pool, stopping):
                worker.work(blocks[i_block])
                attend()
                if pool.rank == 0 and time.monotonic() > next_packing:
                    store.pack(store.replay())  # for readers who look on
                    next_packing = time.monotonic() + _PACKING_GAP
            worker.sync()
    except RubError as error:
        pool.add(Tally(stop=1))
        return error
    if stopping.reason:
        pool.add(Tally(stop=1))
    return None


def _claimed(job: _Job, pool: Pool, stopping: Stopping) -> Iterator[int]:
    """Positions of the blocks this rank is to compute, until there are none, or reason to stop."""
    most_failures = job.study.run.max_failures
    while not stopping.look():
        sums = pool.claim()
        has_failed = most_failures is not None and sums.failed > most_failures
        if sums.claimed >= len(job.pending) or sums.stop or has_failed:
            return
        yield sums.claimed


def _progress(job: _Job, sweep: Sweep, blocks: list[Block], *, quiet: bool, has_bar: bool) -> Progress:
    grid = job.missing.reshape(sweep.shape)
    return Progress(
        sweep.n_case,
        sum(block.cost * missing_share(block, grid) for block in blocks),
        n_done=sweep.n_case - int(job.missing.sum()),
        quiet=quiet,
        has_bar=has_bar,
    )


def _finish(job: _Job, computed: int, seconds: float) -> Summary:
    """Pack what the journals tell, and count it: the first rank's part."""
    store = Store(job.study.output)
    ledger = store.replay()
    store.pack(ledger)
    with disk_errors(store.path):
        (store.path / "STOP").unlink(missing_ok=True)
    failed = np.flatnonzero(ledger.status == FAILED)[:_REASONS].tolist()
    return Summary(
        store=store.path,
        counts=count(ledger.status),
        computed=computed,
        seconds=seconds,
        reasons=tuple((store.manifest.name_case(i), ledger.reasons.get(i, "")) for i in failed),
    )
