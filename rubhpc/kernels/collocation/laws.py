"""Laws of a pair: normal force of springs, and coefficient of friction, with their slopes."""

from __future__ import annotations

import math

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.structures import Bodies  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.laws import HERTZ, friction_coefficient, sliding_friction


@linked_sum
def spring_force(bodies: Bodies, i: int, gap: float, rate: float) -> tuple[float, float, float]:
    """Normal force (N) of a spring law at a gap (m) and its rate (m/s), and its slopes in both.

    Odd beyond contact, so that a step may pass the end of the contact.
    """
    k, c = bodies.stiffness[i], bodies.damping[i]
    if bodies.normal_law[i] == HERTZ:  # with Hunt and Crossley's damping
        root, damped = math.sqrt(abs(gap)), 1.0 - c * rate
        return float(-k * gap * root * damped), float(-1.5 * k * root * damped), float(k * gap * root * c)
    return float(-k * gap - c * rate), float(-k), float(-c)


@linked_sum
def spring_end(bodies: Bodies, i: int, gap: float, rate: float) -> float:
    """Positive while the force of a spring law presses; it crosses zero with a slope."""
    if bodies.normal_law[i] == HERTZ:
        return float(-gap * (1.0 - bodies.damping[i] * rate))
    return float(-gap - bodies.damping[i] / bodies.stiffness[i] * rate)


@linked_sum
def sliding_coefficient(bodies: Bodies, i: int, slip: float) -> tuple[float, float]:
    """Coefficient of friction in sliding at a slip (m/s), and its slope in it."""
    return sliding_friction(bodies.law, bodies.friction[i], slip)


@linked_sum
def static_friction(bodies: Bodies, i: int) -> float:
    """Largest coefficient of friction of a pair that sticks."""
    return friction_coefficient(bodies.law, bodies.friction[i], 0.0, True)
