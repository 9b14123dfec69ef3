"""Timing of single cases of a study for `rubhpc plan`: whole, or shortened where that would take long."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from rubhpc.integrate.branches.case import record_branches
from rubhpc.integrate.case import compile_kernels, run_case
from rubhpc.integrate.changing_speed.case import RunUpRecord
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.integrate.lyapunov import N_ALIGNING, SPAN
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS, N_FIRST
from rubhpc.integrate.setup import ModalSetup
from rubhpc.running.case_setup import operation_of, set_up, set_up_for_kernels
from rubhpc.running.shorter_cases import parts, shortened
from rubhpc.running.worker import integrate
from rubhpc.schema import FINAL_STATE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.record import Record, State
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.cases import Case, CaseGrid
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.drive_law import DriveLaw
    from rubhpc.study.speed_law import SpeedLaw
    from rubhpc.study.study import Recording

_LONG = 0.25  # s: cases that take longer are shortened where there is no time for the whole of them
_PATIENCE = 3.0  # times as long as foreseen: a case is cut off
_FIRST_STEPS = 50_000  # predicted, of the first run of a case that is shortened
_LONGEST_BRANCHES = 20.0  # s, after which the branches of a case are followed no further
_FIRST_TURNS = 64  # revolutions of a changing speed that are tried first
_WHOLE_TURNS = 3.0  # s: such cases are run whole if that takes no longer
_GROWING = 0.01  # new contact modes over those of all revolutions before: beyond, a motion is irregular
_LATE = 0.25  # least pace of what is left of a shortened case, over that of what was timed


class Pace(NamedTuple):
    """What a run spends its time on, seconds.

    `step` is that of a predicted step, `rig` of assembling a rig, `speed` of preparing it at a speed with the
    modes, `friction` of solving the contact modes of a friction, `block` of writing a block, `case` of a case
    whatever its steps.
    """

    step: float
    rig: float
    speed: float
    friction: float
    block: float = 0.0
    case: float = 0.0


class _Enough(Exception):  # noqa: N818 - no error: what ends the branches of a pilot case
    """A pilot case takes longer than is waited for."""


class Pilots:
    """Times cases of a grid, one after another.

    Attributes
    ----------
    was_cut : bool
        The last one took longer than is waited for.
    loading, compiling : float
        Processor seconds in which kernels were loaded, and in which such were compiled that no cache held.
    shortened : set of tuple of int
        Cases that were not run whole.
    irregular : set of tuple of int
        Those of them that still met new contact modes where they ended.
    arrays : dict
        Signals and the like of the latest case that was run, by name.
    """

    def __init__(self, grid: CaseGrid) -> None:
        self._grid, self._study = grid, grid.study
        self._compiled: set[Contact] = set()
        self._paces: list[float] = []  # of the cases so far, seconds a predicted step
        # Of cases that were run whole after another one: what shared contact modes and the rest took, s.
        self._taken: dict[tuple[int, ...], tuple[float, float]] = {}
        self.was_cut = False
        self.loading = self.compiling = 0.0
        self.shortened: set[tuple[int, ...]] = set()
        self.irregular: set[tuple[int, ...]] = set()
        self._final: State | None = None  # of the latest case that was run
        self.arrays: dict[str, NDArray[Any]] = {}

    def pace(self, index: tuple[int, ...], steps: float, limit: float) -> Pace:
        """Times of a case and of its preparation; shortened where the whole takes longer than `limit`, s.

        With several stators each case meets other sets of contacts. Another case of its speed and friction is
        run after it: the modes that this one did not have to solve are those that such cases share.
        """
        case = self._grid.case(index)
        if self._study.branch is not None:
            return Pace(self._branches(case) / steps, 0.0, 0.0, 0.0)
        rig, speed, setup = self._prepared(case)
        if case.speed_law is not None:
            return Pace(self._turning(case, setup, case.speed_law) / steps, rig, speed, 0.0)
        modes, whole, is_whole = (
            (*self._taken[index], True)
            if index in self._taken
            else self._modes_and_rest(case, setup, steps, limit)
        )
        if not is_whole:
            self.shortened.add(index)
        self._paces.append(whole / steps)
        return Pace(step=whole / steps, rig=rig, speed=speed, friction=modes)

    def _modes_and_rest(
        self, case: Case, setup: Setup, steps: float, limit: float
    ) -> tuple[float, float, bool]:
        """Times of solving contact modes and of a case that finds them solved, and whether it ran whole."""
        modes, runs = self._runs(case, setup, steps, limit)
        done, whole = runs[-1]
        if done < 1.0:  # a rub may begin late, and then costs more
            before = runs[-2] if len(runs) > 1 else (0.0, 0.0)
            slope = max((whole - before[1]) / (done - before[0]), _LATE * whole / done)
            whole += (1.0 - done) * slope
        if not _is_ring(setup):
            return modes, whole, done == 1.0
        a_mode = modes / max(_n_solved(setup, case), 1)
        whole += modes
        if done < 1.0:
            n_later, longer = self._to_come(case, setup, done, max(limit, modes))
            whole += n_later * a_mode + longer * (whole - modes)
        known = a_mode * _n_solved(setup, case)  # s, of modes that the whole case finds solved
        cut_off = _PATIENCE * limit
        try:
            if done < 1.0 and whole - known <= limit:
                whole, done = known + self._run(case, setup, self._study.recording, cut_off), 1.0
                self.irregular.discard(case.index)
        except _Enough:
            return 0.0, max(whole, known + cut_off), False
        if done < 1.0 or (other := self._alike(case)) is None:
            return 0.0, whole, done == 1.0
        met = _n_solved(setup, case)
        try:
            later = self._run(other, setup, self._study.recording, cut_off)
        except _Enough:  # a mean of both, the other's from below
            return 0.0, 0.5 * (whole + max(whole, cut_off)), False
        shared = min(a_mode * max(2 * met - _n_solved(setup, case), 0), 0.9 * whole)
        self._taken[other.index] = shared, later
        return shared, 0.5 * (whole - shared + later), True

    def _to_come(self, case: Case, setup: Setup, done: float, limit: float) -> tuple[float, float]:
        """Contact modes that the rest of a case meets, and revolutions of its tangent over those of the case.

        It is followed further, for as long again each time, until `limit` s have gone by. Where it meets
        hardly any mode that is new, it is taken to come back to them for ever. Elsewhere it is irregular, and
        each doubling of its revolutions, its tangent's included, is taken to meet half as many as the last:
        the sets of contacts that a whip comes to are many, but not without end.
        """
        recording = self._study.recording
        first = before = met = _n_solved(setup, case)
        if self._final is None or not met:
            return 0.0, 0.0
        left = limit
        while True:
            left -= self._run(case, setup, shortened(recording, done), initial=self._final)
            before, met, done = met, _n_solved(setup, case), 2.0 * done
            if met - before <= _GROWING * before:
                return float(met - first), 0.0
            if 2.0 * done > 1.0 or left <= 0.0:
                break
        self.irregular.add(case.index)
        n_turn = recording.longest_transient + recording.revolutions
        longer = _beyond(recording.revolutions) / n_turn
        n_doubling = math.log2(max((1.0 + longer) / done, 1.0))
        return met - first + (met - before) * (1.0 - 0.5**n_doubling), longer

    def _alike(self, case: Case) -> Case | None:
        """Another case, far along one axis, that shares the contact modes of this one."""
        for axis, n in enumerate(self._grid.shape):
            index = list(case.index)
            index[axis] = (index[axis] + max(n // 2, 1)) % n
            other = self._grid.case(index)
            shared = other.rig is case.rig and other.contact == case.contact
            if shared and (other.speed, other.friction) == (case.speed, case.friction) and n > 1:
                return other
        return None

    def _prepared(self, case: Case) -> tuple[float, float, Setup]:
        """Times of assembling the rig and of preparing the speed, and the set-up, its kernels compiled."""
        if case.contact not in self._compiled:
            compiled, began = seconds_compiling(), time.process_time()
            compile_kernels(
                set_up_for_kernels(self._study, case),
                clearance=case.clearance,
                friction=case.friction,
                recording=self._study.recording,
            )
            self._compiled.add(case.contact)
            if seconds_compiling() == compiled:
                self.loading += time.process_time() - began
            else:
                self.compiling += time.process_time() - began
        began = time.process_time()
        setup = set_up(self._study, case)
        middle = time.process_time()
        set_up(self._study, case, setup.model)
        prepared = time.process_time() - middle
        return max(0.0, middle - began - prepared), prepared, setup

    def _runs(
        self, case: Case, setup: Setup, steps: float, limit: float
    ) -> tuple[float, list[tuple[float, float]]]:
        """What contact modes took, s; shares of the case that were run, each longer than the last, and times.

        A run is as long as `limit`, s, allows.
        """
        whole = self._study.recording
        known = max(self._paces, default=math.nan) * steps
        ends_by_itself = isinstance(whole.transient, str)  # nobody knows when, but by trying
        is_short = known < _LONG and not _is_ring(setup)
        share = 1.0 if ends_by_itself or is_short else min(1 / 16, _FIRST_STEPS / steps)
        modes = 0.0
        runs: list[tuple[float, float]] = []
        while True:
            recording = shortened(whole, share)
            taken = self._run(case, setup, recording)
            done = (recording.longest_transient + recording.revolutions) / (
                whole.longest_transient + whole.revolutions
            )
            if not runs and (done < 1.0 or (taken < _LONG and not _is_ring(setup))):
                again = min(taken, self._run(case, setup, recording))
                modes, taken = taken - again, again
            runs.append((done, taken))
            longer = min(1.0, done * limit / taken, 4 * share)
            if done == 1.0 or _is_ring(setup) or (longer < 1.0 and longer < 2 * share):
                return modes, runs
            share = longer

    def whole(self, index: tuple[int, ...], steps: float, guessed: Pace, limit: float) -> Pace:
        """Times of a whole case; `was_cut` and the longer of guess and `limit` (s) where it takes longer."""
        case = self._grid.case(index)
        while True:
            setup = set_up(self._study, case)
            compiled, began = seconds_compiling(), time.process_time()
            try:
                integrate(self._study, case, setup, case.initial, _limited(limit))
            except _Enough:
                self.was_cut = True
            taken = time.process_time() - began
            if seconds_compiling() == compiled:
                break
            self.compiling += taken
            self.was_cut = False
        self.irregular.discard(index)
        if self.was_cut:
            taken = max(taken, guessed.step * steps + guessed.friction)
        return guessed._replace(step=max(taken - guessed.friction, 0.0) / steps)

    def _turning(self, case: Case, setup: Setup, law: SpeedLaw | DriveLaw) -> float:
        """Time of a case whose speed changes, which takes most of it for setting up its pieces."""
        n, turns = law.n_revolution, min(law.n_revolution, _FIRST_TURNS)
        while True:
            taken = sum(
                self._timed(
                    partial(integrate, self._study, replace(case, speed_law=part), setup, case.initial)
                )
                for part in parts(law, turns)
            )
            whole = taken * n / turns
            longer = n if whole <= _WHOLE_TURNS else min(n, round(turns * _WHOLE_TURNS / 2 / taken))
            if turns == n or longer < 2 * turns:
                return whole
            turns = longer

    def _branches(self, case: Case) -> float:
        """Time of the branches of a case; `was_cut` where they were not followed to their ends."""
        study = self._study
        assert study.branch is not None
        span = study.axis(study.branch.along).drawn_from
        assert span is not None

        while True:
            compiled, began = seconds_compiling(), time.process_time()
            try:
                record_branches(
                    operation_of(self._grid, case),
                    study.branch,
                    span,
                    study.recording,
                    _limited(_LONGEST_BRANCHES),
                )
            except _Enough:
                self.was_cut = seconds_compiling() == compiled
            taken = time.process_time() - began
            if seconds_compiling() == compiled:
                return taken
            self.compiling += taken

    def _run(
        self,
        case: Case,
        setup: Setup,
        recording: Recording,
        most: float = math.inf,
        initial: State | None = None,
    ) -> float:
        """Processor time of a case, s, from elsewhere if asked for; `_Enough` beyond `most`."""
        return self._timed(
            lambda: run_case(
                setup,
                clearance=case.clearance,
                friction=case.friction,
                recording=recording,
                initial=initial or case.initial,
                check=_limited(most),
            )
        )

    def _timed(self, run: Callable[[], Record | RunUpRecord]) -> float:
        """Processor time of what yields a record, s; it is run once more where kernels were compiled."""
        while True:
            compiled, began = seconds_compiling(), time.process_time()
            record = None
            with suppress(_Enough):
                record = run()
            taken = time.process_time() - began
            if seconds_compiling() == compiled:
                if record is None:
                    raise _Enough
                self.arrays, self._final = arrays_of(record), getattr(record, "final", None)
                return max(taken, 1e-6)
            self.compiling += taken


def _is_ring(setup: Setup) -> bool:
    return len(setup.model.stators) > 1


def _n_solved(setup: Setup, case: Case) -> int:
    """Contact modes that cases of this friction have had solved so far."""
    return setup.n_solved(case.friction) if isinstance(setup, ModalSetup) else 0


def arrays_of(record: Record | RunUpRecord) -> dict[str, NDArray[Any]]:
    """All that a store keeps of a record, by name."""
    if isinstance(record, RunUpRecord):
        return record.arrays
    return {**record.signals, **record.spectra, **record.sections, FINAL_STATE: record.final.packed()}


def _limited(seconds: float) -> Callable[[], None]:
    """What ends a case after so much processor time from now."""
    end = time.process_time() + seconds

    def check() -> None:
        if time.process_time() > end:
            raise _Enough

    return check


def _beyond(n_recorded: int) -> int:
    """Revolutions behind a record for which an irregular motion's tangent is carried at least."""
    counted = n_recorded // SPAN - N_ALIGNING  # spans of the record
    return SPAN * max(N_FIRST - counted, 0) if n_recorded >= LEAST_REVOLUTIONS else 0
