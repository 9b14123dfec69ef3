"""Timing of single cases of a study for `rubhpc plan`: whole, or shortened where that would take long."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.integrate.branches.case import record_branches
from rubhpc.integrate.case import compile_kernels
from rubhpc.integrate.changing_speed.case import RunUpRecord
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.running.case_setup import operation_of, set_up, set_up_for_kernels
from rubhpc.running.followed_case import FollowedCase, is_ring
from rubhpc.running.forecast import Forecast, usual_behind
from rubhpc.running.kept_setups import MOST_BYTES
from rubhpc.running.memory import free_memory, peak_memory
from rubhpc.running.stopwatch import Stopwatch
from rubhpc.running.timed_run_ups import time_run_up
from rubhpc.schema import FINAL_STATE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.record import Record
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.cases import Case, CaseGrid
    from rubhpc.study.contact_keys import Contact

_LONG = 0.25  # s: longer cases are run part by part, and stopped where there is no time for the whole
_MOST_KEPT, _OF_FREE = 2 * MOST_BYTES, 0.25  # bytes of unfinished cases, and share of free memory
_LONGEST_BRANCHES = 20.0  # s, after which the branches of a case are stopped


class Pace(NamedTuple):
    """Parts of the time of a run, seconds.

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


class Pilots:
    """Times cases of a grid, one after another.

    Attributes
    ----------
    was_cut : bool
        The branches of the last one were not followed to their ends.
    covered : float
        Share of the range of the parameter that they had covered.
    loading : float
        Processor seconds in which kernels were loaded.
    shortened : dict
        Forecasts of cases that were not run whole, by their indices.
    alike : dict
        The other case that was timed after a case in a ring, by their indices.
    irregular : set of tuple of int
        Those of them that still met new contact modes where they were stopped.
    ended : set of tuple of int
        Those of them that were run to their ends later.
    arrays : dict
        Signals and the like of the latest case that was run, by name.
    modes : dict
        Bytes of contact modes that cases of one set-up and friction held in a ring, by the index of the last.
    memory : float
        Peak memory of this process before the first case, with its kernels loaded, bytes.
    """

    def __init__(self, grid: CaseGrid) -> None:
        self._grid, self._study = grid, grid.study
        self._compiled: set[Contact] = set()
        self._paces: list[float] = []  # of the cases so far, seconds a predicted step
        # Of cases that were run whole after another one: what shared contact modes and the rest took, s.
        self._taken: dict[tuple[int, ...], tuple[float, float]] = {}
        self._stopwatch = Stopwatch()
        self._followed: list[tuple[int, float]] = []  # of whole cases: revolutions after the record, and s
        self._kept: dict[tuple[int, ...], FollowedCase] = {}  # that may be finished
        self._spent: dict[tuple[int, ...], float] = {}  # s, on cases that were shortened
        self._first: dict[tuple[int, ...], tuple[Forecast, float]] = {}  # what was predicted then, and spent
        self._usual = 0.0  # revolutions after the record
        self._longest = 0.0  # s, of the longest case, as far as it was run
        self.was_cut, self.covered = False, 0.0
        self.loading = 0.0
        self.alike: dict[tuple[int, ...], tuple[int, ...]] = {}
        self.shortened: dict[tuple[int, ...], Forecast] = {}
        self.irregular: set[tuple[int, ...]] = set()
        self.ended: set[tuple[int, ...]] = set()
        self.arrays: dict[str, NDArray[Any]] = {}
        self.modes: dict[tuple[int, ...], int] = {}
        self.memory = 0.0

    @property
    def compiling(self) -> float:
        """Processor seconds of compilations that were not in a cache."""
        return self._stopwatch.compiling

    @property
    def n_behind(self) -> float:
        """Likely revolutions after the record of a long case.

        The mean over the cases that were run whole, weighted by their times, and the default with the weight
        of the longest case: the tangent of a whip often needs more revolutions than that of a short case.
        """
        followed = sum(n * seconds for n, seconds in self._followed)
        whole = sum(seconds for _, seconds in self._followed)
        return (followed + self._usual * self._longest) / (whole + self._longest) if whole else self._usual

    def predicted(self, index: tuple[int, ...]) -> float:
        """Predicted time of a shortened case, s, from all cases so far."""
        return self.shortened[index].whole(self.n_behind)

    def pace(self, index: tuple[int, ...], steps: float, limit: float) -> Pace:
        """Times of a case and of its preparation; shortened where the whole takes longer than `limit`, s.

        With several stators each case meets other sets of contacts. Another case of the same speed and
        friction is run after it: the modes that it need not solve are those that such cases share.
        """
        case = self._grid.case(index)
        if self._study.branch is not None:
            return Pace(self._branches(case) / steps, 0.0, 0.0, 0.0)
        rig, speed, setup = self._prepared(case)
        self.memory = self.memory or peak_memory()
        if case.speed_law is not None:
            seconds, record = time_run_up(self._study, case, setup, case.speed_law, self._stopwatch)
            self.arrays = arrays_of(record)
            return Pace(seconds / steps, rig, speed, 0.0)
        modes, rest = self._taken.get(index) or self._modes_and_rest(case, setup, steps, limit)
        self._note_modes(index, setup)
        self._paces.append(rest / steps)
        return Pace(step=rest / steps, rig=rig, speed=speed, friction=modes)

    def _note_modes(self, index: tuple[int, ...], setup: Setup) -> None:
        if is_ring(setup) and isinstance(setup, ModalSetup) and setup.n_byte:
            self.modes[index] = max(setup.n_byte.values()) + setup.n_byte_of_parts

    def _modes_and_rest(self, case: Case, setup: Setup, steps: float, limit: float) -> tuple[float, float]:
        """Times of contact modes that are shared with other cases, and of a case that finds them solved."""
        recording = self._study.recording
        followed = FollowedCase(setup, case, recording, self._stopwatch)
        alike = self._alike(case) if is_ring(setup) else None
        limit = limit if alike is None else 0.5 * limit
        is_short = max(self._paces, default=math.nan) * steps < _LONG and not is_ring(setup)
        if isinstance(recording.transient, str) or recording.lyapunov or is_short:
            followed.run_at_once()  # the end of a transient is found only by running it
        else:
            followed.follow(steps, self.n_behind, limit)
        self._take_in(followed)
        if alike is None:
            if followed.is_whole:
                return followed.modes, followed.seconds - followed.modes
            return 0.0, self._left(case, followed)
        met = followed.n_solved
        other = FollowedCase(setup, alike, recording, self._stopwatch)
        other.follow(steps, self.n_behind, limit)
        self._take_in(other)
        self.alike[case.index] = alike.index
        shared = 0.0
        if followed.is_whole and other.is_whole:
            shared = min(followed.a_mode * max(2 * met - other.n_solved, 0), 0.9 * followed.seconds)
        rest = followed.seconds - shared if followed.is_whole else self._left(case, followed)
        self._taken[alike.index] = shared, other.seconds if other.is_whole else self._left(alike, other)
        return shared, rest

    def _take_in(self, followed: FollowedCase) -> None:
        """Use the results of a case."""
        self._longest = max(self._longest, followed.seconds)
        if followed.is_whole:
            self._followed.append((followed.n_behind, followed.seconds))
        if followed.record is not None and (followed.is_whole or not self.arrays):
            self.arrays = arrays_of(followed.record)

    def _left(self, case: Case, followed: FollowedCase) -> float:
        """Use a case that was not run whole; returns its predicted time, s."""
        self._predict(case.index, followed)
        self._first[case.index] = self.shortened[case.index], followed.seconds
        self._kept[case.index] = followed
        self._kept = self._affordable()
        return self.predicted(case.index)

    def _predict(self, index: tuple[int, ...], followed: FollowedCase) -> None:
        self.shortened[index], self._spent[index] = followed.forecast(), followed.seconds
        (self.irregular.add if followed.is_irregular else self.irregular.discard)(index)
        self._longest = max(self._longest, self.predicted(index))

    def _affordable(self) -> dict[tuple[int, ...], FollowedCase]:
        """The longest of the cases that may be finished, and others while contact modes leave memory."""
        kept: dict[tuple[int, ...], FollowedCase] = {}
        held: set[int] = set()
        n_byte, most = 0, min(_MOST_KEPT, max(MOST_BYTES, _OF_FREE * free_memory()))
        for index in sorted(self._kept, key=self.predicted, reverse=True):
            setup = self._kept[index].setup
            more = 0 if id(setup) in held else bytes_of_modes(setup)
            if not kept or n_byte + more <= most:
                kept[index] = self._kept[index]
                held.add(id(setup))
                n_byte += more
        return kept

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
                self._stopwatch.compiling += time.process_time() - began
        began = time.process_time()
        setup = set_up(self._study, case)
        middle = time.process_time()
        set_up(self._study, case, setup.model)
        prepared = time.process_time() - middle
        self._usual = usual_behind(setup, self._study.recording)
        return max(0.0, middle - began - prepared), prepared, setup

    def spent(self, index: tuple[int, ...]) -> float:
        """Time of a shortened case so far, s."""
        return self._spent[index]

    def first(self, index: tuple[int, ...]) -> tuple[float, float]:
        """Time of a case when it was shortened, and the predicted rest, s."""
        forecast, spent = self._first[index]
        return spent, forecast.whole(self.n_behind) - spent

    def left(self, index: tuple[int, ...]) -> float:
        """Predicted time to finish a shortened case, s; 0 where it is no longer kept."""
        return self.predicted(index) - self._kept[index].seconds if index in self._kept else 0.0

    def seconds_of_next(self, index: tuple[int, ...]) -> float:
        """Approximate time of the next part of a shortened case, s."""
        return self._kept[index].seconds_of_next

    def go_on(self, index: tuple[int, ...], limit: float) -> bool:
        """Run the next part of a shortened case; returns whether it ended within `limit` s."""
        followed = self._kept[index]
        is_done = followed.go_on(limit)
        self._note_modes(index, followed.setup)
        if followed.is_whole:
            self._take_in(followed)
            self.ended.add(index)
        self._predict(index, followed)
        if followed.is_whole or not is_done:
            del self._kept[index]
        return is_done

    def _branches(self, case: Case) -> float:
        """Time of the branches of a case; where they were not followed to their ends it is predicted.

        The first branch runs from its start to one end of the range, then to the other. The part covered when
        it `was_cut` is a sample of the whole range. Folds and further branches are not predicted.
        """
        study = self._study
        branch = study.branch
        assert branch is not None
        axis = study.axis(branch.along)
        span = axis.drawn_from
        assert span is not None
        seen: list[float] = []
        taken, record = self._stopwatch.timed(
            lambda check: record_branches(
                operation_of(self._grid, case), branch, axis, study.recording, check, note=seen.append
            ),
            _LONGEST_BRANCHES,
        )
        self.was_cut = record is None
        self.covered = float(np.ptp(seen) / abs(span.stop - span.start)) if seen else 0.0
        return taken / self.covered if self.was_cut and self.covered > 0.0 else taken


def bytes_of_modes(setup: Setup) -> int:
    """Memory of the contact modes of a ring, bytes; that of one pair is negligible."""
    if not (is_ring(setup) and isinstance(setup, ModalSetup)):
        return 0
    return sum(setup.n_byte.values()) + setup.n_byte_of_parts


def arrays_of(record: Record | RunUpRecord) -> dict[str, NDArray[Any]]:
    """All arrays that a store keeps of a record, by name."""
    if isinstance(record, RunUpRecord):
        return record.arrays
    return {**record.signals, **record.spectra, **record.sections, FINAL_STATE: record.final.packed()}
