"""One rank's work on a block: compute its missing cases, store them, journal them."""

from __future__ import annotations

import time
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.branches.case import BranchRecord, record_branches
from rubhpc.integrate.case import run_case
from rubhpc.integrate.changing_speed.case import RunUpRecord, record_run_up
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.integrate.record import State
from rubhpc.running.case_rows import packed_measures, put_any
from rubhpc.running.case_setup import operation_of, set_up
from rubhpc.running.initial_states import InitialState, InitialStates
from rubhpc.running.pool import Totals
from rubhpc.running.rounds import Pieces, lines_of
from rubhpc.running.stopping import Stopped
from rubhpc.schema import DIVERGED, DONE, FAILED, MISSING
from rubhpc.storage.disk import disk_errors, flush_to_disk
from rubhpc.storage.journal import Entry
from rubhpc.storage.store import case_checksum
from rubhpc.study.drive_law import DriveLaw

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.integrate.record import Record
    from rubhpc.integrate.setup import Setup
    from rubhpc.rig.rig import Rig
    from rubhpc.running.stopping import Stopping
    from rubhpc.running.watchdog import Watchdog
    from rubhpc.storage.journal import Journal
    from rubhpc.storage.ledger import Ledger
    from rubhpc.storage.store import Store
    from rubhpc.study.cases import Block, Case, CaseGrid
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.initial import Initial
    from rubhpc.study.study import Study

    Arrays = dict[str, NDArray[Any]]

# Seconds between syncs, at least, and times what the last took: slow disks cost 2 %.
_SYNC_GAP, _SYNC_SHARE = 1.0, 50.0
MOST_SETUPS = 4  # prepared setups a rank keeps; a block shares one, and neighbours often do


class _OverTime(Exception):  # noqa: N818 - becomes the reason of a failed case
    """A case has passed its time limit."""


