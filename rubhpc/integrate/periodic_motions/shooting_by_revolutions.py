"""Newton's method on motions that are followed revolution by revolution, with their derivatives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.collocated_motion import CollocatedMotion, CollocatedRevolution

    Floats = NDArray[np.float64]

CONVERGED = 1e-9  # residual over the size of the motion: sought
CLOSED = 1e-5  # the same: enough where no step is better, since the steps of the integrator change
FAST = 0.05  # ratio of two residuals up to which a derivative serves once more
NEAR = 1e-5  # of the motion's size: its derivative serves for the multipliers
SAME = 1e-4  # of the motion's size: sections that close are no farther apart


class Search:
    """A search under way, from a beginning.

    The derivative is that of an earlier motion as long as steps by it make the residual much smaller.

    Attributes
    ----------
    motion, states : (2 n,)
        Best beginning so far, and the states of the pairs then.
    revolutions : list of CollocatedRevolution
        From there.
    residual : float
        Distance of their end from it, over its size.
    iterations : int
    """

    def __init__(
        self, followed: CollocatedMotion, motion: Floats, states: int, period: int, most_events: int
    ) -> None:
        """Follow the beginning; `Unfollowed` where it cannot be."""
        self._case, self._period, self._most_events = followed, period, most_events
        self.motion, self.states, self.iterations = motion, states, 0
        self.revolutions = self._follow(motion, states)
        self.residual = self._residual(motion, self.revolutions)
        self._matrix: Floats | None = None  # derivative of the residual
        self._differs = np.inf  # how far from the present motion that derivative was found, over its size

    def run(self, most_iterations: int, least_step: float) -> str:
        """Take Newton steps, or shares of them; returns why the motion does not close, or ""."""
        while self.residual > CONVERGED:
            if self.iterations == most_iterations:
                return (
                    "" if self.residual <= CLOSED else f"no convergence within {most_iterations} iterations"
                )
            self.iterations += 1
            matrix = self._find_derivative() if self._matrix is None else self._matrix
            before, defect = self.residual, self.revolutions[-1].end - self.motion
            step = np.linalg.lstsq(matrix, defect, rcond=1e-12)[0].astype(float)
            is_better = self._improve(step, least_step)
            if not is_better and self._differs == 0.0:
                return "" if self.residual <= CLOSED else "Newton's method stalls"
            self._differs += self._case.size(step) / self._case.size(self.motion)
            if not is_better or self.residual > FAST * before:
                if self.residual <= CLOSED:
                    break
                self._matrix = None
        return ""

    def monodromy(self, period: int) -> Floats:
        """Derivative (2 n, 2 n) of the motion after a period, of one as near as multipliers need."""
        if self._matrix is None or self._differs > NEAR or period < self._period:
            return self._case.monodromy(self.revolutions[:period])
        return np.eye(self.motion.size) - self._matrix

    def shortest(self) -> int:
        """Revolutions after which the motion closes: a divisor of the period."""
        most = SAME * self._case.size(self.motion)
        for d in range(1, self._period):
            if self._period % d == 0 and self._case.size(self.revolutions[d - 1].end - self.motion) <= most:
                return d
        return self._period

    def _find_derivative(self) -> Floats:
        self._matrix = np.eye(self.motion.size) - self._case.monodromy(self.revolutions)
        self._differs = 0.0
        return self._matrix

    def _improve(self, step: Floats, least_step: float) -> bool:
        share = 1.0
        while share >= least_step:
            motion = self.motion + share * step
            try:
                revolutions = self._follow(motion, self.revolutions[-1].states)
            except Unfollowed:
                share *= 0.5
                continue
            residual = self._residual(motion, revolutions)
            if residual < self.residual:
                self.motion, self.states = motion, self.revolutions[-1].states
                self.revolutions, self.residual = revolutions, residual
                return True
            share *= 0.5
        return False

    def _follow(self, motion: Floats, states: int) -> list[CollocatedRevolution]:
        return self._case.follow(motion, states, self._period, self._most_events)

    def _residual(self, motion: Floats, revolutions: list[CollocatedRevolution]) -> float:
        return self._case.size(revolutions[-1].end - motion) / max(
            self._case.size(motion), np.finfo(float).tiny
        )
