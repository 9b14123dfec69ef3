"""Modal form of the linear system with a given set of contacts closed, and its propagation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked, linked_sum
from rubhpc.kernels._struct import Struct

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Rows of `ModeTables.output`: displacements and rates of the output node, its torsional acceleration, then
# three rows a stator tip: axial and lateral displacement, lateral rate; then one row a probe.
N_ROTOR_ROW = 7
TWIST_ACCELERATION_ROW = 6
LATERAL_ROW, LATERAL_RATE = 1, 2

SAMPLES_AT_ONCE = 8  # read from one set of modal coordinates
BOUND_LEVEL = 3  # `ModeTables.bound` holds over 2^level samples, or the longest step where that is longer
FORCED_LEVEL = 6  # steps of up to 2^level ticks after an event need no bound, so that time advances
RESOLVED = 0.02  # of a signal's size: its fourth derivative times the step to the fourth
LANES = 8  # coordinates are used in whole vectors
DYING = -1.0  # pace of a mode that has decayed before the first step after an event ends


class ModeTables(Struct):
    """Modal form of every set of closed contacts met so far; complex arrays as (real, imaginary) pairs.

    p contact modes, m coordinates (padded), q pairs, n reduced degrees, o output rows. The coordinates are
    those of the eigenmodes, then that of the unbalance response, exp(i angle), then the clearance of each
    pair, m.
    """

    mask: Ints  # (p,), set of closed pairs, bit i of pair i
    n_eigenmode: Ints  # (p,), number of eigenmodes
    switch_re: Floats  # (p, q, m), gap of an open pair, m; force of a closed one, N
    switch_im: Floats
    rate_re: Floats  # (p, q, m), its time derivative
    rate_im: Floats
    bound: Floats  # (p, q, m), bound on its second time derivative for a unit coordinate (`BOUND_LEVEL`)
    pace: Floats  # (p, m), size of the exponent, 1/s, or DYING
    power_re: Floats  # (p, n_level, m), exponential of each mode over 2^level ticks
    power_im: Floats
    output: Floats  # (p, 2 m, SAMPLES_AT_ONCE o), of the real, then the imaginary parts, sample by sample
    slip_re: Floats  # (p, q, m), slip speed without the rim speed of the steady spin, m/s
    slip_im: Floats
    slip_rate_re: Floats  # (p, q, m), its time derivative
    slip_rate_im: Floats
    motion_re: Floats  # (p, 2 n, m), reduced displacements, then velocities
    motion_im: Floats
    enter_re: Floats  # (p, 2 n, m), modal coordinates of a unit displacement or velocity
    enter_im: Floats
    enter_cosine: Floats  # (p, 2, m), subtracted part of the unbalance response, times cos(angle)
    enter_sine: Floats  # (p, 2, m), times sin(angle)
    enter_constant: Floats  # (p, q, 2, m), for a unit clearance of each pair
    loss: Floats  # (p, 2 m, 2 m), quadratic form of the coordinates whose growth is the loss by damping, J
    work_re: Floats  # (p, 2, m), the same for the work of the unbalance: times exp(i angle), its conjugate
    work_im: Floats
    steady_power: Floats  # (p, 2), W, of damping and of the unbalance, not contained in the forms


class Reduced(Struct):
    """The linear bodies in a basis in which the mass matrix is the identity."""

    stiffness: Floats  # (n, n)
    damping: Floats  # (n, n), D + spin G
    force_cosine: Floats  # (n,)
    force_sine: Floats  # (n,)
    gap_jacobian: Floats  # (q, n), rate of a gap with the motion
    force_direction: Floats  # (q, n), force on the motion of a unit contact force, friction included
    slip: Floats  # (q, n), slip speed by the motion, without that of the steady spin
    delassus: Floats  # (q, q), gap_jacobian @ force_direction.T, 1/kg
    friction: Floats  # (q,), coefficient, not negative
    radius: Floats  # (q,), m
    rim_speed: Floats  # (q,), of the steady spin, m/s, not negative
    restitution: float  # normal velocity after an impact over that before it
    clearance: Floats  # (q,), m
    translations: Floats  # (r, n), displacements that are compared with the limit
    displacement_limit: float  # m
    overlap: float  # m, of an open pair that parts, up to which it continues without an event


@linked_sum
def dot(re: Floats, im: Floats, z_re: Floats, z_im: Floats) -> float:
    """Real part of a row's product with the modal coordinates."""
    total = 0.0
    for k in range(z_re.size):
        total += re[k] * z_re[k] - im[k] * z_im[k]
    return total


