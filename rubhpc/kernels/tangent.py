"""The exact tangent of a motion along its trail: exponentials between events, saltation at events.

A small displacement d of a motion x moves an event, at which a switch function h vanishes, by
`t = -(grad h . d) / (dh/dt)`. With f the rate of the motion, the displaced motion meets the event at d + t
f-. The derivative DR of the impact maps this displacement, and `- t f+` returns to the time of the event:
`S d = DR (d + t f-) - t f+`. This applies the saltation matrix S (Leine and Nijmeijer 2004) without forming
it. In modal coordinates the rates are products with the exponents, so that an event costs as much as entering
a contact mode.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.complementarity import solve_active
from rubhpc.kernels.contact_modes import ModeTables, Reduced, add_rows, copy_coordinates, dot, leave
from rubhpc.kernels.coordinate_steps import floor_log2, turn_on
from rubhpc.kernels.mode_change import AT_REST, product
from rubhpc.kernels.trail import Trail  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ALL_CARRIED = -1
NO_IMPULSE = 1e-12  # of the largest impulse of an event
LOST = 1e-280  # a smaller displacement counts as zero
PIECE, REVOLUTION, PASSED, IS_ENTERED = range(4)  # items of `Tangent.reached`


class TrailModes(Struct):
    """The k distinct contact modes of a trail."""

    of_piece: Ints  # (room + 1,), contact mode of each piece
    place: Ints  # (k,), in the tables, or -1
    exponent: Floats  # (k, 2, m), 1/s
    opened: Ints  # (k,), pairs that are open


class Tangent(Struct):
    """A displacement of a motion and work space; m coordinates, n reduced degrees, q pairs."""

    reached: Ints  # (4,), piece, revolution, ticks passed, whether the first mode is entered
    motion: Floats  # (2 n,), the displacement outside contact modes: at the beginning and at the end
    generic: Floats  # (2 n,), replaces a displacement that has become zero
    d: Floats  # (2, m)
    z: Floats  # (2, m), the motion itself
    grown: Floats  # (n_revolution,), filled in: logarithm of the growth in each revolution
    speed: Floats  # (q,)
    given: Floats  # (q,), derivatives of the impulses
    active: NDArray[np.bool_]  # (q,)
    elimination: Floats  # (q, q + 1)


def new_tangent(m: int, q: int, generic: Floats, n_revolution: int) -> Tangent:
    """Begin with the displacement `generic` (2 n,), for a trail of some revolutions."""
    return Tangent(
        reached=np.zeros(4, dtype=np.int64),
        motion=generic.copy(),
        generic=generic,
        d=np.zeros((2, m)),
        z=np.zeros((2, m)),
        grown=np.zeros(n_revolution),
        speed=np.zeros(q),
        given=np.zeros(q),
        active=np.zeros(q, dtype=np.bool_),
        elimination=np.zeros((q, q + 1)),
    )


@jit_sum
def carry_along(
    tables: ModeTables,
    reduced: Reduced,
    spin: float,
    first: int,
    per_revolution: int,
    trail: Trail,
    modes: TrailModes,
    tangent: Tangent,
) -> int:
    """Propagate a displacement along a trail: `tangent.grown.size` revolutions of `per_revolution` ticks.

    The trail begins at the tick `first`.

    The size of a displacement is the root of v'v + spin^2 u'u in reduced coordinates, in which the mass
    matrix is the identity; it is normalised to 1 after every revolution.

    Returns
    -------
    int
        ALL_CARRIED, or the piece whose contact mode is missing from the tables: add it and call again.
    """
    reached, d, z = tangent.reached, tangent.d, tangent.z
    n_event, n_revolution = trail.n_event[0], tangent.grown.size
    while True:
        k = reached[PIECE]
        which = modes.of_piece[k]
        place = modes.place[which]
        if place < 0:
            return int(k)
        exponent = modes.exponent[which]
        if reached[IS_ENTERED] == 0:
            enter_displacement(tables, place, 0.0, 0.0, tangent)
            reached[IS_ENTERED] = 1
        begun = trail.tick[k - 1] - first if k > 0 else 0
        end = trail.tick[k] - first if k < n_event else n_revolution * per_revolution
        while reached[REVOLUTION] < n_revolution and (reached[REVOLUTION] + 1) * per_revolution <= end:
            turn = (reached[REVOLUTION] + 1) * per_revolution
            move(tables, place, turn - reached[PASSED], d)
            reached[PASSED] = turn
            leave(tables, place, d, tangent.motion)
            size = size_of(tangent.motion, spin)
            tangent.grown[reached[REVOLUTION]] = np.log(max(size, LOST))
            reached[REVOLUTION] += 1
            if size > LOST:
                for i in range(d.shape[1]):
                    d[0, i] /= size
                    d[1, i] /= size
            else:
                for i in range(tangent.motion.size):
                    tangent.motion[i] = tangent.generic[i]
                enter_displacement(tables, place, 0.0, 0.0, tangent)
        if k == n_event:
            leave(tables, place, d, tangent.motion)
            return ALL_CARRIED
        following = modes.of_piece[k + 1]
        next_place = modes.place[following]
        if next_place < 0:
            return int(k + 1)
        crossing = trail.crossing[k]
        is_touching = crossing & modes.opened[which] != 0
        shift, cosine_rate, sine_rate = 0.0, 0.0, 0.0
        move(tables, place, end - reached[PASSED], d)
        reached[PASSED] = end
        if is_touching:
            copy_coordinates(trail.begun[k], z)
            move(tables, place, end - begun, z)
            j = floor_log2(crossing & -crossing)
            rate = dot(tables.rate_re[place, j], tables.rate_im[place, j], z[0], z[1])
            shift = -dot(tables.switch_re[place, j], tables.switch_im[place, j], d[0], d[1]) / rate
            add_rate(shift, exponent, z, d)
            forced = tables.n_eigenmode[place]
            cosine_rate, sine_rate = d[0, forced], d[1, forced]
        leave(tables, place, d, tangent.motion)
        if is_touching:
            strike_motion(reduced, trail.given[k], trail.rate[k], tangent)
        enter_displacement(tables, next_place, cosine_rate, sine_rate, tangent)
        if shift != 0.0:
            copy_coordinates(trail.begun[k + 1], z)
            add_rate(-shift, modes.exponent[following], z, d)
        forced = tables.n_eigenmode[next_place]
        d[0, forced], d[1, forced] = 0.0, 0.0
        reached[PIECE] = k + 1


@linked_sum
def move(tables: ModeTables, place: int, n_tick: int, z: Floats) -> None:
    """Advance coordinates (2, m) by `n_tick` ticks."""
    power_re, power_im = tables.power_re[place], tables.power_im[place]
    most, left = (1 << power_re.shape[0]) - 1, n_tick
    while left > 0:
        turn_on(min(left, most), power_re, power_im, z[0], z[1])
        left -= most


@linked_sum
def add_rate(time: float, exponent: Floats, z: Floats, d: Floats) -> None:
    """Add the change of a motion z in a time, s, to a displacement d, both (2, m)."""
    for i in range(z.shape[1]):
        growth, turning = time * exponent[0, i], time * exponent[1, i]
        d[0, i] += growth * z[0, i] - turning * z[1, i]
        d[1, i] += growth * z[1, i] + turning * z[0, i]


@linked_sum
def enter_displacement(tables: ModeTables, place: int, cosine: float, sine: float, tangent: Tangent) -> None:
    """Fill the coordinates from `tangent.motion` and from a change of the shaft's cosine and sine."""
    for part in range(2):
        target = tangent.d[part]
        from_cosine, from_sine = tables.enter_cosine[place, part], tables.enter_sine[place, part]
        for i in range(target.size):
            target[i] = -from_cosine[i] * cosine - from_sine[i] * sine
        add_rows(tables.enter_re[place] if part == 0 else tables.enter_im[place], tangent.motion, target)


