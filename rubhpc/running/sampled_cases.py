"""Times a few cases of a study for `rubhpc plan`, each no longer than there is time and memory for."""

from __future__ import annotations

import gc
import math
import signal
import sys
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.integrate.compilation import is_compiling, seconds_compiling
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS
from rubhpc.running.case_setup import KeptSetups
from rubhpc.running.warm_up import WARM, part_of, warm_up
from rubhpc.running.worker import record_of
from rubhpc.study.speed_law import SpeedLaw

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

    from numpy.typing import NDArray

    from rubhpc.study.cases import Case, CaseGrid
    from rubhpc.study.study import Study

    Index = tuple[int, ...]

_STATUS = Path("/proc/self/status")
_PRIMES = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37]
_MOST_CASES = 400
_FEW = 6  # cases, which share the time
_ALL = 24  # cases: of a study of up to so many all are begun
_ENOUGH, _AGREED = 3.0, 2.0  # s of cases after which no more are begun if most over least is less
_LEAST = 0.5  # s for a case
_LEAST_SHARE = 0.1  # of a case, for its memory, which grows with the root of it
_TOGETHER, _LONG = 8, 1.0  # cases of a batch at most, and s after which no more are begun
_TICK = 0.1  # s between looks at time and memory
MOST_MEMORY = 650e6  # bytes of this process, above which a case is cut: tables grow by half at once
_RECORDED = 0.8  # share of a case that transient and record are: motions without a period are followed
_PARTS, _STRIDE = 8, 0.618034  # of a run-up; between them
_BRANCHES = 2.0  # that are followed in all, over the first one
_OFF, _MOST_OFF = 0.4, 3.0  # root of a share by which its rest is off, and factor at most
_MACHINE = 0.15  # reach of a range at least: processor times change with what else a machine does
_UPWARD = 1.3  # reach of a range upwards over that downwards: long cases are rare, and missed more often
_ALONE, _LONGEST = math.log(2.5), math.log(6.0)  # reach from one batch of several, and at most


class Enough(BaseException):  # no error: what cuts a case, whatever it is doing
    """A case takes longer, or more memory, than there is for it."""


class Estimate(NamedTuple):
    """A time, s, and its range."""

    seconds: float
    least: float
    most: float


@dataclass(frozen=True, kw_only=True)
class Timed:
    """Processor times of a case, or of a batch of cases that share a set-up, s.

    Attributes
    ----------
    n_case : int
    steps : float
        Predicted.
    spent : float
        As far as it was run, without set-ups.
    set_up, n_set_up : float, int
        Time of set-ups, and their number.
    share : float
        Share of the case, or of the least of a batch, that was run; 0 where that is not known.
    rest, least, most : float
        Predicted time of the rest, and a range of it.
    n_byte : float
        Memory that it took, for each friction.
    """

    n_case: int = 1
    steps: float
    spent: float
    set_up: float = 0.0
    n_set_up: int = 1
    share: float = 1.0
    rest: float = 0.0
    least: float = 0.0
    most: float = 0.0
    n_byte: float = 0.0

    @property
    def whole(self) -> float:
        """Time from its beginning to its end."""
        return self.spent + self.rest


