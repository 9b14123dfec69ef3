"""A small displacement of a motion, carried by the exact tangent of its integrator."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.lyapunov import N_ALIGNING
from rubhpc.integrate.measuring.regimes import N_MOST
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.collocated_motion import FollowedMotion

    Floats = NDArray[np.float64]

MOST_RETURNS = 4  # revolutions back to the return that is taken, at most
REPEATED = 1e-5  # of a motion: a smaller difference from a return is due to steps
LOST = 1e-280  # a smaller displacement counts as zero


class CarriedTangent:
    """As `lyapunov.Neighbours`, from where a motion begins."""

    def __init__(self, motion: FollowedMotion) -> None:
        """Begin with a displacement without a special direction."""
        self.n_aligning, self.most_spans = N_ALIGNING, N_ALIGNING + N_MOST
        self._motion = motion
        motion.stand_at(motion.start, motion.states)
        self._column = self._generic()
        with suppress(Unfollowed):
            self._begin_at_return()

    def _begin_at_return(self) -> None:
        """Begin some revolutions later, with the difference from the nearest return, unless that is none.

        The difference of a torus from an earlier return lies along the torus, and that of a chaotic motion
        has lost what decays. A displacement without a special direction takes twice as long to align.
        """
        motion = self._motion
        later = motion.follow(motion.start, motion.states, MOST_RETURNS)
        end = later[-1].end
        apart = [end - before for before in (motion.start, *(one.end for one in later[:-1]))]
        nearest = min(apart, key=motion.size)
        if motion.size(nearest) > REPEATED * motion.size(end):
            motion.stand_at(end, later[-1].states)
            self._column = nearest[:, np.newaxis] / motion.size(nearest)

    def part(self, n_revolution: int) -> float | None:
        """Continue; return the growth of the logarithm of the displacement, or None at an end."""
        try:
            self._column = self._motion.go_on(self._column, n_revolution)
        except Unfollowed:
            return None
        size = max(self._motion.size(self._column[:, 0]), LOST)
        if size > LOST:
            self._column /= size
        else:
            self._column = self._generic()
        return math.log(size)

    def _generic(self) -> Floats:
        """A displacement (2 n, 1) of size 1, without a special direction."""
        even: Floats = np.cos(np.arange(2.0 * self._motion.n)) / np.sqrt(self._motion.energy)
        return even[:, np.newaxis] / self._motion.size(even)