@dataclass
class Worker:
    """What a rank needs to compute blocks.

    Attributes
    ----------
    missing : (n_case,) bool
        Which cases are to be computed.
    report : callable
        Called with every case that has ended.
    attend : callable
        Called several times a second while a case is computed.
    entered : list of Entry
        Of a refined map, what this rank has computed of whole blocks, or found damaged.
    pieces : Pieces
        What it has computed of blocks that it shares with other ranks.
    say : callable
        Called with what a case that takes long has come to.
    is_wanted_elsewhere : callable
        Asked after every case whether to store what there is of the block and leave the rest of it.
    patience : float
        Seconds for which finished blocks may be held back, since more of their cases may come.
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
        self._setups: OrderedDict[tuple[int, float, Contact, float], tuple[Rig, Setup]] = OrderedDict()
        self._initial_states = InitialStates(self.grid, self.store, self.ledger, self._repair)
        self.entered: list[Entry] = []
        self.pieces = Pieces()
        self.say: Callable[[str], None] = lambda _: None
        self.is_wanted_elsewhere: Callable[[], bool] = lambda: False
        self.patience = 0.0
        self._held: dict[tuple[int, ...], tuple[Arrays, list[Entry]]] = {}
        self._stored = time.monotonic()
        self._unsynced: list[Path] = []
        self._next_sync = time.monotonic() + _SYNC_GAP
        self._seconds, self._cost = 0.0, 0.0

    def work(self, block: Block, *, is_shared: bool = False) -> None:
        """Compute, store and journal what is missing of a block; what is finished when a stop comes is kept.

        Of a block that is shared with other ranks nothing is read, and what is computed is held (`pieces`).

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
            data = self.pieces.rows(block.start) or self.store.blank_block(block.start)
            for values in data.values():
                values[wanted] = np.nan
            damaged = np.zeros_like(wanted)
        else:
            data, damaged = self._kept(block.start, flat, wanted)
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
            self.pieces.hold(block.start, data, entries)
        elif entries:
            entries += self._lost(flat[damaged], entries)
            if self.grid.study.refine is not None:
                self.entered += entries
            self.ledger.enter(lines_of(entries))
            self._initial_states.remember(flat, data)
            held = self._held.get(block.start)
            self._held[block.start] = data, entries if held is None else held[1] + entries
            if self.is_due:
                self.store_held()

    @property
    def is_due(self) -> bool:
        """Whether patience is over with what is held back."""
        return time.monotonic() - self._stored >= self.patience

    def store_pieces(self, starts: Iterable[tuple[int, ...]]) -> None:
        """Add the cases held of shared blocks to what is stored of them, while no other rank does."""
        for start in starts:
            flat = self.store.flat(start)
            rows, entries = self.pieces.take(start)
            wanted = np.isin(flat, [entry.flat for entry in entries])
            data, damaged = self._kept(start, flat, wanted)
            for name, values in data.items():
                values[wanted] = rows[name][wanted]
            lost = self._lost(flat[damaged], entries)
            self.entered += lost
            self.ledger.enter(lines_of(entries + lost))
            self._held[start] = data, entries + lost
        self.store_held()

    def _lost(self, damaged: NDArray[np.int64], entries: list[Entry]) -> list[Entry]:
        """That damaged cases are missing, but for those that have been computed again."""
        lost = set(damaged.tolist()) - {entry.flat for entry in entries}
        return [Entry(flat, self.store.manifest.case_id(flat), MISSING) for flat in lost]

    def store_held(self) -> None:
        """Store and journal the blocks that are held back."""
        if not self._held:
            return
        for start, (data, entries) in self._held.items():
            self.store.write_block(start, data)
            with disk_errors(self.store.path):
                self.journal.write(entries)
            self._unsynced += self.store.chunk_files(start)
        self._held.clear()
        self._stored = time.monotonic()
        if self._stored > self._next_sync:
            self.sync()

    def sync(self) -> None:
        """Return once what has been stored would survive a power failure, the arrays before their lines.

        A process that is killed loses nothing without it.
        """
        began = time.monotonic()
        with disk_errors(self.store.path):
            for path in self._unsynced:
                flush_to_disk(path)
            self.journal.sync()
        self._unsynced.clear()
        ended = time.monotonic()
        self._next_sync = ended + max(_SYNC_GAP, _SYNC_SHARE * (ended - began))

    def take_unsynced(self) -> list[Path]:
        """Return the files that `sync` would write to the disk, arrays before the journal, once."""
        unsynced = [*self._unsynced, *([self.journal.path] if self.journal.is_begun else [])]
        self._unsynced.clear()
        return unsynced

    @property
    def _pace(self) -> float:
        """Seconds a predicted step has taken on this rank so far; nothing is known before the first case."""
        return self._seconds / self._cost if self._cost else 0.0

    def _kept(
        self, start: tuple[int, ...], flat: NDArray[np.int64], wanted: NDArray[np.bool_]
    ) -> tuple[Arrays, NDArray[np.bool_]]:
        """Arrays of the block with the cases that are there already, and which of those are damaged."""
        damaged = np.zeros_like(wanted)
        if start in self._held:
            return self._held[start][0], damaged
        data = self.store.empty_block(start)
        status = self.ledger.status[flat]
        kept = np.flatnonzero(~wanted & ((status == DONE) | (status == DIVERGED)))
        if not len(kept):
            return data, damaged
        stored = self.store.read_block(start)
        for i_case in kept.tolist():
            if stored is None or case_checksum(stored, i_case) != self.ledger.checksum[flat[i_case]]:
                damaged[i_case] = True
                continue
            for name, values in stored.items():
                data[name][i_case] = values[i_case]
        return data, damaged

    def _repair(self, start: tuple[int, ...]) -> None:
        """Recompute the damaged cases of a block on which another depends."""
        self.work(next(block for block in self.grid.blocks() if block.start == start))

    def _enter(self, case: Case, flat: int, data: Arrays, i_case: int, start: InitialState) -> Entry:
        """Compute a case and put its arrays in the block's; what goes wrong in it is its reason to fail."""
        self.watch.begin(flat, case.id)
        try:
            record = self._compute(case, start)
            put_any(record, data, i_case)
            measures = packed_measures(record, self._record_type).tobytes()
        except Stopped:
            raise
        except Exception as error:
            for values in data.values():
                values[i_case] = np.nan
            return Entry(flat, case.id, FAILED, reason=_reason(error))
        finally:
            self.watch.end()
        remark = "; ".join(text for text in (start.note, record.remark) if text)
        return Entry(flat, case.id, record.status, case_checksum(data, i_case), measures, remark)

    def _compute(self, case: Case, start: InitialState) -> Record | BranchRecord | RunUpRecord:
        study = self.grid.study
        limit = self.watch.limit
        end = time.monotonic() + limit if limit else float("inf")

        def check() -> None:
            self.attend()
            if self.stopping.look():
                raise Stopped
            if time.monotonic() > end:
                raise _OverTime(f"over its time limit of {limit:g} s")

        if study.branch is not None:
            span = study.axis(study.branch.along).drawn_from
            assert span is not None
            operation = operation_of(self.grid, case)
            try:
                return record_branches(operation, study.branch, span, study.recording, check, self.say)
            finally:
                self.say("")
        key = (
            id(case.rig),
            case.speed,
            case.contact,
            case.speed_law.inertia or 0.0 if isinstance(case.speed_law, DriveLaw) else 0.0,
        )  # a rig that is kept here keeps its id; hashing it takes as long as a block
        if key in self._setups:
            setup = self._setups[key][1]
        else:
            model = next((kept.model for rig, kept in self._setups.values() if rig is case.rig), None)
            setup = set_up(study, case, model)
            self._setups[key] = (case.rig, setup)
            if len(self._setups) > MOST_SETUPS:
                self._setups.popitem(last=False)
        initial = case.initial if start.state is None else State.unpacked(start.state, setup.model)
        return integrate(study, case, setup, initial, check)


def integrate(
    study: Study,
    case: Case,
    setup: Setup,
    initial: State | Initial,
    check: Callable[[], None] | None = None,
) -> Record | RunUpRecord:
    """The record of a case, at its speed or over its speeds; `check` is called several times a second."""
    if case.speed_law is None:
        return run_case(
            setup,
            clearance=case.clearance,
            friction=case.friction,
            recording=study.recording,
            initial=initial,
            check=check,
        )
    return record_run_up(
        setup,
        case.speed_law,
        clearance=case.clearance,
        friction=case.friction,
        recording=study.recording,
        initial=initial,
        check=check,
    )


def _reason(error: Exception) -> str:
    """An error as the reason of a failed case, in one line."""
    text = " ".join(str(error).split())
    return text if isinstance(error, _OverTime) else f"{type(error).__name__}: {text}"
