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
STOPPED = 1e-9  # of the rim's speed: a pair that slips less after an impact sticks
LOST = 1e-280  # a smaller displacement counts as zero
PIECE, REVOLUTION, PASSED, IS_ENTERED = range(4)  # items of `Tangent.reached`


class TrailModes(Struct):
    """The k distinct contact modes of a trail."""

    of_piece: Ints  # (room + 1,), contact mode of each piece
    place: Ints  # (k,), in the tables, or -1
    exponent: Floats  # (k, 2, m), 1/s
    drift: Floats  # (k, m), of the coordinates with exponent 0
    opened: Ints  # (k,), bits of the switch functions that are gaps
    has_states: bool  # whether pairs may slide in either sense and stick
    slips_evenly: bool  # whether a pair that sticks begins to slide with the friction that it has


class Tangent(Struct):
    """A displacement of a motion and work space; m coordinates, n reduced degrees, q pairs."""

    reached: Ints  # (4,), piece, revolution, ticks passed, whether the first mode is entered
    motion: Floats  # (2 n,), the displacement outside contact modes: at the beginning and at the end
    generic: Floats  # (2 n,), replaces a displacement that has become zero
    d: Floats  # (2, m)
    z: Floats  # (2, m), the motion itself
    grown: Floats  # (n_revolution,), filled in: logarithm of the growth in each revolution
    share: Floats  # (q,)
    compliance: Floats  # (2 q, 2 q)
    speed: Floats  # (2 q,)
    found: Floats  # (2 q,)
    rate: Floats  # (2, q), changes of gap rates, then of slips, by the displacement
    given: Floats  # (2, q), derivatives of the normal, then the tangential impulses
    active: NDArray[np.bool_]  # (2 q,)
    elimination: Floats  # (2 q, 2 q + 1)


def new_tangent(m: int, q: int, generic: Floats, n_revolution: int) -> Tangent:
    """Begin with the displacement `generic` (2 n,), for a trail of some revolutions."""
    return Tangent(
        reached=np.zeros(4, dtype=np.int64),
        motion=generic.copy(),
        generic=generic,
        d=np.zeros((2, m)),
        z=np.zeros((2, m)),
        grown=np.zeros(n_revolution),
        share=np.zeros(q),
        compliance=np.zeros((2 * q, 2 * q)),
        speed=np.zeros(2 * q),
        found=np.zeros(2 * q),
        rate=np.zeros((2, q)),
        given=np.zeros((2, q)),
        active=np.zeros(2 * q, dtype=np.bool_),
        elimination=np.zeros((2 * q, 2 * q + 1)),
    )


