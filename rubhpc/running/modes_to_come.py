"""Contact modes that a case of a ring has met, and prediction of further ones, for `rubhpc plan`."""

from __future__ import annotations

import math

import numpy as np

USUAL = 1.0  # contact modes met in a doubling of the revolutions, over those of the doubling before
_FROM, _TO = 0.9, 1.0  # the same, at least and at most
_BURST = 0.5  # the same after a doubling that met more than all before, as when a whip begins
_GROWING = 0.01  # new contact modes over all earlier ones: above, a motion is irregular


class ModesToCome:
    """Contact modes that were solved over the revolutions of a case.

    An irregular motion of a ring of 32 met 116, 150, 103, 102 and 115 in five doublings of its revolutions,
    then 109 in each; a whip 335, 773 and 2300, then 1040; one that settles few after its first contacts.
    """

    def __init__(self) -> None:
        self._revolutions, self._met = [0.0], [0]

    def enter(self, revolutions: float, n_new: int) -> None:
        """Add `n_new` modes up to these revolutions, or up to the present ones where a part is repeated."""
        if revolutions > self._revolutions[-1]:
            self._revolutions.append(revolutions)
            self._met.append(self._met[-1])
        self._met[-1] += n_new

    @property
    def revolutions(self) -> float:
        """Revolutions so far, at least one."""
        return max(self._revolutions[-1], 1.0)

    @property
    def is_growing(self) -> bool:
        """Whether new modes were met up to the end."""
        return self.n_new > _GROWING * self._at(0.5)

    @property
    def n_new(self) -> float:
        """New modes in the last doubling of the revolutions."""
        return self._met[-1] - self._at(0.5)

    @property
    def fading(self) -> float:
        """Predicted ratio of the new modes of a doubling to those of the one before."""
        half = self._at(0.5)
        if 0.0 < half < self.n_new:
            return _BURST
        before = half - self._at(0.25)
        if before <= 0.0 or self._at(0.25) <= 0.0:
            return USUAL
        return min(max(self.n_new / before, _FROM), _TO)

    def to_come(self, revolutions: float) -> float:
        """Predicted number of new modes in so many more revolutions."""
        return self.n_new * sum_of_powers(self.fading, math.log2(1.0 + revolutions / self.revolutions))

    def _at(self, share: float) -> float:
        """Modes met up to a share of the revolutions: linear in their logarithm, 0 before the first entry."""
        at = share * self._revolutions[-1]
        if len(self._revolutions) == 1 or at < self._revolutions[1]:
            return 0.0
        return float(np.interp(math.log2(at), np.log2(self._revolutions[1:]), self._met[1:]))


def sum_of_powers(ratio: float, n: float) -> float:
    """Sum of the powers of `ratio`, from the first to the n-th."""
    return n if ratio == 1.0 else ratio * (1.0 - ratio**n) / (1.0 - ratio)
