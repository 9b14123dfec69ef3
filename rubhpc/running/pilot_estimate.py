"""Estimate of the time of all cases from those of a few, with its error."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_WITHIN = 0.95  # by Student's distribution; in fact 0.8 to 0.95, as few cases rarely include the longest
_FEWEST_FREE = 3  # degrees of freedom of that distribution, at least
_UPWARD = 1.3  # reach of a range upwards over that downwards: long cases are rare, and missed more often
_OFF = 0.25  # standard deviation of a time predicted from part of a case, as a share of it (18 cases, 4 laws)
_OFF_IRREGULAR = 0.4  # the same where its motion still met contact modes: it may settle or meet more


@dataclass
class Sample:
    """Cases of a study that were timed.

    Attributes
    ----------
    n_case, all_steps : float
        Missing cases and their predicted steps.
    steps, probability, seconds : list of float
        Of each case: predicted steps, probability that a draw picks it, and the time it takes.
    is_whole : list of bool
        Whether it was run to its end; the time of others is predicted from a part.
    spent : list of float
        Time of that part, s.
    is_irregular : list of bool
        Whether its motion still met contact modes where that part ended.
    checked : list of (float, float)
        Of cases that were run to their ends later: predicted and actual time of the rest, s.
    """

    n_case: int
    all_steps: float
    steps: list[float] = field(default_factory=list)
    probability: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    is_whole: list[bool] = field(default_factory=list)
    spent: list[float] = field(default_factory=list)
    is_irregular: list[bool] = field(default_factory=list)
    checked: list[tuple[float, float]] = field(default_factory=list)

    def add(
        self,
        steps: float,
        probability: float,
        seconds: float,
        *,
        is_whole: bool,
        spent: float = 0.0,
        is_irregular: bool = False,
    ) -> None:
        """Add a case."""
        self.steps.append(steps)
        self.probability.append(probability)
        self.seconds.append(seconds)
        self.is_whole.append(is_whole)
        self.spent.append(spent)
        self.is_irregular.append(is_irregular)

    @property
    def known(self) -> float:
        """Seconds that cases have taken."""
        return float(np.where(self.is_whole, self.seconds, self.spent).sum())

    @property
    def correction(self) -> float:
        """Factor for the predicted rest of a case: a ratio, shrunk towards 1."""
        if not self.checked:
            return 1.0
        predicted, taken = np.sum(self.checked, axis=0)
        usual = predicted / len(self.checked)
        return float((taken + usual) / (predicted + usual))

    def estimate(self) -> tuple[float, float, float]:
        """Seconds per case, seconds per step, and the standard error of the sum over all cases, s.

        The sum has the times of timed cases, and for the others `a + b steps`, fitted with weights inverse to
        the probabilities, so that the residuals of all cases add up to zero on average (the generalised
        regression estimator: C.-E. Sarndal et al., Model Assisted Survey Sampling, 1992, ch. 6). Neither a
        nor b is negative. The error is NaN where one of several cases was timed.
        """
        n = len(self.steps)
        steps = np.array(self.steps)
        to_come = np.where(self.is_whole, 0.0, self.correction * (np.array(self.seconds) - self.spent))
        seconds = np.where(self.is_whole, self.seconds, self.spent + to_come)
        weight = 1.0 / (n * np.array(self.probability))
        base, slope = _line(steps, seconds, weight)
        n_unseen = max(self.n_case - n, 0)
        unseen = base * n_unseen + slope * max(self.all_steps - steps.sum(), 0.0)
        predicted = base * self.n_case + slope * self.all_steps
        whole = float(seconds.sum() + unseen) if n_unseen else float(seconds.sum())
        scale = whole / predicted if predicted > 0.0 else 1.0
        n_free = n - (1 + (base > 0.0 and slope > 0.0))
        share = n_unseen / max(self.n_case, 1)
        if n_unseen == 0:
            error = 0.0
        elif n_free < 1:
            error = math.nan
        else:
            residual = weight * (seconds - base - slope * steps)
            error = math.sqrt(share * n / n_free * float(residual @ residual))
        off = np.where(self.is_irregular, _OFF_IRREGULAR, _OFF)
        mean_off = float(off @ to_come / seconds.sum()) if seconds.sum() > 0.0 else 0.0
        of_parts = mean_off * whole / math.sqrt(1 + len(self.checked))
        return base * scale, slope * scale, math.hypot(error, of_parts)


def _line(steps: Floats, seconds: Floats, weight: Floats) -> tuple[float, float]:
    """Weighted least squares `a + b steps`; a ratio or a mean where a or b would be negative."""
    total = weight.sum()
    middle, mean = (weight @ steps) / total, (weight @ seconds) / total
    spread = weight @ (steps - middle) ** 2
    slope = (
        (weight @ ((steps - middle) * seconds)) / spread if spread > 1e-9 * total * middle**2 else math.inf
    )
    if slope <= 0.0:
        return float(mean), 0.0
    base = mean - slope * middle
    return (float(base), float(slope)) if base > 0.0 else (0.0, float(mean / middle))


def within(seconds: float, error: float, n: int, known: float = 0.0) -> tuple[float, float]:
    """Range of the time, of eight to nine plans in ten: Student's distribution of its logarithm, n cases.

    It reaches further up than down. For up to three cases it is that of four, so that the range stays useful.
    The time `known`, s, is its lower limit.
    """
    from scipy.special import stdtrit

    relative = error / seconds if seconds > 0.0 else 0.0
    reach = float(stdtrit(max(n - 1, _FEWEST_FREE), 0.5 + 0.5 * _WITHIN)) * relative
    return max(seconds * math.exp(-reach), min(known, seconds)), seconds * math.exp(_UPWARD * reach)
