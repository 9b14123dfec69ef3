"""Beginning a run of a study or a part of it: its lock, its store brought up to date, its number."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import StoppedEarly, StoreError
from rubhpc.storage.journal import next_run
from rubhpc.storage.lock import InUse
from rubhpc.storage.parts import Shares
from rubhpc.storage.resume import bring_up_to_date, must_be_grown
from rubhpc.storage.runs import free_number, record_run
from rubhpc.study.parts import share_out

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.running.stopping import Stopping
    from rubhpc.storage.lock import Lock
    from rubhpc.storage.store import Store
    from rubhpc.study.cases import CaseGrid
    from rubhpc.study.parts import Part
    from rubhpc.study.study import Study


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