@linked_sum
def bounded(weight: Floats, z_re: Floats, z_im: Floats) -> float:
    """Bound on a second derivative: weighted sum of the modes' magnitudes."""
    total = 0.0
    for k in range(z_re.size):
        total += weight[k] * (abs(z_re[k]) + abs(z_im[k]))
    return total


@linked_sum
def propagate(re: Floats, im: Floats, z_re: Floats, z_im: Floats, next_re: Floats, next_im: Floats) -> None:
    """Modal coordinates after a tabulated step."""
    for k in range(z_re.size):
        a, b = z_re[k], z_im[k]
        next_re[k] = re[k] * a - im[k] * b
        next_im[k] = re[k] * b + im[k] * a


@linked
def add_rows(rows: Floats, value: Floats, target: Floats) -> None:
    """Add the rows (n, m), times the values (n,), to the target (m,), four at a time, in order."""
    n_whole = value.size - value.size % 4
    for row in range(0, n_whole, 4):
        first, second, third, fourth = rows[row], rows[row + 1], rows[row + 2], rows[row + 3]
        a, b, c, d = value[row], value[row + 1], value[row + 2], value[row + 3]
        for k in range(target.size):
            total = target[k]
            total += first[k] * a
            total += second[k] * b
            total += third[k] * c
            total += fourth[k] * d
            target[k] = total
    for row in range(n_whole, value.size):
        last, a = rows[row], value[row]
        for k in range(target.size):
            target[k] += last[k] * a


@jit_sum
def enter_with(
    n_eigenmode: int,
    used: int,
    enter_re: Floats,
    enter_im: Floats,
    enter_cosine: Floats,
    enter_sine: Floats,
    enter_constant: Floats,
    clearance: Floats,
    cosine: float,
    sine: float,
    motion: Floats,
    z: Floats,
) -> None:
    """Modal coordinates `z` (2, m) of a motion (2 n,) at the shaft's angle, with a mode's rows of the tables.

    The first ones are `used`, the others zero (`used_width`).
    Python calls it with these rows alone: unpacking all tables would double the compilation time.
    """
    for part in range(2):
        rows = enter_re if part == 0 else enter_im
        target = z[part, :used]
        from_cosine, from_sine = enter_cosine[part], enter_sine[part]
        for k in range(target.size):  # arrays in one expression would take 5 s longer to compile
            target[k] = -from_cosine[k] * cosine - from_sine[k] * sine
        for i in range(clearance.size):
            source = enter_constant[i, part]
            for k in range(target.size):
                target[k] -= source[k] * clearance[i]
        add_rows(rows, motion, target)
        z[part, used:] = 0.0
    z[0, n_eigenmode], z[1, n_eigenmode] = cosine, sine
    for i in range(clearance.size):
        z[0, n_eigenmode + 1 + i], z[1, n_eigenmode + 1 + i] = clearance[i], 0.0


@linked_sum
def enter(
    tables: ModeTables, mode: int, clearance: Floats, cosine: float, sine: float, motion: Floats, z: Floats
) -> None:
    """Modal coordinates `z` (2, m) in a contact mode of a motion (2 n,) at the shaft's angle."""
    enter_with(
        tables.n_eigenmode[mode],
        used_width(tables, mode),
        tables.enter_re[mode],
        tables.enter_im[mode],
        tables.enter_cosine[mode],
        tables.enter_sine[mode],
        tables.enter_constant[mode],
        clearance,
        cosine,
        sine,
        motion,
        z,
    )


@linked_sum
def leave(tables: ModeTables, mode: int, z: Floats, motion: Floats) -> None:
    """Reduced motion (2 n,) of the coordinates `z` (2, m) in a contact mode."""
    used = used_width(tables, mode)
    z_re, z_im = z[0, :used], z[1, :used]
    re, im, n_whole = tables.motion_re[mode], tables.motion_im[mode], motion.size - motion.size % 4
    for row in range(0, n_whole, 4):  # four at a time: one would wait for its sum
        first_re, second_re, third_re, fourth_re = re[row], re[row + 1], re[row + 2], re[row + 3]
        first_im, second_im, third_im, fourth_im = im[row], im[row + 1], im[row + 2], im[row + 3]
        first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
        for k in range(used):
            a, b = z_re[k], z_im[k]
            first += first_re[k] * a - first_im[k] * b
            second += second_re[k] * a - second_im[k] * b
            third += third_re[k] * a - third_im[k] * b
            fourth += fourth_re[k] * a - fourth_im[k] * b
        motion[row], motion[row + 1], motion[row + 2], motion[row + 3] = first, second, third, fourth
    for row in range(n_whole, motion.size):
        motion[row] = dot(re[row], im[row], z_re, z_im)