@dataclass(kw_only=True)
class Sample:
    """Cases that were timed.

    Attributes
    ----------
    batches : list of Timed
    failures : list of (tuple of int, str)
        Index of each case that failed, and why.
    loading : float
        Processor seconds for kernels, which every process needs.
    has_compiled : bool
        Whether kernels were compiled.
    memory : float
        Memory of this process before the first case, bytes.
    cut : list of float
        Shares that were run of cases that were cut.
    was_full : bool
        Whether one of them was cut for its memory.
    """

    batches: list[Timed] = field(default_factory=list)
    failures: list[tuple[Index, str]] = field(default_factory=list)
    loading: float = 0.0
    has_compiled: bool = False
    memory: float = 0.0
    cut: list[float] = field(default_factory=list)
    was_full: bool = False

    @property
    def n_case(self) -> int:
        """Number of cases that were begun."""
        return sum(batch.n_case for batch in self.batches)

    @property
    def set_up(self) -> float:
        """Time of a set-up."""
        n = sum(batch.n_set_up for batch in self.batches)
        return sum(batch.set_up for batch in self.batches) / max(n, 1)

    def estimate(self, n_case: int, steps: float) -> Estimate:
        """Time of `n_case` cases with so many predicted steps together, without set-ups.

        Times are proportional to predicted steps on average: the ratio of the sums of both. The range has the
        error of that ratio, and the least and most time of cases that were cut. Those of whose rest nothing
        is known count only if there are no others.
        """
        batches = [batch for batch in self.batches if batch.most < math.inf] or self.batches
        if not batches:
            return Estimate(math.nan, math.nan, math.nan)
        n, n_timed = len(batches), sum(batch.n_case for batch in batches)
        timed = np.array([[b.spent + b.least, b.whole, b.spent + b.most] for b in batches])
        own = np.array([batch.steps for batch in batches])
        share = min(float(own.sum()) / steps, 1.0) if n_timed < n_case else 1.0
        least, seconds, most = (timed.sum(axis=0) / share).tolist()
        reach = 0.0
        if n_timed < n_case:
            off = timed[:, 1] / timed[:, 1].sum() - own / own.sum()
            error = math.sqrt((1.0 - n_timed / n_case) * n / max(n - 1, 1) * float(off @ off))
            student = 2.0 + 3.0 / max(n - 1, 1)  # 19 of 20 plans, if times were normal
            reach = _ALONE if n == 1 else min(math.hypot(_MACHINE, student * error), _LONGEST)
        low = math.hypot(reach, math.log(seconds / least))
        high = math.hypot(_UPWARD * reach, math.log(most / seconds))
        return Estimate(seconds, seconds * math.exp(-low), seconds * math.exp(high))


