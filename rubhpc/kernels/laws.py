"""Laws of contact and friction: relations of the forces of a pair with its gap and slip.

CONTRIBUTING.md describes how to add one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.kernels._jit import linked
from rubhpc.kernels._struct import Struct
from rubhpc.models import FRICTION_LAWS, NORMAL_LAWS

if TYPE_CHECKING:
    from numpy.typing import NDArray

SLIDING, COULOMB, STRIBECK, TABLE = range(len(FRICTION_LAWS))
LAGRANGE, PENALTY, HERTZ = range(len(NORMAL_LAWS))

_NO_TABLE = np.zeros(0)


class Law(Struct):
    """Laws of a case; all fields but the first two have the names of the keys of `[contact]`."""

    friction_law: int = SLIDING  # one of the numbers above
    normal_law: int = LAGRANGE
    stiffness: float = 0.0  # N/m, of Hertz's law N/m^1.5; 0: the gap is closed exactly, by a multiplier
    damping: float = 0.0  # N s/m, of Hertz's law s/m
    restitution: float = 0.0  # normal velocity after an impact over that before; 0: the gap is closed at once
    static_friction_ratio: float = 1.0  # coefficient of friction at rest over that in sliding
    stribeck_speed: float = 1.0  # m/s, at which the excess of friction at rest has decayed to 1/e
    slip_speed: NDArray[np.float64] = _NO_TABLE  # (n,), m/s, rising from 0, of a table
    friction_ratio: NDArray[np.float64] = _NO_TABLE  # (n,), coefficient there over that of the case


MULTIPLIER = Law()


@linked
def may_stick(law: Law) -> bool:
    """Whether friction may stick and reverse, instead of steady sliding by the spin."""
    return law.friction_law != SLIDING


@linked
def friction_coefficient(law: Law, friction: float, slip_speed: float, is_sticking: bool) -> float:
    """Largest friction for a unit normal force; of a pair that sticks where it depends on the slip, at rest.

    Parameters
    ----------
    friction : float
        Coefficient of the case, not negative.
    slip_speed : float, m/s
        Of the rim over the tip, before the forces of the step.
    is_sticking : bool
        Whether the pair stuck in the step before.
    """
    if is_sticking and not depends_on_slip(law):
        return friction * law.static_friction_ratio
    return sliding_friction(law, friction, slip_speed)[0]


@linked
def depends_on_slip(law: Law) -> bool:
    """Whether the coefficient of friction depends on the slip speed."""
    return law.friction_law != SLIDING and law.friction_law != COULOMB


@linked
def sliding_friction(law: Law, friction: float, slip_speed: float) -> tuple[float, float]:
    """Coefficient of friction at a slip speed (m/s), and its slope in it (s/m)."""
    speed, sense = abs(slip_speed), 1.0 if slip_speed >= 0.0 else -1.0
    if law.friction_law == STRIBECK:
        excess = friction * (law.static_friction_ratio - 1.0) * math.exp(-speed / law.stribeck_speed)
        return friction + excess, -sense * excess / law.stribeck_speed
    if law.friction_law == TABLE:
        at, values = law.slip_speed, law.friction_ratio
        for i in range(1, at.size):
            if speed < at[i]:
                slope = friction * (values[i] - values[i - 1]) / (at[i] - at[i - 1])
                return friction * values[i - 1] + slope * (speed - at[i - 1]), sense * slope
        return friction * values[-1], 0.0
    return friction, 0.0


@linked
def is_penalty(law: Law) -> bool:
    """Whether a force may act with the gap open at the end of a step."""
    return law.stiffness > 0.0


@linked
def is_bouncing(law: Law) -> bool:
    """Whether impacts have restitution."""
    return law.restitution > 0.0


@linked
def is_plain(law: Law) -> bool:
    """Whether gaps are closed by multipliers under steady sliding: forces then follow from the gaps alone."""
    return not (is_penalty(law) or is_bouncing(law) or may_stick(law))


@linked
def softness(law: Law, step: float) -> float:
    """Compliance of the penalty over a step, m/N: one over (k/4 + c/(2 h)); a multiplier has none."""
    return 1.0 / (0.25 * law.stiffness + 0.5 * law.damping / step) if is_penalty(law) else 0.0


@linked
def gap_target(law: Law, step: float, gap: float, opening: float, end: float) -> tuple[float, float]:
    """Gap required at the end of a step, less its compression by the force (m), and delay of an impact (s).

    Multiplier: zero. Restitution: see `bounce`. Penalty: the spring force is the mean, weighted 1:2:1, over
    the ends of this step and the one before, the damper force that over both steps. This mean conserves
    energy and is stable for any stiffness.

    Parameters
    ----------
    step : float, s
    gap, end : float, m
        At the beginning of the step, and at its end without forces.
    opening : float, m/s
        Rate of the gap over the step before.
    """
    if is_penalty(law):
        if gap < 0.0 or end < 0.0:
            before = gap - step * opening
            spring = 0.25 * law.stiffness * (2.0 * max(-gap, 0.0) + max(-before, 0.0))
            return softness(law, step) * (spring + 0.5 * law.damping * before / step), 0.0
    elif end < 0.0 and gap >= 0.0:
        return bounce(law.restitution, step, gap, opening, end)
    return 0.0, 0.0


@linked
def bounce(restitution: float, step: float, gap: float, opening: float, end: float) -> tuple[float, float]:
    """Gap required at the end of a step with an impact (m), and delay of the impact in the step (s).

    The gap is `gap` at the beginning, would be `end` < 0 at the end, and had the rate `opening` half a step
    before the beginning. The acceleration follows from these: the gap closes after the delay at the rate v-,
    and v+ = -e v- gives the rate half a step after the beginning. The step is taken at that rate, and the
    displacement by the force before the delay is subtracted. Where the following flight would end within the
    step, the gap is closed as without restitution: (0, 0).
    """
    acceleration = (end - gap - step * opening) / step**2
    rate = opening + 0.5 * step * acceleration
    closing = np.sqrt(max(rate * rate - 2.0 * acceleration * gap, 0.0))
    if not closing > 0.0 or 2.0 * restitution * closing <= -acceleration * step:
        return 0.0, 0.0
    # The root of gap + rate t + acceleration t^2 / 2, without cancellation.
    delay = min(2.0 * gap / (closing - rate), step) if closing > rate else step
    after = restitution * closing + acceleration * (0.5 * step - delay)
    return gap + step * after, delay
