"""A small displacement of a motion, carried by the tangent of the collocation integrator."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.lyapunov import N_ALIGNING
from rubhpc.integrate.measuring.regimes import N_MOST
from rubhpc.kernels.case_progress import FINISHED

if TYPE_CHECKING:
    from rubhpc.integrate.marches.collocation import CollocationMarch


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
        clock = self._march.clock
        self._tick += n_revolution * clock.samples_per_revolution << clock.sample_level
        outcome, trail = self._march.carry(self._tick, self._column, 0)
        if outcome != FINISHED:
            return None
        self._column = trail.columns
        size = self._scale()
        return math.log(size) if size > 0.0 else -math.inf

    def _scale(self) -> float:
        """Make the displacement one of unit size; returns what it was."""
        size = float(np.linalg.norm(self._weight * (self._march.modes.motion @ self._column)[:, 0]))
        if size > 0.0:
            self._column /= size
        return size
