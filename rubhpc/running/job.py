"""Preparing a run: the first rank finds or creates the store, locks it, and determines what is missing."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import StoppedEarly, StoreError
from rubhpc.running.stopping import Stopped, Stopping
from rubhpc.running.warm_up import warm_up
from rubhpc.schema import FAILED, MISSING
from rubhpc.storage.disk import disk_errors
from rubhpc.storage.in_progress import forget, read_deaths
from rubhpc.storage.journal import Entry, next_run
from rubhpc.storage.lock import InUse
from rubhpc.storage.parts import Shares
from rubhpc.storage.refined import Refinement
from rubhpc.storage.resume import (
    bring_up_to_date,
    cases_without_files,
    grid_for,
    must_be_grown,
    open_store,
)
from rubhpc.storage.runs import free_number, record_run
from rubhpc.study.cases import CaseGrid
from rubhpc.study.parts import share_out

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.running.stopping import Stopping
    from rubhpc.storage.ledger import Ledger
    from rubhpc.storage.lock import Lock
    from rubhpc.storage.store import Store
    from rubhpc.study.cases import Block
    from rubhpc.study.parts import Part
    from rubhpc.study.study import Study

    Sequences = list[list[Block]]


@dataclass(kw_only=True)
class RunRequest:
    """What the caller requested, and the lock, which survives the loss of a rank.

    Attributes
    ----------
    part : Part, optional
        What is to be computed of the study; all of it by default.
    lock : Lock, optional
        On the store, or on the part, on the rank that has taken it.
    token : str
        That of the lock, once it was taken by any rank: whoever becomes the first inherits it.
    """

    study: Study
    stopping: Stopping
    retry_failed: bool
    accept_version: bool
    quiet: bool
    part: Part | None = None
    held: ExitStack = field(default_factory=ExitStack)
    lock: Lock | None = None
    token: str = ""


def begin(request: RunRequest, store: Store, grid: CaseGrid, n_rank: int) -> tuple[int, NDArray[np.bool_]]:
    """Begin a whole run: lock the store and bring it up to date; number of the run, and all cases."""
    stopping = request.stopping
    if request.lock is None:
        request.lock = request.held.enter_context(
            store.lock(on_loss=lambda: stopping.ask("the loss of its lock"), heir_of=request.token)
        )
        request.token = request.lock.token
    _bring_up_to_date(request, store, grid)
    store.parts.forget()
    run = next_run(store.journal_directory)
    record_run(store.path, run, n_rank)
    return run, np.ones(grid.n_case, bool)


def begin_part(
    request: RunRequest, store: Store, grid: CaseGrid, n_rank: int
) -> tuple[int, NDArray[np.bool_]]:
    """Begin a part: lock it, bring the store up to date if no other part is at work; also its cases."""
    part, stopping, parts = request.part, request.stopping, store.parts
    assert part is not None
    with ExitStack() as alone:
        try:
            alone.enter_context(parts.alone(part, stopping.look))
        except InUse:
            if stopping.look():
                raise StoppedEarly(
                    f"{store.path}: part {part}: stopped by {stopping.reason} before it began; "
                    "run the same command again"
                ) from None
            raise
        others = [holder for holder in parts.running() if holder.token != request.token]
        if not others:
            _bring_up_to_date(request, store, grid)
        else:
            store.reopen()
            if must_be_grown(store, grid, accept_version=request.accept_version):
                raise StoreError(
                    f"{store.path}: the study has changed since {others[0]} began it; wait for all "
                    "parts, or stop them"
                )
        run = free_number(store.path)
        if request.lock is None:
            request.lock = request.held.enter_context(
                parts.lock(part, run, lambda: stopping.ask("the loss of its lock"), request.token)
            )
            request.token = request.lock.token
        shares = parts.read_shares(store.manifest)
        if shares is None and others:
            raise StoreError(f"{store.path}: the shares of its parts are damaged; wait for {others[0]}")
        if shares is None or shares.count != part.total:
            shares = Shares(part.total, share_out(grid, part.total))
            parts.write_shares(shares, store.manifest)
        record_run(store.path, run, n_rank, str(part))
    return run, shares.cases(part.number, store.manifest)


def _bring_up_to_date(request: RunRequest, store: Store, grid: CaseGrid) -> None:
    note = bring_up_to_date(store, grid, accept_version=request.accept_version)
    if note and not request.quiet:
        print(note, flush=True)


@dataclass(frozen=True, kw_only=True)
class Job:
    """Job of a run, sent by the first rank to the others.

    Attributes
    ----------
    part : Part, optional
        What is computed of the study.
    share : (n_case,) bool
        Cases of the part; all without one.
    missing : (n_case,) bool
        Cases of it to be computed, without suspect ones; of a refined map those known so far.
    pending : (n,) int
        Positions in `CaseGrid.sequences()` of those that hold one.
    suspect : dict
        Flat index -> deaths of ranks in this case or one of its predecessors; these cases come last, each by
        itself, those of a sweep in order.
    deadly : set of int
        Those of them in which ranks died themselves: they are first computed in a process of their own.
    token : str
        Of the lock on the store.
    refinement : Refinement, optional
        Of a refined map, what decides which further cases it needs.
    """

    study: Study
    chunk: tuple[int, ...]
    run: int
    part: Part | None
    ledger: Ledger
    share: NDArray[np.bool_]
    missing: NDArray[np.bool_]
    pending: NDArray[np.int64]
    suspect: dict[int, int]
    deadly: set[int]
    token: str
    refinement: Refinement | None = None


def prepare_job(request: RunRequest, n_rank: int) -> Job:
    """Find or make the store, lock it, see what is missing, compile the kernels."""
    study, stopping = request.study, request.stopping
    grid = grid_for(study, accept_version=request.accept_version)
    store = open_store(grid)
    if grid.chunk != store.manifest.chunk:  # another run was quicker to make it
        grid = CaseGrid(study, chunk=store.manifest.chunk)
    with disk_errors(study.output):
        run, share = (begin if request.part is None else begin_part)(request, store, grid, n_rank)
        is_refined = store.manifest.refine is not None
        needs_measures = request.part is None and (is_refined or not store.is_packed())
        ledger = store.replay(with_measures=needs_measures)
        if request.part is None:
            store.pack(ledger)  # readers see what a killed run has left, from now on
        own = replace(ledger, status=np.where(share, ledger.status, MISSING))
        store.mark_missing(ledger, cases_without_files(store, own), run, "gone")
        missing = share & (ledger.status == MISSING)
        if request.retry_failed:
            failed = np.flatnonzero(share & (ledger.status == FAILED)).tolist()
            store.mark_missing(
                ledger, _with_dependants(grid, failed), run, "anew"
            )  # a name that comes before those of ranks
            missing = share & ((ledger.status == MISSING) | (ledger.status == FAILED))
        refinement = None
        if is_refined and ledger.measures is not None:
            refinement = Refinement(
                store.manifest, ledger.status, ledger.measures, again=request.retry_failed
            )
            missing &= refinement.missing()
        ledger.measures = None  # the other ranks need none
        among = None if request.part is None else share
        deaths = _fail_killers(store, ledger, missing, run, among)
        suspect = _with_followers(grid, deaths, missing)
    missing[list(suspect)] = False
    sequences = grid.sequences()
    pending = find_pending(grid, sequences, missing)
    if len(pending) and not request.quiet:
        for line in grid.warnings():
            print(f"warning: {line}", flush=True)
    if len(pending):
        _warm_up(grid, sequences[pending[-1]][0], stopping)
    return Job(
        study=study,
        chunk=grid.chunk,
        run=run,
        part=request.part,
        ledger=ledger,
        share=share,
        missing=missing,
        pending=pending,
        suspect=suspect,
        deadly=set(deaths),
        token=request.token,
        refinement=refinement,
    )


def find_pending(grid: CaseGrid, sequences: Sequences, missing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Positions of the sequences that hold a missing case."""
    starts = [np.arange(0, n, c) for n, c in zip(grid.shape, grid.chunk, strict=True)]
    counts = missing.reshape(grid.shape).astype(np.int32)
    for axis, at in enumerate(starts):
        counts = np.add.reduceat(counts, at, axis=axis)
    is_pending = [
        any(counts[tuple(s // c for s, c in zip(b.start, grid.chunk, strict=True))] for b in sequence)
        for sequence in sequences
    ]
    return np.flatnonzero(is_pending)


def _fail_killers(
    store: Store, ledger: Ledger, missing: NDArray[np.bool_], run: int, among: NDArray[np.bool_] | None
) -> dict[int, int]:
    """Mark the cases as failed that kill their ranks; returns the suspect ones with their deaths."""
    suspects = read_deaths(store.in_progress_directory, store.manifest, missing, among)
    if suspects.failed:
        with store.journal(run, "killed") as journal:
            journal.write(
                Entry(flat, store.manifest.case_id(flat), FAILED, reason=reason)
                for flat, reason in suspects.failed.items()
            )
            journal.sync()
        failed = list(suspects.failed)
        ledger.status[failed] = FAILED
        ledger.reasons |= suspects.failed
        missing[failed] = False
        forget(store.in_progress_directory, ~missing, among)
    return suspects.suspect


def _with_dependants(grid: CaseGrid, cases: list[int]) -> list[int]:
    """Cases and all that depend on them, by flat index; none without a continuation."""
    if grid.continuation is None:
        return []
    marked = np.zeros(grid.n_case, bool)
    marked[cases] = True
    return np.flatnonzero(grid.continuation.running_maximum(marked.reshape(grid.shape))).tolist()


def _with_followers(grid: CaseGrid, suspect: dict[int, int], missing: NDArray[np.bool_]) -> dict[int, int]:
    """Suspect cases and those that depend on them, those of a sweep in order."""
    continuation = grid.continuation
    if continuation is None or not suspect:
        return suspect
    deaths = np.zeros(grid.n_case, np.int64)
    deaths[list(suspect)] = list(suspect.values())
    deaths = continuation.running_maximum(deaths.reshape(grid.shape)).ravel()
    waiting = np.flatnonzero((deaths > 0) & missing).tolist()
    turns = {
        flat: continuation.position([int(i) for i in np.unravel_index(flat, grid.shape)]) for flat in waiting
    }
    return {flat: int(deaths[flat]) for flat in sorted(waiting, key=lambda flat: turns[flat])}


def _warm_up(grid: CaseGrid, block: Block, stopping: Stopping) -> None:
    """Compile every kernel on one rank, while the others wait."""

    def check() -> None:
        if stopping.look():
            raise Stopped

    with suppress(Exception):  # an error will be reported as the reason of these cases
        warm_up(grid, block.start, check)