@linked_sum
def size_of(motion: Floats, spin: float) -> float:
    """Root of v'v + spin^2 u'u of a motion (2 n,)."""
    n = motion.size // 2
    square = 0.0
    for i in range(n):
        u, v = spin * motion[i], motion[n + i]
        square += v * v + u * u
    return float(np.sqrt(square))


@linked_sum
def strike_motion(reduced: Reduced, impulse: Floats, rate: Floats, tangent: Tangent) -> None:
    """Apply the derivative of an impact to `tangent.motion`: `dv+ = dv- - F (R F)^-1 R dv-`.

    The rows R are those of the gap velocities that impulses change, each times 1 + restitution where the pair
    parts; F are the directions of the impulses, including friction. `impulse` (q,) are those of the event,
    `rate` (q,) gap rates after it.
    """
    q, n = reduced.gap_jacobian.shape
    moved, active, given = tangent.motion[n:], tangent.active, tangent.given
    largest = 0.0
    for i in range(q):
        largest = max(largest, abs(impulse[i]))
    if largest == 0.0:
        return
    for i in range(q):
        active[i] = impulse[i] > NO_IMPULSE * largest
        parts = abs(rate[i]) > AT_REST
        scale = 1.0 + reduced.restitution if parts else 1.0
        tangent.speed[i] = scale * product(reduced.gap_jacobian[i], moved)
    if not solve_active(reduced.delassus, tangent.speed, active, given, tangent.elimination):
        return
    for i in range(q):
        if active[i]:
            for k in range(n):
                moved[k] += given[i] * reduced.force_direction[i, k]
