"""Preparing a run: the first rank finds or creates the store, locks it, and determines what is missing."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.case import compile_kernels
from rubhpc.running.stopping import Stopped, Stopping
from rubhpc.running.worker import set_up
from rubhpc.schema import FAILED, MISSING
from rubhpc.storage.disk import disk_errors
from rubhpc.storage.in_progress import forget, read_deaths
from rubhpc.storage.journal import Entry, Ledger, next_run
from rubhpc.storage.resume import bring_up_to_date, cases_without_files, grid_for, missing_share, open_store
from rubhpc.storage.runs import record_run

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.storage.lock import Lock
    from rubhpc.storage.store import Store
    from rubhpc.study.cases import Block, CaseGrid
    from rubhpc.study.study import Study


@dataclass(kw_only=True)
class RunRequest:
    """What the caller requested, and the lock, which survives the loss of a rank.

    Attributes
    ----------
    token : str
        That of the lock, once it was taken by any rank: whoever becomes the first inherits it.
    """

    study: Study
    stopping: Stopping
    retry_failed: bool
    accept_version: bool
    quiet: bool
    held: ExitStack = field(default_factory=ExitStack)
    lock: Lock | None = None
    token: str = ""


@dataclass(frozen=True, kw_only=True)
class Job:
    """What the first rank sends to the others.

    Attributes
    ----------
    missing : (n_case,) bool
        Cases to be computed, but for the suspect ones.
    pending : (n,) int
        Positions in `CaseGrid.sequences()` of those that hold one.
    suspect : dict
        Flat index -> deaths of ranks in this case or one of its predecessors; these cases come last, each by
        itself, those of a sweep in order.
    token : str
        Of the lock on the store.
    """

    study: Study
    chunk: tuple[int, ...]
    run: int
    ledger: Ledger
    missing: NDArray[np.bool_]
    pending: NDArray[np.int64]
    suspect: dict[int, int]
    token: str


def prepare_job(request: RunRequest, n_rank: int) -> Job:
    """Find or make the store, lock it, see what is missing, compile the kernels."""
    study, stopping = request.study, request.stopping
    grid = grid_for(study, accept_version=request.accept_version)
    store = open_store(grid)
    with disk_errors(study.output):
        if request.lock is None:
            request.lock = request.held.enter_context(
                store.lock(on_loss=lambda: stopping.ask("the loss of its lock"), heir_of=request.token)
            )
        note = bring_up_to_date(store, grid, accept_version=request.accept_version)
        if note and not request.quiet:
            print(note, flush=True)
        ledger = store.replay(with_measures=not store.is_packed())
        store.pack(ledger)  # readers see what a killed run has left, from now on
        ledger.measures = None  # the other ranks need none
        run = next_run(store.journal_directory)
        record_run(store.path, run, n_rank)
        store.mark_missing(ledger, cases_without_files(store, ledger), run, "gone")
        missing = ledger.status == MISSING
        if request.retry_failed:
            failed = np.flatnonzero(ledger.status == FAILED).tolist()
            store.mark_missing(
                ledger, _with_dependants(grid, failed), run, "anew"
            )  # a name that comes before those of ranks
            missing = (ledger.status == MISSING) | (ledger.status == FAILED)
        suspect = _with_followers(grid, _fail_killers(store, ledger, missing, run), missing)
    missing[list(suspect)] = False
    sequences = grid.sequences()
    is_missing = missing.reshape(grid.shape)
    pending = [
        i
        for i, sequence in enumerate(sequences)
        if any(missing_share(block, is_missing) for block in sequence)
    ]
    if pending and not request.quiet:
        for line in grid.warnings():
            print(f"warning: {line}", flush=True)
    if pending:
        _warm_up(grid, sequences[pending[-1]][0], stopping)
    return Job(
        study=study,
        chunk=grid.chunk,
        run=run,
        ledger=ledger,
        missing=missing,
        pending=np.array(pending, dtype=np.int64),
        suspect=suspect,
        token=request.lock.token,
    )


def _fail_killers(store: Store, ledger: Ledger, missing: NDArray[np.bool_], run: int) -> dict[int, int]:
    """Mark the cases as failed that kill their ranks; returns the suspect ones with their deaths."""
    suspects = read_deaths(store.in_progress_directory, store.manifest, missing)
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
        forget(store.in_progress_directory, ~missing)
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
    """Compile every kernel once, on two revolutions: concurrent compilations into one cache have crashed."""

    def check() -> None:
        if stopping.look():
            raise Stopped

    with suppress(Exception):  # what is wrong with these cases will be their reason to fail
        for case in grid.with_each_law(block.start):
            compile_kernels(
                set_up(grid.study, case),
                clearance=case.clearance,
                friction=case.friction,
                recording=grid.study.recording,
                check=check,
            )
