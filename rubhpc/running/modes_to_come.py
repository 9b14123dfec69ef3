"""Contact modes that a case of a ring has met, and how many are to come, for `rubhpc plan`."""

from __future__ import annotations

import math

import numpy as np

USUAL = 1.0  # contact modes that a doubling of the revolutions meets, over those of the last one
_FROM, _TO = 0.9, 1.0  # the same, at least and at most
_BURST = 0.5  # the same after a doubling that met more than all before: a whip begins
_GROWING = 0.01  # new contact modes over those of all revolutions before: beyond, a motion is irregular


class ModesToCome:
    """Contact modes that were solved as a case went on.

    An irregular motion of a ring of 32 met 116, 150, 103, 102 and 115 in five doublings of its revolutions,
    then 109 in each; a whip 335, 773 and 2300, then 1040; one that settles few after its first contacts.
    """

    def __init__(self) -> None:
        self._revolutions, self._met = [0.0], [0]

    def enter(self, revolutions: float, n_new: int) -> None:
        """So many more by these revolutions, or by those so far where a part of them is run again."""
        if revolutions > self._revolutions[-1]:
            self._revolutions.append(revolutions)
            self._met.append(self._met[-1])
        self._met[-1] += n_new

    @property
    def revolutions(self) -> float:
        """As far as is known, at least one."""
        return max(self._revolutions[-1], 1.0)

    @property
    def is_growing(self) -> bool:
        """Whether new ones were met to the end."""
        return self.n_new > _GROWING * self._at(0.5)

    @property
    def n_new(self) -> float:
        """Of the last doubling of the revolutions."""
        return self._met[-1] - self._at(0.5)

    @property
    def fading(self) -> float:
        """Those of the next doubling over those of the last, and so on."""
        half = self._at(0.5)
        if 0.0 < half < self.n_new:
            return _BURST
        before = half - self._at(0.25)
        if before <= 0.0 or self._at(0.25) <= 0.0:
            return USUAL
        return min(max(self.n_new / before, _FROM), _TO)

    def to_come(self, revolutions: float) -> float:
        """How many are met in so many revolutions more."""
        return self.n_new * sum_of_powers(self.fading, math.log2(1.0 + revolutions / self.revolutions))

    def _at(self, share: float) -> float:
        """Met by a share of the revolutions: a line in their logarithm, before the first place nothing."""
        at = share * self._revolutions[-1]
        if len(self._revolutions) == 1 or at < self._revolutions[1]:
            return 0.0
        return float(np.interp(math.log2(at), np.log2(self._revolutions[1:]), self._met[1:]))


def sum_of_powers(ratio: float, n: float) -> float:
    """Of `ratio`, its square and so on, up to the n-th."""
    return n if ratio == 1.0 else ratio * (1.0 - ratio**n) / (1.0 - ratio)
