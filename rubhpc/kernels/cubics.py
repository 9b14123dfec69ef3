"""Cubics through values and rates at the ends of a step."""

from __future__ import annotations

import numpy as np

from rubhpc.kernels._jit import linked_sum


@linked_sum
def turning_value(before: float, rate_before: float, after: float, rate_after: float, step: float) -> float:
    """Extremum of Hermite's cubic through values and rates of opposite sign at a step's ends (step in s)."""
    a, b = rate_before * step, rate_after * step
    rise = after - before
    quadratic, cubic = 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise
    # The slope a + 2 quadratic s + 3 cubic s^2 has one root inside; this form of it does not cancel.
    below = np.copysign(np.sqrt(quadratic * quadratic - 3.0 * cubic * a), a) - quadratic
    s = a / below if below != 0.0 else 0.0  # zero only by underflow
    return before + s * (a + s * (quadratic + s * cubic))
