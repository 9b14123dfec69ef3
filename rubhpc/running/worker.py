"""One rank's work on a block: compute its missing cases, store them, journal them."""

from __future__ import annotations

import os
import sys
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from rubhpc.integrate.branches.case import BranchRecord, record_branches
from rubhpc.integrate.case import run_case
from rubhpc.integrate.changing_speed.case import RunUpRecord, record_run_up
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.integrate.record import State
from rubhpc.running.case_setup import KeptSetups, operation_of
from rubhpc.running.held_blocks import HeldBlocks
from rubhpc.running.initial_states import InitialState, InitialStates
from rubhpc.running.launch import launch
from rubhpc.running.pool import Totals
from rubhpc.running.stopping import Stopped
from rubhpc.running.trial import CaseDied, try_apart
from rubhpc.schema import CONTACT_ANGLE, DIVERGED, DONE, FAILED, FINAL_STATE
from rubhpc.storage.journal import Entry
from rubhpc.storage.measures import missing_value
from rubhpc.storage.store import case_checksum

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from numpy.typing import NDArray

    from rubhpc.integrate.record import Record
    from rubhpc.integrate.setup import Setup
    from rubhpc.running.stopping import Stopping
    from rubhpc.storage.in_progress import InProgress
    from rubhpc.storage.journal import Journal
    from rubhpc.storage.ledger import Ledger
    from rubhpc.storage.store import Store
    from rubhpc.study.cases import Block, Case, CaseGrid
    from rubhpc.study.initial import Initial
    from rubhpc.study.study import Study

    Arrays = dict[str, NDArray[Any]]


def put(record: Record | BranchRecord | RunUpRecord, data: Arrays, i_case: int) -> None:
    """Put the arrays of a record that is done into those of a block.

    Raises
    ------
    FloatingPointError
        One of them is not finite, at a speed.
    """
    if isinstance(record, BranchRecord | RunUpRecord):
        _put_points(record, data, i_case)
        return
    if record.status != DONE:
        return
    arrays = {**record.signals, **record.spectra, **record.sections}
    if FINAL_STATE in data:
        arrays[FINAL_STATE] = record.final.packed()
    for name, values in data.items():
        if not np.isfinite(arrays[name]).all() and name != CONTACT_ANGLE:  # which a gap has none of
            raise FloatingPointError(f"{name} is not finite")
        values[i_case] = arrays[name]


def _put_points(record: BranchRecord | RunUpRecord, data: Arrays, i_case: int) -> None:
    """Put the points of branches, or the revolutions and samples of a run-up, into the arrays of a block."""
    for name, values in data.items():
        values[i_case] = np.nan
        found = record.arrays.get(name, np.zeros(0))
        if found.size:  # a case without a point has no shape either
            values[i_case][tuple(slice(n) for n in found.shape)] = found


def packed_measures(record: Record | BranchRecord | RunUpRecord, kind: np.dtype[np.void]) -> NDArray[np.void]:
    """The measures of a record, packed; one that this version does not know is missing."""
    row = np.zeros((), kind)
    for name in kind.names or ():
        row[name] = record.measures[name] if name in record.measures else missing_value(kind[name])
    return row


PATIENCE = 10.0  # s over its limit until a case checks its limit: a kernel call lasts 0.25 s
_LOOK = 0.5  # s between looks
_STOPPED = 75  # exit code: run the same command again


