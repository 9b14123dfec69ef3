"""What a run is to compute: the first rank finds or makes the store, locks it, and sees what is missing."""

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
from rubhpc.storage.in_progress import find_suspects, forget
from rubhpc.storage.journal import Entry, Ledger, next_run
from rubhpc.storage.resume import bring_up_to_date, find_gone, missing_share, open_store, sweep_for
from rubhpc.storage.runs import record_run

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.storage.lock import Lock
    from rubhpc.storage.store import Store
    from rubhpc.study.cases import Block, Sweep
    from rubhpc.study.study import Study


@dataclass(kw_only=True)
class Order:
    """What was asked for, and the lock that outlives the loss of a rank.

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
    """What the first rank tells the others.

    Attributes
    ----------
    missing : (n_case,) bool
        Cases to be computed, but for the doubtful ones.
    pending : (n,) int
        Positions in `Sweep.chains()` of those that hold one.
    doubtful : dict
        Flat index -> deaths of ranks in this case, or in one before it in its chain; these come last, each by
        itself, those of a chain in their order.
    token : str
        Of the lock on the store.
    """

    study: Study
    chunk: tuple[int, ...]
    run: int
    ledger: Ledger
    missing: NDArray[np.bool_]
    pending: NDArray[np.int64]
    doubtful: dict[int, int]
    token: str


def prepare_job(order: Order, n_rank: int) -> Job:
    """Find or make the store, lock it, see what is missing, compile the kernels."""
    study, stopping = order.study, order.stopping
    sweep = sweep_for(study, accept_version=order.accept_version)
    store = open_store(sweep)
    with disk_errors(study.output):
        if order.lock is None:
            order.lock = order.held.enter_context(
                store.lock(on_loss=lambda: stopping.ask("the loss of its lock"), heir_of=order.token)
            )
        bring_up_to_date(store, sweep, accept_version=order.accept_version)
        ledger = store.replay(with_measures=not store.is_packed())
        store.pack(ledger)  # readers see what a killed run has left, from now on
        ledger.measures = None  # the other ranks need none
        run = next_run(store.journal_directory)
        record_run(store.path, run, n_rank)
        store.take_back(ledger, find_gone(store, ledger), run, "gone")
        missing = ledger.status == MISSING
        if order.retry_failed:
            failed = np.flatnonzero(ledger.status == FAILED).tolist()
            store.take_back(
                ledger, _with_those_behind(sweep, failed), run, "anew"
            )  # a name that comes before those of ranks
            missing = (ledger.status == MISSING) | (ledger.status == FAILED)
        doubtful = _with_followers(sweep, _judge(store, ledger, missing, run), missing)
    missing[list(doubtful)] = False
    chains = sweep.chains()
    grid = missing.reshape(sweep.shape)
    pending = [i for i, chain in enumerate(chains) if any(missing_share(block, grid) for block in chain)]
    if pending:
        _warm_up(sweep, chains[pending[-1]][0], stopping)
    return Job(
        study=study,
        chunk=sweep.chunk,
        run=run,
        ledger=ledger,
        missing=missing,
        pending=np.array(pending, dtype=np.int64),
        doubtful=doubtful,
        token=order.lock.token,
    )


def _judge(store: Store, ledger: Ledger, missing: NDArray[np.bool_], run: int) -> dict[int, int]:
    """Have the cases fail that kill their ranks; returns the doubtful ones with their deaths."""
    suspects = find_suspects(store.hand_directory, store.manifest, missing)
    if suspects.guilty:
        with store.journal(run, "hand") as journal:
            journal.write(
                Entry(flat, store.manifest.case_id(flat), FAILED, reason=reason)
                for flat, reason in suspects.guilty.items()
            )
            journal.sync()
        guilty = list(suspects.guilty)
        ledger.status[guilty] = FAILED
        ledger.reasons |= suspects.guilty
        missing[guilty] = False
        forget(store.hand_directory, ~missing)
    return suspects.doubtful


def _with_those_behind(sweep: Sweep, cases: list[int]) -> list[int]:
    """Cases, by their flat index, and all that go on from them, near or far; none without chains."""
    if sweep.chain is None:
        return []
    marked = np.zeros(sweep.n_case, bool)
    marked[cases] = True
    return np.flatnonzero(sweep.chain.highest(marked.reshape(sweep.shape))).tolist()


def _with_followers(sweep: Sweep, doubtful: dict[int, int], missing: NDArray[np.bool_]) -> dict[int, int]:
    """Doubtful cases, and those that have to wait for them; of one chain in the order of the chain."""
    chain = sweep.chain
    if chain is None or not doubtful:
        return doubtful
    deaths = np.zeros(sweep.n_case, np.int64)
    deaths[list(doubtful)] = list(doubtful.values())
    deaths = chain.highest(deaths.reshape(sweep.shape)).ravel()
    waiting = np.flatnonzero((deaths > 0) & missing).tolist()
    turns = {flat: chain.turn([int(i) for i in np.unravel_index(flat, sweep.shape)]) for flat in waiting}
    return {flat: int(deaths[flat]) for flat in sorted(waiting, key=lambda flat: turns[flat])}


def _warm_up(sweep: Sweep, block: Block, stopping: Stopping) -> None:
    """Compile every kernel once, on two revolutions: concurrent compilations into one cache have crashed."""

    def check() -> None:
        if stopping.look():
            raise Stopped

    with suppress(Exception):  # what is wrong with this case will be its reason to fail
        case = sweep.cases(block)[0]
        compile_kernels(
            set_up(sweep.study, case),
            clearance=case.clearance,
            friction=case.friction,
            recording=sweep.study.recording,
            check=check,
        )