@jit_sum
def carry_along(
    tables: ModeTables,
    reduced: Reduced,
    spin: float,
    tick: float,
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
        exponent, drift = modes.exponent[which], modes.drift[which]
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
        if is_touching or (
            modes.has_states and (trail.states[k + 1] & ~trail.states[k] != 0 or not modes.slips_evenly)
        ):
            copy_coordinates(trail.begun[k], z)
            move(tables, place, end - begun, z)
            for i in range(z.shape[1]):
                z[0, i] += drift[i] * (end - begun) * tick
            j = floor_log2(crossing & -crossing)
            rate = dot(tables.rate_re[place, j], tables.rate_im[place, j], z[0], z[1])
            shift = -dot(tables.switch_re[place, j], tables.switch_im[place, j], d[0], d[1]) / rate
            add_rate(shift, exponent, drift, z, d)
            forced = tables.n_eigenmode[place]
            cosine_rate, sine_rate = d[0, forced], d[1, forced]
        leave(tables, place, d, tangent.motion)
        if is_touching and reduced.spring == 0.0:
            strike_motion(reduced, modes.has_states, trail.given[k], trail.rate[k], tangent)
        enter_displacement(tables, next_place, cosine_rate, sine_rate, tangent)
        if shift != 0.0:
            copy_coordinates(trail.begun[k + 1], z)
            add_rate(-shift, modes.exponent[following], modes.drift[following], z, d)
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
def add_rate(time: float, exponent: Floats, drift: Floats, z: Floats, d: Floats) -> None:
    """Add the change of a motion z in a time, s, to a displacement d, both (2, m)."""
    for i in range(z.shape[1]):
        growth, turning = time * exponent[0, i], time * exponent[1, i]
        d[0, i] += growth * z[0, i] - turning * z[1, i] + time * drift[i]
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
def strike_motion(
    reduced: Reduced, has_states: bool, impulse: Floats, rate: Floats, tangent: Tangent
) -> None:
    """Apply the derivative of an impact, from `strike`, to `tangent.motion`."""
    q, n = reduced.gap_jacobian.shape
    moved = tangent.motion[n:]
    for i in range(q):
        tangent.rate[0, i] = product(reduced.gap_jacobian[i], moved)
        tangent.rate[1, i] = product(reduced.slip[i], moved)
    strike(reduced, has_states, impulse, rate, tangent)
    for i in range(q):
        given, along_slip = tangent.given[0, i], tangent.given[1, i]
        for k in range(n):
            if has_states:
                moved[k] += given * reduced.gap_jacobian[i, k] - along_slip * reduced.slip[i, k]
            else:
                moved[k] += given * reduced.force_direction[i, k]


@linked_sum
def strike(reduced: Reduced, has_states: bool, impulse: Floats, rate: Floats, tangent: Tangent) -> None:
    """Fill `tangent.given` with the impulses of the derivative of an impact: `dv+ = dv- - F (R F)^-1 R dv-`.

    The rows R are those of the gap velocities that impulses change, each times 1 + restitution where the pair
    parts, and of the slips that they stop. F are the directions of these impulses, including proportional
    friction. `impulse` (2, q) are the normal and tangential impulses, `rate` (2, q) are gap rates and slips
    after the impact, and `tangent.rate` the change of gap rates and slips by the displacement.
    """
    q, active, share, compliance = reduced.radius.size, tangent.active, tangent.share, tangent.compliance
    gap, slip = reduced.gap_jacobian, reduced.slip
    tangent.given[:] = 0.0
    largest = 0.0
    for i in range(q):
        largest = max(largest, abs(impulse[0, i]))
    if largest == 0.0:
        return
    for i in range(q):
        active[q + i] = False
        active[i] = impulse[0, i] > NO_IMPULSE * largest
        share[i] = 0.0
        if active[i]:
            parts = abs(rate[0, i]) > AT_REST
            scale = 1.0 + reduced.restitution if parts else 1.0
            tangent.speed[i] = scale * tangent.rate[0, i]
            if has_states:
                if abs(rate[1, i]) <= STOPPED * reduced.rim_speed[i]:
                    active[q + i] = True
                    tangent.speed[q + i] = tangent.rate[1, i]
                else:
                    share[i] = impulse[1, i] / impulse[0, i]
    for j in range(q):
        if active[j]:
            for i in range(q):
                if active[i]:
                    compliance[i, j] = along(reduced, has_states, gap[i], j, share[j])
                    if active[q + i]:
                        compliance[q + i, j] = along(reduced, has_states, slip[i], j, share[j])
                    if active[q + j]:
                        compliance[i, q + j] = product(gap[i], slip[j])
                        if active[q + i]:
                            compliance[q + i, q + j] = product(slip[i], slip[j])
    if not solve_active(compliance, tangent.speed, active, tangent.found, tangent.elimination):
        return
    for i in range(q):
        if active[i]:
            tangent.given[0, i] = tangent.found[i]
            tangent.given[1, i] = share[i] * tangent.found[i]
        if active[q + i]:
            tangent.given[1, i] -= tangent.found[q + i]


@linked_sum
def along(reduced: Reduced, has_states: bool, row: Floats, j: int, share: float) -> float:
    """Product of a row (n,) with the direction of the impulse of pair j."""
    if has_states:
        return product(row, reduced.gap_jacobian[j]) - share * product(row, reduced.slip[j])
    return product(row, reduced.force_direction[j])
