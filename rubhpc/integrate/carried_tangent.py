"""A small displacement of a motion, carried by the tangent of the collocation integrator."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.lyapunov import N_ALIGNING
from rubhpc.integrate.measuring.regimes import N_MOST
from rubhpc.kernels.case_progress import FINISHED
from rubhpc.kernels.collocation.tangent import FULL

if TYPE_CHECKING:
    from rubhpc.integrate.marches.collocation import CollocationMarch

MOST_EVENTS = 4096  # in a revolution


class CarriedTangent:
    """As `lyapunov.Neighbours`, from where a march stands that is needed no more."""

    def __init__(self, march: CollocationMarch) -> None:
        """Begin with a displacement without a special direction."""
        self.n_aligning, self.most_spans = N_ALIGNING, N_ALIGNING + N_MOST
        self.within: list[float] = []
        self._march, self._tick = march, 0
        n, modes = march.bodies.stiffness.shape[0], march.modes
        self._weight = np.repeat([abs(march.setup.spin), 1.0], n)
        none = modes.coordinates(np.zeros(2 * n))
        self._column = (modes.coordinates(np.cos(np.arange(2.0 * n)) / self._weight) - none)[:, np.newaxis]
        self._scale()

    def part(self, n_revolution: int) -> float | None:
        """Continue; return the growth of the logarithm of the displacement, or None at an end."""
        march, grown = self._march, 0.0
        for _ in range(n_revolution):
            self._tick += march.clock.samples_per_revolution << march.clock.sample_level
            outcome, trail = march.carry(self._tick, self._column, MOST_EVENTS)
            if outcome != FINISHED or trail.count[FULL]:
                return None
            self._column = trail.columns
            size = self._scale()
            grown += math.log(size) if size > 0.0 else -math.inf
        return grown

    def _scale(self) -> float:
        """Make the displacement one of unit size; returns what it was."""
        size = float(np.linalg.norm(self._weight * (self._march.modes.motion @ self._column)[:, 0]))
        if size > 0.0:
            self._column /= size
        return size