class Watchdog:
    """Watches the cases of a rank, as a context; without a limit (s) it watches nothing.

    A kernel that does not return cannot be interrupted. The rank therefore records its case as overrun and
    exits, and the launcher ends the other ranks; the next run marks the case as failed and continues.
    """

    def __init__(self, limit: float | None, record: InProgress) -> None:
        self.limit, self._record = limit, record
        self._deadline = float("inf")
        self._ended = threading.Event()

    def begin(self, flat: int, name: str) -> None:
        """A case begins."""
        self._record.take(flat, name)
        if self.limit is not None:
            self._deadline = time.monotonic() + self.limit + PATIENCE

    def end(self) -> None:
        """The case has ended."""
        self._deadline = float("inf")

    def __enter__(self) -> Self:
        if self.limit is not None:
            threading.Thread(target=self._look, args=(self.limit,), name="case watch", daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()

    def _look(self, limit: float) -> None:
        while time.monotonic() < self._deadline:
            if self._ended.wait(_LOOK):
                return
        self._record.note_overrun(limit)
        print(
            f"rubhpc: rank {launch().rank}: a case is over its time limit of {limit:g} s and cannot be "
            "interrupted; run the same command again, which skips this case",
            file=sys.stderr,
            flush=True,
        )
        os._exit(_STOPPED)


class _OverTime(Exception):  # noqa: N818 - becomes the reason of a failed case
    """A case has passed its time limit."""


@dataclass
class Worker:
    """Computes blocks on a rank.

    Attributes
    ----------
    missing : (n_case,) bool
        Which cases are to be computed.
    report : callable
        Called with every case that has ended.
    attend : callable
        Called several times a second while a case is computed.
    held : HeldBlocks
        Results that are not stored yet.
    say : callable
        Called with the progress of a long case.
    is_wanted_elsewhere : callable
        Called after every case; true: store what is done of the block and leave the rest.
    is_wary : bool
        Whether a case is first computed in a process of its own, since ranks died in it.
    """

    grid: CaseGrid
    store: Store
    ledger: Ledger
    missing: NDArray[np.bool_]
    journal: Journal
    watch: Watchdog
    stopping: Stopping
    report: Callable[[Totals], None]
    attend: Callable[[], None]

    def __post_init__(self) -> None:
        self._record_type = self.store.manifest.header.record_type
        self._setups = KeptSetups(self.grid.study)
        self._initial_states = InitialStates(self.grid, self.store, self.ledger, self._repair)
        self.say: Callable[[str], None] = lambda _: None
        self.is_wanted_elsewhere: Callable[[], bool] = lambda: False
        self.is_wary = False
        self.held = HeldBlocks(
            self.store, self.ledger, self.journal, is_refined=self.grid.study.refine is not None
        )
        self._seconds, self._cost = 0.0, 0.0

    def work(self, block: Block, *, is_shared: bool = False) -> None:
        """Compute, store and journal what is missing of a block; what is finished when a stop comes is kept.

        A block that is shared with other ranks is not read, and results are pieces (`held`).

        In a continuation a case starts from the final state of its predecessor, in this block or another.

        Raises
        ------
        StoreError
            The block cannot be stored.
        """
        flat = self.store.flat(block.start)
        cost = block.cost / len(flat)
        if not self.stopping.fits(cost * self._pace):
            return
        wanted = self.missing[flat]
        if is_shared:
            data, damaged = self.held.blank(block.start, wanted), np.zeros_like(wanted)
        else:
            data, damaged = self.held.read(block.start, flat, wanted)
        wanted |= damaged
        entries: list[Entry] = []
        places = np.flatnonzero(wanted).tolist()
        try:
            cases = self.grid.cases(block, places)
        except Exception as error:
            cases, reason = [], _reason(error)
            ids = self.grid.case_ids(block)
            entries = [Entry(int(flat[i]), ids[i], FAILED, reason=reason) for i in places]
            self.report(Totals(failed=len(entries), cost=round(cost * len(entries))))
        for number in self.grid.in_turn(cases):
            case, i_case = cases[number], places[number]
            if self.stopping.look() or not self.stopping.fits(cost * self._pace):
                break
            began = time.perf_counter() - seconds_compiling()
            try:
                start = self._initial_states.start_of(case, flat, data, entries)
                entry = self._enter(case, int(flat[i_case]), data, i_case, start)
            except Stopped:
                break
            self._seconds += time.perf_counter() - seconds_compiling() - began
            self._cost += cost
            entries.append(entry)
            self.report(
                Totals(
                    done=entry.status == DONE,
                    failed=entry.status == FAILED,
                    diverged=entry.status == DIVERGED,
                    cost=round(cost),
                )
            )
            if self.is_wanted_elsewhere():
                break
        if entries and is_shared:
            self.held.pieces.hold(block.start, data, entries)
        elif entries:
            self.held.hold(block.start, data, entries, flat[damaged])
            self._initial_states.remember(flat, data)

    @property
    def _pace(self) -> float:
        """Mean seconds per predicted step on this rank so far; unknown before the first case."""
        return self._seconds / self._cost if self._cost else 0.0

    def _repair(self, start: tuple[int, ...]) -> None:
        """Recompute the damaged cases of a block on which another depends."""
        self.work(next(block for block in self.grid.blocks() if block.start == start))

    def _enter(self, case: Case, flat: int, data: Arrays, i_case: int, start: InitialState) -> Entry:
        """Compute a case and put its arrays into those of the block; an error becomes its reason to fail."""
        self.watch.begin(flat, case.id)
        try:
            if self.is_wary:
                self.watch.end()
                try_apart(self.grid.study, case, start.state, self._check(PATIENCE))
                self.watch.begin(flat, case.id)
            record = record_of(self.grid, case, self._setups, start.state, self._check(), self.say)
            put(record, data, i_case)
            measures = packed_measures(record, self._record_type).tobytes()
        except Stopped:
            raise
        except Exception as error:
            for values in data.values():
                values[i_case] = np.nan
            return Entry(flat, case.id, FAILED, reason=_reason(error))
        finally:
            self.watch.end()
            self.say("")
        remark = "; ".join(text for text in (start.note, record.remark) if text)
        return Entry(flat, case.id, record.status, case_checksum(data, i_case), measures, remark)

    def _check(self, patience: float = 0.0) -> Callable[[], None]:
        """A function that ends a case which begins now: when the run stops, or its time (s) is over."""
        limit = self.watch.limit
        end = time.monotonic() + limit + patience if limit else float("inf")

        def check() -> None:
            self.attend()
            if self.stopping.look():
                raise Stopped
            if time.monotonic() > end:
                raise _OverTime(f"over its time limit of {limit:g} s")

        return check


def record_of(
    grid: CaseGrid,
    case: Case,
    setups: KeptSetups,
    state: NDArray[np.float64] | None,
    check: Callable[[], None] = lambda: None,
    say: Callable[[str], None] = lambda _: None,
    note: Callable[[float], None] = lambda _: None,
) -> Record | BranchRecord | RunUpRecord:
    """The record of a case of any kind, from a stored state if there is one; `note` receives what is done.

    This is a share of the case, or the value of the parameter that branches have reached.
    """
    study = grid.study
    if study.branch is not None:
        axis = study.axis(study.branch.along)
        return record_branches(
            operation_of(grid, case), study.branch, axis, study.recording, check, say, note
        )
    setup = setups.of(case)
    initial = case.initial if state is None else State.unpacked(state, setup.model)
    return integrate(study, case, setup, initial, check, say, note)


def integrate(
    study: Study,
    case: Case,
    setup: Setup,
    initial: State | Initial,
    check: Callable[[], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
    note: Callable[[float], None] = lambda _: None,
) -> Record | RunUpRecord:
    """The record of a case, at its speed or over its speeds; `check` is called several times a second."""
    keys: Any = {"clearance": case.clearance, "friction": case.friction, "recording": study.recording}
    keys |= {"initial": initial, "check": check, "say": say, "note": note}
    if case.speed_law is None:
        return run_case(setup, **keys)
    return record_run_up(setup, case.speed_law, **keys)


def _reason(error: Exception) -> str:
    """An error as the reason of a failed case, in one line."""
    text = " ".join(str(error).split())
    return text if isinstance(error, (_OverTime, CaseDied)) else f"{type(error).__name__}: {text}"
