"""Times some cases of a study for `rubhpc plan`, each no longer than there is time and memory for."""

from __future__ import annotations

import gc
import math
import signal
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.branches.case import BranchRecord
from rubhpc.integrate.changing_speed.case import RunUpRecord
from rubhpc.integrate.compilation import is_compiling, seconds_compiling
from rubhpc.running.kept_setups import KeptSetups
from rubhpc.running.memory import memory, peak_memory
from rubhpc.running.plan_estimate import relative_error
from rubhpc.running.trail import Timed, Trail
from rubhpc.running.warm_up import WARM, load_kernels, part_of
from rubhpc.running.worker import record_of
from rubhpc.schema import FINAL_STATE
from rubhpc.study.speed_law import SpeedLaw

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.record import Record
    from rubhpc.study.cases import Case, CaseGrid
    from rubhpc.study.contact_keys import Contact

    Index = tuple[int, ...]

_MOST_CASES = 200
_FEW = 6  # cases, which share the time
_ALL = 24  # cases: of a study of up to so many all are begun
_ENOUGH, _AGREED = 3.0, 0.15  # s of cases after which no more are begun if their mean is known so well
_LEAST, _MOST_LATE = 1.5, 8.0  # s of processor time for cases on a busy machine, and of waiting for that
_LEAST_EACH = 0.5  # s for a case
_PARTS, _STRIDE, _OFF = 8, 0.618034, 3.0  # of a run-up; between their places; by how much one may be off
_MOST_RUN_UP = 2.7e9  # bytes of contact modes of a run-up, about: those of other speeds are freed
_AGAIN = 0.25  # s: a case with one stator that takes less is run twice
_LATE = 0.2  # s after its end at which a case is cut that does not ask
MOST_BYTES = 800e6  # of this process, above which a case is cut


class Enough(BaseException):  # no error: what cuts a case, whatever it is doing
    """A case takes longer, or more memory, than there is for it."""


@dataclass(kw_only=True)
class Sample:
    """Cases that were timed.

    Attributes
    ----------
    cases : list of Timed
    failures : list of (tuple of int, str)
        Index of each case that failed, and why.
    arrays : dict
        Signals and the like of the latest case that ended, by name.
    loading : float
        Processor seconds for kernels, which every process needs.
    has_compiled : bool
        Whether kernels were compiled.
    memory : float
        Peak memory of this process without contact modes, bytes.
    was_full : bool
        Whether a case was cut for its memory.
    """

    cases: list[Timed] = field(default_factory=list)
    failures: list[tuple[Index, str]] = field(default_factory=list)
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    loading: float = 0.0
    has_compiled: bool = False
    memory: float = 0.0
    was_full: bool = False