class CaseTimer:
    """Times cases of a grid until a moment of `time.monotonic`, that compilations put off."""

    def __init__(self, grid: CaseGrid, end: float) -> None:
        self._grid, self._study = grid, grid.study
        self._end = end - seconds_compiling()
        self._most_memory = max(MOST_MEMORY, 1.5 * memory())  # a script may hold more than that
        self._peak = 0.0  # memory since the beginning of the latest batch
        self._setups = KeptSetups(grid.study)
        self._n_part = 0  # parts of run-ups so far
        self._latest: tuple[Case, Timed] | None = None  # that was cut
        self.sample = Sample()

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return self._end + seconds_compiling() - time.monotonic()

    def time_cases(
        self,
        missing: NDArray[np.bool_],
        steps: float,
        steps_of: Callable[[Index], float],
        say: Callable[[str], None],
    ) -> Sample:
        """Time some of the missing cases, spread over all axes; `say` receives their number.

        All have so many predicted steps, and each of them what `steps_of` returns.
        """
        sample, n_missing, untimed = self.sample, int(missing.sum()), missing.copy()
        least = n_missing if n_missing <= _ALL else _FEW
        for index in in_spread_order(missing):
            if not untimed[index]:
                continue
            n, spent = sample.n_case, sum(batch.spent for batch in sample.batches)
            _, low, high = sample.estimate(n_missing, steps)
            is_known = n >= least and spent > _ENOUGH and high < _AGREED * low
            if is_known or n + len(sample.failures) >= _MOST_CASES or (n and self.left <= 0.0):
                break
            if memory() > 0.5 * self._most_memory:
                self._free()
                if n and memory() > 0.9 * self._most_memory:
                    break
            say(f"timing cases: {n} so far")
            try:
                with self._guarded():
                    self._time_batch(self._related(index, untimed), steps_of(index), untimed)
            except Enough:
                break
        return sample

    def _related(self, index: Index, untimed: NDArray[np.bool_]) -> list[Index]:
        """A case, and untimed ones that share its set-up, as in a run; those with its friction first."""
        own, found = self._grid.setup_values(index), []
        for axis, n in enumerate(untimed.shape):
            n_place = min(n, _TOGETHER)
            for k in range(1, n_place):
                at = (*index[:axis], (index[axis] + k * n // n_place) % n, *index[axis + 1 :])
                if untimed[at] and self._grid.setup_values(at)[0] == own[0]:
                    found.append(at)
        found.sort(key=lambda at: self._grid.setup_values(at) != own)
        return [index, *found[: _TOGETHER - 1]]

    def _free(self) -> None:
        self._setups = KeptSetups(self._study)
        gc.collect()

    def time_half(self, seconds: float) -> float:
        """Time of the latest case that was cut, with every second stator over that with all; NaN if unknown.

        It takes so many seconds more, at most.
        """
        if self._latest is None or any(probe.stator for probe in self._study.recording.probe):
            return math.nan
        case, whole = self._latest
        self._free()
        self._end = time.monotonic() + seconds - seconds_compiling()
        fewer = replace(case, rig=replace(case.rig, stator=case.rig.stator[::2]))
        with suppress(Enough, Exception), self._guarded():
            half = self._time(fewer, whole.steps, seconds)
            if half.most < math.inf:
                return half.whole / whole.whole
        return math.nan

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Cut what takes too long, or too much memory, without a check: set-ups do."""

        def look(_: int, frame: FrameType | None) -> None:
            # Python drops what is raised within a callback for what is freed: the next look raises it.
            if frame is None or "weakref" not in frame.f_globals.get("__name__", ""):
                self._look()

        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = signal.signal(signal.SIGALRM, look)
        signal.setitimer(signal.ITIMER_REAL, _TICK, _TICK)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)

    def _look(self) -> None:
        """Cut what is under way where there is no time or memory for any case."""
        if is_compiling():
            return
        self._peak = max(self._peak, now := memory())
        self.sample.was_full |= now > self._most_memory
        if now > self._most_memory or self.left <= 0.0:
            raise Enough

    def _time_batch(self, indices: list[Index], steps: float, untimed: NDArray[np.bool_]) -> None:
        """Time related cases one after the other, few if they take long, and strike them off."""
        sample = self.sample
        before = self._peak = memory()
        index, cases = indices[0], list[Timed]()
        known = set[tuple[tuple[float, ...], float]]()  # set-ups and frictions
        try:
            self._load_kernels(index)
            for index in indices:
                n, n_left = sample.n_case + len(cases), int(untimed.sum())
                limit = max(self.left / min(max(_FEW - n, 2), n_left), _LEAST)
                untimed[index] = False
                began = time.process_time()
                case = self._grid.case(index)
                made = time.process_time() - began
                known.add(self._grid.setup_values(index))
                timed = self._time_any(case, steps, limit)
                cases.append(replace(timed, set_up=timed.set_up + made))
                if timed.share < 1.0:
                    sample.cut.append(timed.share)
                    self._setups = KeptSetups(self._study)  # those of a case that was cut may be damaged
                    self._latest = (case, timed) if timed.share > 0.0 else self._latest
                    break
                is_long = sum(case.spent for case in cases) > _LONG
                if is_long or memory() > 0.7 * self._most_memory or self.left <= 0.0:
                    break
        except Exception as error:  # others are timed in spite of an error
            sample.failures.append((index, f"{type(error).__name__}: {' '.join(str(error).split())}"))
        finally:
            untimed[index] = False
            if cases:
                share = min(case.share for case in cases)
                grown = (self._peak - before) / len(known) / math.sqrt(max(share, _LEAST_SHARE))
                sample.batches.append(
                    joined(cases, n_set_up=len({key for key, _ in known}), share=share, n_byte=grown)
                )

    def _load_kernels(self, index: Index) -> None:
        """Compile or load the kernels of the study, once."""
        if self.sample.memory:
            return
        self.sample.memory = memory()
        compiled, began = seconds_compiling(), time.process_time()
        warm_up(self._grid, index, lambda: None)
        if seconds_compiling() > compiled:
            self.sample.has_compiled = True
        else:
            self.sample.loading = time.process_time() - began

    def _time_any(self, case: Case, steps: float, limit: float) -> Timed:
        """Run a case, or a part of a long run-up and all of it if there is time.

        Rub begins late in a run-up, and costs most: parts of several are taken from other speeds each.
        """
        law = case.speed_law
        if not isinstance(law, SpeedLaw) or law.n_revolution < _PARTS * WARM:
            return self._time(case, steps, limit)
        n = law.n_revolution
        n_part = n // _PARTS
        first = int((0.5 + self._n_part * _STRIDE) % 1.0 * (n - n_part))
        self._n_part += 1
        part = replace(case, speed_law=part_of(law, first, first + n_part))
        found = self._time(part, steps, limit)
        whole = found.whole * n / n_part
        if found.share == 1.0 and whole <= 0.5 * self.left:
            return self._time(case, steps, 0.5 * self.left)
        rest = whole - found.spent
        most = rest * _MOST_OFF if found.most < math.inf else math.inf
        share = found.share * n_part / n
        return replace(found, share=share, rest=rest, least=rest / _MOST_OFF, most=most)

    def _time(self, case: Case, steps: float, limit: float) -> Timed:
        """Run a case, or again if kernels were compiled."""
        while True:
            compiled, is_whole, until = seconds_compiling(), False, self.left - limit
            trail = Trail(self._study)

            def check(trail: Trail = trail, until: float = until) -> None:
                self._look()
                if self.left < until and trail.share > 0.0:
                    raise Enough

            with suppress(Enough):
                if self._study.branch is None:
                    self._setups.of(case)
                trail.begin()
                record_of(self._grid, case, self._setups, None, check, note=trail.noted.append)
                is_whole = True
            if seconds_compiling() == compiled:
                self._peak = max(self._peak, memory())
                return trail.timed(steps, is_whole=is_whole)
            self.sample.has_compiled = True


class Trail:
    """Time and share of a case as it goes on.

    Attributes
    ----------
    noted : list of float
        Shares of the case that were done, or values of the parameter that branches have reached.
    """

    def __init__(self, study: Study) -> None:
        self._study = study
        self._began, self._set_up = time.process_time(), 0.0
        self.noted: list[float] = []

    def begin(self) -> None:
        """Begin the case: its set-up ends."""
        now = time.process_time()
        self._set_up, self._began = now - self._began, now

    @property
    def share(self) -> float:
        """Share of the case that is done, about; 0 where that is not known."""
        study = self._study
        if not self.noted:
            return 0.0
        if study.branch is not None:  # the first runs to one end of the range, then to the other
            span = study.axis(study.branch.along).drawn_from
            assert span is not None
            return float(np.ptp(self.noted) / abs(span.stop - span.start)) / _BRANCHES
        follows = not study.changes_speed and study.recording.revolutions >= LEAST_REVOLUTIONS
        return min(max(self.noted), 1.0) * (_RECORDED if follows else 1.0)

    def timed(self, steps: float, *, is_whole: bool) -> Timed:
        """Time of the case, which has ended or was cut now; its rest takes as long for its share, about."""
        spent, share = max(time.process_time() - self._began, 1e-6), self.share
        found = Timed(steps=steps, spent=spent, set_up=self._set_up)
        if is_whole:
            return found
        if share <= 0.0:
            return replace(found, share=0.0, most=math.inf)
        rest = spent * (1.0 / share - 1.0)
        off = _MOST_OFF if self._study.branch is not None else min(share**-_OFF, _MOST_OFF)
        return replace(found, share=share, rest=rest, least=rest / off, most=rest * off)


def joined(cases: list[Timed], **more: Any) -> Timed:
    """Cases as one batch."""
    names = ("steps", "spent", "set_up", "rest", "least", "most")
    sums = {name: sum(getattr(case, name) for case in cases) for name in names}
    return replace(cases[0], n_case=len(cases), **sums, **more)


def memory(line: str = "VmRSS:") -> float:
    """Memory of this process now, bytes; its peak from the line "VmHWM:", or where there is no Linux."""
    try:
        return 1024.0 * float(_STATUS.read_text().split(line)[1].split()[0])
    except (OSError, IndexError, ValueError):
        from resource import RUSAGE_SELF, getrusage

        return getrusage(RUSAGE_SELF).ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0)


def in_spread_order(missing: NDArray[np.bool_]) -> Iterator[Index]:
    """Indices of all missing cases, in an order of which every beginning is spread over all axes.

    The fractional parts of a sum of multiples of roots of primes are equally distributed in every box.
    """
    places = np.argwhere(missing)
    keys = places @ np.resize(np.sqrt(_PRIMES), missing.ndim) % 1.0
    return (tuple(places[k].tolist()) for k in np.argsort(keys, kind="stable"))
