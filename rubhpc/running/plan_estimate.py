"""Estimate of the time of all cases of a study from those of a few, with a range."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from rubhpc.running.case_setup import Preparations
    from rubhpc.study.study import Study

_WITHIN = 0.95  # by Student's distribution; in fact 0.8 to 0.95, as few cases rarely include the longest
_FEWEST_FREE = 3  # degrees of freedom of that distribution, at least
_UPWARD = 1.3  # reach of a range upwards over that downwards: long cases are rare, and missed more often
_MACHINE = 0.15  # reach at least: processor times change with what else a machine does
_ALONE = math.log(2.5)  # reach of a range from one case, if there are more
_LONGEST = math.log(6.0)  # reach, at most
_MAIN = 0.4  # share of the time from which a part of it is named


@dataclass(frozen=True, kw_only=True)
class Timed:
    """Processor times of a case, s.

    Attributes
    ----------
    steps : float
        Predicted.
    spent : float
        As far as it was run, without `speed` and `shared`.
    is_whole : bool
        Whether it was run to its end.
    share : float
        Share of its revolutions that was run; 0 where that is not known.
    rest, least, most : float
        Predicted time of the rest, and a range of it.
    speed : float
        Of its set-up.
    shared : float
        Of contact modes that other cases of its speed and friction need not solve again.
    transient, modes : float
        Share of its time before the record, and for contact modes.
    n_mode : int
        Contact modes that were solved; 0 with one stator.
    n_byte : float
        Predicted memory of all its contact modes.
    """

    steps: float
    spent: float
    is_whole: bool
    share: float = 1.0
    rest: float = 0.0
    least: float = 0.0
    most: float = 0.0
    speed: float = 0.0
    shared: float = 0.0
    transient: float = 0.0
    modes: float = 0.0
    n_mode: int = 0
    n_byte: float = 0.0

    @property
    def whole(self) -> float:
        """Time from its beginning to its end."""
        return self.spent + self.rest


class Estimate(NamedTuple):
    """A time, s, and its range."""

    seconds: float
    least: float
    most: float


def estimate(cases: list[Timed], n_case: int, steps: float) -> Estimate:
    """From some cases, which stand for `n_case` with so many predicted steps together.

    Times are proportional to predicted steps on average: the ratio of the sums of both. The range has the
    error of that ratio, by Student's distribution of its logarithm, and the least and most time of cases that
    were cut. A case of whose rest nothing is known counts only if there is no other.
    """
    if not cases:
        return Estimate(math.nan, math.nan, math.nan)
    known = sum(case.spent for case in cases)
    cases = [case for case in cases if case.most < math.inf] or cases
    timed = np.array([[case.spent + case.least, case.whole, case.spent + case.most] for case in cases])
    share = sum(case.steps for case in cases) / steps if len(cases) < n_case else 1.0
    least, seconds, most = (timed.sum(axis=0) / min(share, 1.0)).tolist()
    reach = _reach(cases, n_case)
    low = math.hypot(min(reach, _LONGEST), math.log(seconds / least))
    high = math.hypot(min(_UPWARD * reach, _LONGEST), math.log(most / seconds))
    return Estimate(seconds, max(seconds * math.exp(-low), min(known, seconds)), seconds * math.exp(high))


def _reach(cases: list[Timed], n_case: int) -> float:
    """Reach of a range downwards, as a factor's logarithm."""
    if len(cases) >= n_case:
        return 0.0
    if len(cases) == 1:
        return _ALONE
    from scipy.special import stdtrit

    student = stdtrit(max(len(cases) - 1, _FEWEST_FREE), 0.5 + 0.5 * _WITHIN)
    return math.hypot(_MACHINE, float(student) * relative_error(cases, n_case))


def relative_error(cases: list[Timed], n_case: int) -> float:
    """Standard error of the mean time of `n_case` cases, as a share of it; infinite for one among several."""
    n = len(cases)
    if n >= n_case:
        return 0.0
    if n < 2:
        return math.inf
    steps, seconds = np.array([(case.steps, case.whole) for case in cases]).T
    residual = seconds - seconds.sum() / steps.sum() * steps
    return math.sqrt((1.0 - n / n_case) * n / (n - 1) * float(residual @ residual)) / float(seconds.sum())


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Time of the cases of a study.

    Attributes
    ----------
    cases : list of Timed
        Of them.
    n_case : int
    steps : float
        Predicted, of all.
    prepared : Preparations
        Of all.
    n_block : float
    block : float, s
        Time to write a block.
    """

    cases: list[Timed]
    n_case: int
    steps: float
    prepared: Preparations
    n_block: float
    block: float

    def estimate(self) -> Estimate:
        """Time of all cases."""
        once = sum(self._once)
        return Estimate(*(seconds + once for seconds in estimate(self.cases, self.n_case, self.steps)))

    @property
    def _once(self) -> tuple[float, float, float]:
        """Times of set-ups, of contact modes that cases share, and of writing, s."""
        if not self.cases:
            return math.nan, math.nan, math.nan
        speed = float(np.median([case.speed for case in self.cases]))
        shared = float(np.mean([case.shared for case in self.cases]))
        return speed * self.prepared.speed, shared * self.prepared.friction, self.block * self.n_block

    def mostly(self, study: Study) -> str:
        """What takes most of the time, and what would help; "" where nothing stands out."""
        set_ups, shared, writing = self._once
        whole = self.estimate().seconds
        seconds = np.array([case.whole for case in self.cases])
        shares = np.array([(case.modes, case.transient) for case in self.cases])
        modes, transient = (
            (seconds @ shares / max(float(seconds.sum()), 1e-9)).tolist() if shares.size else (0.0, 0.0)
        )
        of_cases = 1.0 - (set_ups + shared + writing) / whole
        recording, n = study.recording, len(study.rig.stator)
        texts = {
            f"contact modes of {n} stators": of_cases * modes + shared / whole,
            f"the transient, {recording.transient} revolutions": of_cases * (1.0 - modes) * transient,
            f"set-ups of {round(self.prepared.speed)} rigs and speeds": set_ups / whole,
            "writing blocks; a larger [run] block or fewer [record] keep takes less": writing / whole,
        }
        text, share = max(texts.items(), key=lambda item: item[1])
        name, _, helps = text.partition("; ")
        return f"{name} ({percent(share)} of the time)" + f"; {helps}" * bool(helps) if share > _MAIN else ""


def percent(share: float) -> str:
    """A share of a case in percent: 0.3 %, 12 %."""
    return f"{100.0 * share:.2g} %"