class CaseTimer:
    """Times cases of a grid until a moment of `time.monotonic`, that compilations put off."""

    def __init__(self, grid: CaseGrid, end: float) -> None:
        self._grid, self._study = grid, grid.study
        self._end = end - seconds_compiling()
        self._ready: set[Contact] = set()
        self._setups = KeptSetups(grid.study)
        self._begun: float | None = None  # processor time when the first case began
        self._n_part = 0  # parts of run-ups so far
        self._latest: tuple[Case, Timed] | None = None
        self.sample = Sample()

    @property
    def left(self) -> float:
        """Seconds that are left; on a busy machine more, so that cases get some processor time."""
        left = self._end + seconds_compiling() - time.monotonic()
        begun = math.inf if self._begun is None else self._begun
        least = min(begun - time.process_time(), 0.0) + _LEAST
        return max(left, min(least, left + _MOST_LATE))

    @contextmanager
    def _alarm(self) -> Iterator[None]:
        """Cut what takes long without a check, such as a set-up, once no time is left."""

        def ring(*_: object) -> None:
            if self.left <= 0.0 and not is_compiling():
                raise Enough
            signal.setitimer(signal.ITIMER_REAL, max(self.left, _LATE))

        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = signal.signal(signal.SIGALRM, ring)
        signal.setitimer(signal.ITIMER_REAL, max(self.left, 0.0) + _LATE)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)

    def time_cases(
        self, missing: NDArray[np.bool_], steps: Callable[[Index], float], say: Callable[[str], None]
    ) -> Sample:
        """Time some of the missing cases, spread over all axes; `say` receives their number."""
        sample = self.sample
        n_case = int(missing.sum())
        few = min(n_case, _ALL if n_case <= _ALL else _FEW)
        for k, index in enumerate(spread(missing, _MOST_CASES)):
            if k and self.left <= 0.0:
                break
            spent = sum(case.spent for case in sample.cases)
            if k >= few and spent > _ENOUGH and relative_error(sample.cases, n_case) < _AGREED:
                break
            say(f"timing cases: {len(sample.cases)} so far")
            limit = max(self.left / max(few - k, 2), _LEAST_EACH)
            try:
                with self._alarm():
                    self._add(index, steps(index), limit, missing)
            except Enough:  # before the case began
                break
            except Exception as error:  # the others are timed in spite of an error
                sample.failures.append((index, f"{type(error).__name__}: {' '.join(str(error).split())}"))
        return sample

    def time_half(self, seconds: float) -> float:
        """Time of the latest case that was cut, with every second stator over that with all; NaN if unknown.

        It takes so many seconds more, at most.
        """
        if self._latest is None or any(probe.stator for probe in self._study.recording.probe):
            return math.nan
        (case, whole), self._setups = self._latest, KeptSetups(self._study)
        gc.collect()
        self._end = time.monotonic() + seconds - seconds_compiling()
        fewer = replace(case, rig=replace(case.rig, stator=case.rig.stator[::2]))
        with suppress(Enough, Exception), self._alarm():
            half = self._time(fewer, whole.steps, math.inf)
            if half.most < math.inf:
                return (half.spent + half.rest) / (whole.spent + whole.rest)
        return math.nan

    def _add(self, index: Index, steps: float, limit: float, missing: NDArray[np.bool_]) -> None:
        if memory() > 0.5 * MOST_BYTES:
            self._setups = KeptSetups(self._study)
            gc.collect()
            if memory() > 0.9 * MOST_BYTES and self.sample.cases:
                raise Enough
        began = time.process_time()
        case = self._grid.case(index)
        began_at = time.process_time() - began
        self._load_kernels(case)
        self.sample.memory = self.sample.memory or peak_memory()
        self._begun = self._begun or time.process_time()
        law = case.speed_law
        if isinstance(law, SpeedLaw) and law.n_revolution >= _PARTS * WARM:
            timed = self._time_run_up(case, law, steps, limit)
        else:
            timed = self._time(case, steps, limit)
        timed = replace(timed, speed=timed.speed + began_at)
        if not timed.is_whole and timed.most < math.inf:
            self._latest = case, timed
        other = self._alike(case) if timed.n_mode else case if timed.spent < _AGAIN else None
        if timed.is_whole and other is not None and self.left > timed.spent:  # with the same contact modes
            again = self._time(other, steps, limit)
            if again.is_whole:
                shared = max(timed.spent - again.spent, 0.0)
                timed = replace(timed, spent=timed.spent - shared, shared=shared)
                if other is not case and missing[other.index]:
                    self.sample.cases.append(again)
        self.sample.cases.append(timed)

    def _load_kernels(self, case: Case) -> None:
        """Compile or load the kernels of a law of contact, on the beginning of a case."""
        if case.contact in self._ready:
            return
        compiled, began = seconds_compiling(), time.process_time()
        load_kernels(self._grid, case, self._limit(math.inf))
        self._ready.add(case.contact)
        if seconds_compiling() > compiled:
            self.sample.has_compiled = True
        else:
            self.sample.loading += time.process_time() - began

    def _limit(self, seconds: float) -> Callable[[], None]:
        """Check that ends a case after so many seconds, or for its memory."""
        end = time.monotonic() + seconds - seconds_compiling()

        def check() -> None:
            if memory() > MOST_BYTES:
                self.sample.was_full = True
                raise Enough
            if self.left <= 0.0 or time.monotonic() > end + seconds_compiling():
                raise Enough

        return check

    def _time(self, case: Case, steps: float, limit: float) -> Timed:
        """Run a case once, or again if kernels were compiled."""
        while True:
            compiled = seconds_compiling()
            found = self._run(case, steps, limit)
            if seconds_compiling() == compiled:
                return found
            self.sample.has_compiled = True

    def _time_run_up(self, case: Case, law: SpeedLaw, steps: float, limit: float) -> Timed:
        """Run a part of a run-up somewhere, then all of it if there is time: rub begins late and costs most.

        Contact modes of a part are met again in others: memory is taken to grow with the square root.
        """
        n = law.n_revolution
        n_part = n // _PARTS
        first = int((0.5 + self._n_part * _STRIDE) % 1.0 * (n - n_part))
        self._n_part += 1
        found = self._time(replace(case, speed_law=part_of(law, first, first + n_part)), steps, limit)
        whole = (found.spent + found.rest) * n / n_part
        if found.is_whole and whole <= 0.5 * self.left:
            return self._time(case, steps, 0.5 * self.left)
        rest = whole - found.spent
        return replace(
            found,
            is_whole=False,
            share=found.share * n_part / n,
            rest=rest,
            least=rest / _OFF,
            most=rest * _OFF if found.most < math.inf else math.inf,
            n_byte=min(found.n_byte * math.sqrt(n / n_part), _MOST_RUN_UP),
        )

    def _run(self, case: Case, steps: float, limit: float) -> Timed:
        cut, cut_unknown, record = self._limit(limit), self._limit(math.inf), None
        trail = Trail(self._study, case)

        def check() -> None:
            trail.enter()
            (cut if trail.is_known else cut_unknown)()

        with suppress(Enough):
            trail.begin(None if self._study.branch is not None else self._setups.of(case))
            record = record_of(self._grid, case, self._setups, None, check, note=trail.note)
        if record is not None and not isinstance(record, BranchRecord):
            self.sample.arrays = arrays_of(record)
        return trail.timed(steps, is_whole=record is not None)

    def _alike(self, case: Case) -> Case | None:
        """Another case, far along one axis, that shares the contact modes of this one."""
        for axis, n in enumerate(self._grid.shape):
            index = list(case.index)
            index[axis] = (index[axis] + max(n // 2, 1)) % n
            other = self._grid.case(index) if n > 1 else case
            shared = other.rig is case.rig and other.contact == case.contact
            if other is not case and shared and (other.speed, other.friction) == (case.speed, case.friction):
                return other
        return None


def spread(missing: NDArray[np.bool_], most: int) -> Iterator[Index]:
    """Indices of up to so many missing cases, none twice, spread evenly over all axes.

    The points of M. Roberts' sequence fill the axes evenly, however many there are. Where few cases are
    missing, the sequence runs over those alone.
    """
    n_axis, shape = missing.ndim, np.array(missing.shape)
    flat = np.flatnonzero(missing)
    is_sparse = flat.size <= max(most, 0.2 * missing.size)
    n = 1 if is_sparse else n_axis
    root = 2.0
    for _ in range(50):
        root = (1.0 + root) ** (1.0 / (n + 1))
    pace = root ** -np.arange(1.0, n + 1)
    seen: set[Index] = set()
    for k in range(20 * most):
        if len(seen) == min(most, flat.size):
            return
        place = (0.5 + k * pace) % 1.0
        at = (
            flat[int(place[0] * flat.size)]
            if is_sparse
            else np.ravel_multi_index((place * shape).astype(int), missing.shape)
        )
        index = tuple(int(i) for i in np.unravel_index(at, missing.shape))
        if missing[index] and index not in seen:
            seen.add(index)
            yield index
    for at in flat.tolist():  # the sequence leaves out some of a few
        index = tuple(int(i) for i in np.unravel_index(at, missing.shape))
        if len(seen) < min(most, flat.size) and index not in seen:
            seen.add(index)
            yield index


def arrays_of(record: Record | RunUpRecord) -> dict[str, NDArray[Any]]:
    """All arrays that a store keeps of a record, by name."""
    if isinstance(record, RunUpRecord):
        return record.arrays
    return {**record.signals, **record.spectra, **record.sections, FINAL_STATE: record.final.packed()}
