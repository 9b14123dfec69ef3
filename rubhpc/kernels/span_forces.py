"""Normal forces of a pair in the parts of a span between events under set-valued friction, and their bounds.

Impulses are differences of tabulated primitives (`ModeTables.primitive_re`), exact between any two of the
coordinates of a span.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.force_average import AVERAGING_TIME
from rubhpc.kernels.friction_states import STUCK, FrictionBodies, state_of

if TYPE_CHECKING:
    from rubhpc.kernels.contact_modes import ModeTables

Floats = NDArray[np.float64]

# Columns of `Recorder.pair`. Of the force where a part begins: value, N, primitive, N s, steady part, N,
# growth, N/s, and by how much its means may exceed a parabola, N. Then the integral of the friction of a pair
# that sticks, and of the force of one that slides, N s.
VALUE, PRIMITIVE, STEADY, RAMP, EXCESS, RUBBED = range(6)
MISSED = float(np.sqrt(3.0)) / 216.0  # of the third derivative times the length to the third: by a parabola
SHARED = 1.5  # by how much the mean of a parabola with the impulse of a part may exceed its own, in its terms


@linked_sum
def begin_force(
    tables: ModeTables,
    bodies: FrictionBodies,
    mode: int,
    i: int,
    time: float,
    interval: float,
    z: Floats,
    pair: Floats,
) -> None:
    """Fill `pair` with the force of closed pair i where a span of a `time` (s) begins, and its bounds.

    Over an `interval` (s), a mean of it exceeds a parabola with its impulse by at most what each coordinate
    adds: by its third derivative, or twice its size, or, if fast, its impulse.
    """
    q, is_stuck = bodies.rim_speed.size, state_of(tables.mask[mode], i) == STUCK
    share = 0.5 / bodies.static[i] if is_stuck else 1.0
    other_share, along = (share, 0.5) if is_stuck else (0.0, 0.0)
    re, im, whole_re, whole_im = (
        tables.switch_re[mode, 2 * i],
        tables.switch_im[mode, 2 * i],
        tables.primitive_re[mode, 2 * i],
        tables.primitive_im[mode, 2 * i],
    )
    next_re, next_im, next_whole_re, next_whole_im = (
        tables.switch_re[mode, 2 * i + 1],
        tables.switch_im[mode, 2 * i + 1],
        tables.primitive_re[mode, 2 * i + 1],
        tables.primitive_im[mode, 2 * i + 1],
    )
    pace, turn, missed = tables.pace[mode], tables.turn[mode, 2 * i], MISSED * interval**3
    value, primitive, steady, other_primitive, other_steady, excess = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(z.shape[1]):
        x, y = z[0, k], z[1, k]
        a, b = share * re[k] + other_share * next_re[k], share * im[k] + other_share * next_im[k]
        first, second = re[k] * x - im[k] * y, next_re[k] * x - next_im[k] * y
        whole, next_whole = (
            whole_re[k] * x - whole_im[k] * y,
            next_whole_re[k] * x - next_whole_im[k] * y,
        )
        is_fast = turn[k] < 0.0
        now = share * first + other_share * second
        value += 0.0 if is_fast else now
        primitive += whole
        other_primitive += next_whole
        steady += first if whole_re[k] == 0.0 and whole_im[k] == 0.0 else 0.0
        other_steady += second if next_whole_re[k] == 0.0 and next_whole_im[k] == 0.0 else 0.0
        size = (abs(a) + abs(b)) * (abs(x) + abs(y))
        brief = abs(share * whole + other_share * next_whole) * (SHARED / AVERAGING_TIME)
        excess += min(SHARED * size, brief) if is_fast else size * min(missed * pace[k] ** 3, 2.0)
    ramp, other_ramp = 0.0, 0.0
    for other in range(q):
        if state_of(tables.mask[mode], other) == STUCK:
            k = tables.n_eigenmode[mode] + 2 + q + other
            ramp += re[k] * bodies.rim_speed[other]
            other_ramp += next_re[k] * bodies.rim_speed[other]
    pair[VALUE], pair[EXCESS] = value, excess
    pair[PRIMITIVE] = share * primitive + other_share * other_primitive
    pair[STEADY], pair[RAMP] = (
        share * steady + other_share * other_steady,
        share * ramp + other_share * other_ramp,
    )
    gained = time * (other_steady - steady + 0.5 * time * (other_ramp - ramp))
    pair[RUBBED] = along * (gained - (other_primitive - primitive))


@linked_sum
def pass_force(
    tables: ModeTables,
    bodies: FrictionBodies,
    mode: int,
    i: int,
    since: float,
    until: float,
    is_last: bool,
    z: Floats,
    pair: Floats,
) -> tuple[float, float, float, float]:
    """Force at both ends (N), impulse (N s) and bound on the means (N) of the force in a part of a span.

    It lies between times (s) counted from the begin of the span, and ends with `z` (2, m).
    """
    is_stuck = state_of(tables.mask[mode], i) == STUCK
    share = 0.5 / bodies.static[i] if is_stuck else 1.0
    value, primitive = read_force(tables, mode, 2 * i, z)
    if is_stuck:
        other_value, other_primitive = read_force(tables, mode, 2 * i + 1, z)
        if is_last:
            pair[RUBBED] += 0.5 * (other_primitive - primitive)
        value, primitive = share * (value + other_value), share * (primitive + other_primitive)
    time = until - since
    steady = pair[STEADY] + 0.5 * pair[RAMP] * (since + until)
    impulse = primitive - pair[PRIMITIVE] + steady * time
    most = highest(impulse / time, pair[VALUE], value) + pair[EXCESS]
    before, pair[VALUE], pair[PRIMITIVE] = pair[VALUE], value, primitive
    pair[RUBBED] += 0.0 if is_stuck else impulse
    return before, value, impulse, most


@linked_sum
def read_force(tables: ModeTables, mode: int, j: int, z: Floats) -> tuple[float, float]:
    """Switch function j without what is gone within a sample, and its primitive."""
    re, im, whole_re, whole_im, turn = (
        tables.switch_re[mode, j],
        tables.switch_im[mode, j],
        tables.primitive_re[mode, j],
        tables.primitive_im[mode, j],
        tables.turn[mode, j],
    )
    z_re, z_im = z[0], z[1]
    value, primitive = 0.0, 0.0
    for k in range(z_re.size):
        x, y = z_re[k], z_im[k]
        now = re[k] * x - im[k] * y
        value += 0.0 if turn[k] < 0.0 else now
        primitive += whole_re[k] * x - whole_im[k] * y
    return value, primitive


@linked_sum
def highest(mean: float, first: float, last: float) -> float:
    """Largest value of a parabola with this mean and these values at the ends of a part."""
    slope, bend = 6.0 * mean - 4.0 * first - 2.0 * last, 3.0 * (first + last) - 6.0 * mean
    is_inside = bend < 0.0 and 0.0 < slope < -2.0 * bend
    return max(first, last, first - 0.25 * slope * slope / bend if is_inside else -np.inf)