@linked_sum
def enter_rest(
    motion_re: Floats,
    motion_im: Floats,
    enter_re: Floats,
    enter_im: Floats,
    motion: Floats,
    z: Floats,
) -> None:
    """Add to coordinates `z` (2, m) what entering a mode that follows the speed has left of a motion (2 n,).

    What enters such a mode inverts its shapes but for a small share, which is squared so: events that follow
    one another would be due to it. The first arguments are rows of the mode's tables; the motion is
    overwritten with that rest.
    """
    for k in range(motion.size):
        motion[k] -= dot(motion_re[k], motion_im[k], z[0], z[1])
    add_rows(enter_re, motion, z[0])
    add_rows(enter_im, motion, z[1])


@linked_sum
def used_width(tables: ModeTables, mode: int) -> int:
    """How many coordinates of a contact mode are used, in whole vectors; those behind them are zero.

    Beside the eigenmodes: the unbalance response, and a clearance of each pair.
    """
    used = tables.n_eigenmode[mode] + 1 + tables.switch_re.shape[1]
    return int(min((used + LANES - 1) // LANES * LANES, tables.switch_re.shape[2]))


@linked_sum
def copy_coordinates(z: Floats, target: Floats) -> None:
    """Copy coordinates (2, m)."""
    for part in range(2):
        for k in range(z.shape[1]):
            target[part, k] = z[part, k]


@linked_sum
def find_mode(mask: Ints, wanted: int) -> int:
    """Index of the mode with the wanted set of closed pairs; -1 where it is not tabulated yet."""
    for mode in range(mask.size):
        if mask[mode] == wanted:
            return mode
    return -1


@linked_sum
def positive_interval(s: float, rate: float, bound: float) -> float:
    """Time, s, in which a switch function stays positive: `s + s' t - b t^2 / 2 > 0`."""
    if not s > 0.0:
        return 0.0
    if bound > 0.0:
        return float((rate + np.sqrt(rate * rate + 2.0 * bound * s)) / bound)
    return -s / rate if rate < 0.0 else np.inf


@linked_sum
def event_free_interval(
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    bound: Floats,
    mode: int,
    z_re: Floats,
    z_im: Floats,
) -> float:
    """Time, s, in which no switch function of a mode can reach zero; single tables are faster to pass."""
    proved = np.inf
    for i in range(switch_re.shape[1]):
        s = dot(switch_re[mode, i], switch_im[mode, i], z_re, z_im)
        rate = dot(rate_re[mode, i], rate_im[mode, i], z_re, z_im)
        proved = min(proved, positive_interval(s, rate, bounded(bound[mode, i], z_re, z_im)))
    return proved


@linked_sum
def resolved_time(re: Floats, im: Floats, pace: Floats, least: float, z_re: Floats, z_im: Floats) -> float:
    """Time, s, over which Hermite's cubic follows a signal with these rows (m,) to 1e-4 of its size.

    Coordinates with a pace up to `least` are left out.
    """
    size, bend = 0.0, 0.0
    for k in range(z_re.size):
        if pace[k] > least:
            share = np.sqrt((re[k] * re[k] + im[k] * im[k]) * (z_re[k] * z_re[k] + z_im[k] * z_im[k]))
            size += share
            square = pace[k] * pace[k]
            bend += share * square * square
    return float((RESOLVED * size / bend) ** 0.25) if bend > 0.0 else np.inf


@jit_sum
def is_within(
    motion: Floats,
    translations: Floats,
    stiffness: Floats,
    highest: Floats,
    lowest: Floats,
    limit: float,
    energy_limit: float,
) -> bool:
    """Whether a motion (2 n,) and the extrema of the output node so far are within the limits of divergence.

    Limits are `limit` (m) for displacements and `energy_limit` (J) for the energy.
    """
    n = stiffness.shape[0]
    for row in range(translations.shape[0]):
        seen = 0.0
        for k in range(n):
            seen += translations[row, k] * motion[k]
        if not abs(seen) <= limit:
            return False
    if highest[0] >= lowest[0]:  # a sample was taken
        for k in range(2):
            if not max(highest[k], -lowest[k]) <= limit:
                return False
    twice = 0.0
    for j in range(n):
        twice += motion[n + j] * motion[n + j]
        along = 0.0
        for k in range(n):
            along += stiffness[j, k] * motion[k]
        twice += motion[j] * along
    return bool(0.5 * twice <= energy_limit)


@linked_sum
def is_beyond(reduced: Reduced, displacement: Floats) -> bool:
    """Whether reduced displacements, the first n of a motion, pass the limit or are NaN."""
    for row in range(reduced.translations.shape[0]):
        seen = 0.0
        for k in range(reduced.translations.shape[1]):
            seen += reduced.translations[row, k] * displacement[k]
        if not abs(seen) <= reduced.displacement_limit:
            return True
    return False
