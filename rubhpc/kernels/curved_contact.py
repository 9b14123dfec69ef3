"""Closed contacts whose gap is curved: the rim is round, and a bent stator draws its tip back.

The gap of a pair is that along its stator's axis, plus h, which curvature adds. While the pair is closed, h
follows from the tangential and the bending displacements alone. The tables of the fixed normal hold for the
motion plus E h, where E moves one gap and no force of contact; h, its rate and what a turning normal changes
of the forces act on their coordinates as loads, which are quadratic in time over a step. Their response is
exact, and the loads are found by iteration: collocation at the beginning, the middle and the end (Lobatto),
of order 4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_lean_sum
from rubhpc.kernels.complementarity import solve_active
from rubhpc.kernels.contact_modes import dot

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Motions of a pair, in this order: tip against disc along the stator's axis and across it (with the rim);
# the bending displacements, whose squares add up to twice the foreshortening; last the twist of the disc.
ALONG, ACROSS, BENDING = range(3)
# Loads of a pair: h, its rate, and the changes of the contact force along, across and on each bending.
HEIGHT, HEIGHT_RATE, LOAD_ALONG, LOAD_ACROSS, LOAD_BENDING = range(5)
N_NODE = 3  # beginning, middle and end of a step
MOST_PASSES = 8  # for h at given coordinates; two or three are taken
EXACT = 1e-17  # m, change of h at which they end


class CurvedPairs(NamedTuple):
    """Pairs with a curved gap: q pairs, n reduced degrees, b bending displacements of each."""

    row: Floats  # (q, 3 + b, n), motions of each pair; rad/m^0.5 of a bending displacement, twist in rad
    gram: Floats  # (q, 3 + b, q, 3 + b), products of the rows: what unit loads on one do to another, 1/kg
    output: Floats  # (3, o, n), outputs of `ModeTables`, of displacements, velocities and accelerations
    radius: Floats  # (q,), m
    clearance: Floats  # (q,), at rest, m
    aside: Floats  # (q,), how far a tip at rest stands aside of its axis through the disc, m
    friction: Floats  # (q,), coefficient, with the sign of the spin
    stiffness: Floats  # (q,), that turns a gap into a force for the control of errors, N/m
    leverage: Floats  # (q, b), m^-0.5, that turns a load on the bending into a lateral force on the tip
    is_round: bool  # the normal follows the line of centres; else it is the stator's axis
    sense: float  # 1 or -1, of the spin


class CurvedTables(NamedTuple):
    """What the tables of p contact modes lack for curved gaps; m coordinates, d = 2 + b motions and twist."""

    read_re: Floats  # (p, q, 3 d + 1, m), motions, their rates, the rate of twist, their accelerations free
    read_im: Floats
    bound: Floats  # (p, q, d, m), bound on the second time derivative of a motion for a unit coordinate
    shift: Floats  # (p, q, n), motion E of each closed pair that a unit h takes off
    moved: Floats  # (p, q, d + 1, q), motions that a unit h of each closed pair takes off
    accel: Floats  # (p, q, d, q), 1/s2, free accelerations that a unit h adds
    accel_rate: Floats  # (p, q, d, q), 1/s, that a unit rate of h adds
    load_re: Floats  # (p, q, 4 + b, m), rates of the coordinates under unit loads
    load_im: Floats
    weight_re: Floats  # (p, n_level, 2, 3, m), s, response in the middle and at the end to loads at the nodes
    weight_im: Floats
    reach: Floats  # (p, n_level, 2, 3, 3 d + 1, 4 + b), what the loads add to what is read of a lone pair
    half_re: Floats  # (p, m), exponential of each coordinate over half a tick
    half_im: Floats


class CurvedWork(NamedTuple):
    """Work space, and what a closed contact carries from step to step."""

    h: Floats  # (3, q), m, at the nodes of the step
    rate: Floats  # (3, q), m/s
    force: Floats  # (3, q), N
    slip: Floats  # (3, q), m/s
    load: Floats  # (3, q, 4 + b)
    before: Floats  # (3, q, 4 + b), loads of the step before
    gap: Floats  # (2, 3, q), of open pairs at the nodes, m, and their rates
    span: Floats  # (2,), s, length of the step before (0: none), then largest force of the contact, N
    motion: Floats  # (3, q, 3 + b), displacements, rates and free accelerations at a node
    free: Floats  # (2, 3 d + 1), what is read in the middle and at the end without the loads, of one pair
    normal: Floats  # (2, q), along and across
    jacobian: Floats  # (q, 3 + b), of the gaps in the motions
    direction: Floats  # (q, 3 + b), of the forces
    matrix: Floats  # (q, q)
    opening: Floats  # (q,)
    active: NDArray[np.bool_]  # (q,)
    elimination: Floats  # (q, q + 1)
    last: Floats  # (q, 4 + b), loads at a node before they are computed again
    power: Floats  # (3, 2), W, of damping and of the unbalance at the nodes
    state: Floats  # (2 n,), displacements and velocities at a node
    acceleration: Floats  # (n,), at a sample
    response: Floats  # (3, 2, m), rates of the coordinates under the loads at the nodes
    middle: Floats  # (2, m)
    shape: Floats  # (2, q, n), Jacobian and directions of an event


def curved_work(q: int, n_row: int, n: int, m: int) -> CurvedWork:
    """Work space for q pairs of `n_row` motions, n reduced degrees and m coordinates."""
    nodes = np.zeros((4, N_NODE, q))
    return CurvedWork(
        h=nodes[0].copy(),
        rate=nodes[1].copy(),
        force=nodes[2].copy(),
        slip=nodes[3].copy(),
        load=np.zeros((N_NODE, q, n_row + 1)),
        before=np.zeros((N_NODE, q, n_row + 1)),
        gap=np.zeros((2, N_NODE, q)),
        span=np.zeros(2),
        motion=np.zeros((3, q, n_row)),
        free=np.zeros((2, 3 * n_row - 2)),
        normal=np.zeros((2, q)),
        jacobian=np.zeros((q, n_row)),
        direction=np.zeros((q, n_row)),
        matrix=np.zeros((q, q)),
        opening=np.zeros(q),
        active=np.zeros(q, dtype=np.bool_),
        elimination=np.zeros((q, q + 1)),
        last=np.zeros((q, n_row + 1)),
        power=np.zeros((N_NODE, 2)),
        state=np.zeros(2 * n),
        acceleration=np.zeros(n),
        response=np.zeros((N_NODE, 2, m)),
        middle=np.zeros((2, m)),
        shape=np.zeros((2, q, n)),
    )


@jit_inline_sum
def is_closed(mask: int, i: int) -> bool:
    """Whether pair i is among the closed ones."""
    return (mask >> i) & 1 == 1


@jit_inline_sum
def curvature(radius: float, across: float, is_round: bool) -> float:
    """What a round rim adds to the gap of a closed pair, m: r - sqrt(r^2 - d^2), without cancellation."""
    if not is_round:
        return 0.0
    square = across * across
    return float(square / (radius + np.sqrt(radius * radius - square)))


@jit_lean_sum
def read_motion(
    tables: CurvedTables, mode: int, mask: int, z_re: Floats, z_im: Floats, motion: Floats
) -> None:
    """Motions (3, q, 3 + b) of all pairs, their rates and free accelerations, with the h of all taken for 0.

    Accelerations are those of the closed pairs, and of the others too where any is closed.
    """
    q, d = tables.bound.shape[1], tables.bound.shape[2]
    for i in range(q):
        for j in range(d):
            motion[0, i, j] = dot(tables.read_re[mode, i, j], tables.read_im[mode, i, j], z_re, z_im)
        for j in range(d + 1):
            a = d + j
            motion[1, i, j] = dot(tables.read_re[mode, i, a], tables.read_im[mode, i, a], z_re, z_im)
        if is_closed(mask, i):
            for j in range(d):
                a = 2 * d + 1 + j
                motion[2, i, j] = dot(tables.read_re[mode, i, a], tables.read_im[mode, i, a], z_re, z_im)


@jit_lean_sum
def find_heights(
    pairs: CurvedPairs, tables: CurvedTables, mode: int, mask: int, node: int, work: CurvedWork
) -> None:
    """Find h of the closed pairs, and its rate, at a node; `work.motion` becomes the whole motion."""
    q, d = tables.bound.shape[1], tables.bound.shape[2]
    motion, moved, h, rate = work.motion, tables.moved, work.h, work.rate
    for _ in range(MOST_PASSES):
        change = 0.0
        for i in range(q):
            if is_closed(mask, i):
                new = 0.0
                for j in range(ACROSS, d):
                    at = motion[0, i, j] + (pairs.aside[i] if j == ACROSS else 0.0)
                    for k in range(q):
                        if is_closed(mask, k):
                            at -= moved[mode, i, j, k] * h[node, k]
                    new += curvature(pairs.radius[i], at, pairs.is_round) if j == ACROSS else 0.5 * at * at
                change = max(change, abs(new - h[node, i]))
                h[node, i] = new
        if change <= EXACT:
            break
    for i in range(q):
        for k in range(q):
            if is_closed(mask, k):
                for j in range(d):
                    motion[0, i, j] -= moved[mode, i, j, k] * h[node, k]
    for i in range(q):  # how fast h follows the motions
        if is_closed(mask, i):
            across = motion[0, i, ACROSS] + pairs.aside[i]
            steep = 0.0
            if pairs.is_round:
                steep = across / np.sqrt(pairs.radius[i] * pairs.radius[i] - across * across)
            work.jacobian[i, ALONG], work.jacobian[i, ACROSS] = 0.0, steep
            for j in range(BENDING, d):
                work.jacobian[i, j] = motion[0, i, j]
    for _ in range(MOST_PASSES):
        change = 0.0
        for i in range(q):
            if is_closed(mask, i):
                new = 0.0
                for j in range(ACROSS, d):
                    now = motion[1, i, j]
                    for k in range(q):
                        if is_closed(mask, k):
                            now -= moved[mode, i, j, k] * rate[node, k]
                    new += work.jacobian[i, j] * now
                change = max(change, abs(new - rate[node, i]))
                rate[node, i] = new
        if change <= 1e4 * EXACT:
            break
    for i in range(q):
        for k in range(q):
            if is_closed(mask, k):
                for j in range(d + 1):
                    motion[1, i, j] -= moved[mode, i, j, k] * rate[node, k]
                if is_closed(mask, i):
                    for j in range(d):
                        motion[2, i, j] += (
                            tables.accel[mode, i, j, k] * h[node, k]
                            + tables.accel_rate[mode, i, j, k] * rate[node, k]
                        )


@jit_lean_sum
def fill_geometry(pairs: CurvedPairs, i: int, d: int, work: CurvedWork) -> tuple[float, float]:
    """Normal, gap Jacobian and force direction of pair i at `work.motion`; gap (m) and what bends it (m/s2).

    The latter is the acceleration of the gap at constant rates of the motions.
    """
    motion = work.motion
    back, bending, turning = 0.0, 0.0, 0.0
    for j in range(BENDING, d):
        back += 0.5 * motion[0, i, j] * motion[0, i, j]
        bending += motion[1, i, j] * motion[1, i, j]
        turning += motion[0, i, j] * motion[1, i, j]
    reach = pairs.radius[i] + pairs.clearance[i] + motion[0, i, ALONG] + back
    across = pairs.aside[i] + motion[0, i, ACROSS]
    along, aslant, distance = 1.0, 0.0, reach
    if pairs.is_round:
        distance = np.sqrt(reach * reach + across * across)
        along, aslant = reach / distance, across / distance
    slide = along * motion[1, i, ACROSS] - aslant * (motion[1, i, ALONG] + turning)
    bends = along * bending
    if pairs.is_round:
        bends += slide * slide / distance
    friction = pairs.friction[i]
    pressing = along - friction * aslant
    work.normal[0, i], work.normal[1, i] = along, aslant
    work.jacobian[i, ALONG], work.jacobian[i, ACROSS], work.jacobian[i, d] = along, aslant, 0.0
    work.direction[i, ALONG], work.direction[i, ACROSS] = pressing, aslant + friction * along
    work.direction[i, d] = -friction * pairs.radius[i]
    for j in range(BENDING, d):
        work.jacobian[i, j] = along * motion[0, i, j]
        work.direction[i, j] = pressing * motion[0, i, j]
    return distance - pairs.radius[i], bends


@jit_lean_sum
def slip_of(pairs: CurvedPairs, i: int, d: int, rim_speed: float, work: CurvedWork) -> float:
    """Slip speed, m/s, of pair i, of which the geometry is filled; positive in steady sliding."""
    motion = work.motion
    turning = 0.0
    for j in range(BENDING, d):
        turning += motion[0, i, j] * motion[1, i, j]
    slide = work.normal[0, i] * motion[1, i, ACROSS] - work.normal[1, i] * (motion[1, i, ALONG] + turning)
    return float(rim_speed + pairs.sense * (pairs.radius[i] * motion[1, i, d] - slide))


@jit_lean_sum
def evaluate(
    pairs: CurvedPairs,
    tables: CurvedTables,
    rim_speed: Floats,
    mode: int,
    mask: int,
    node: int,
    z_re: Floats,
    z_im: Floats,
    work: CurvedWork,
) -> bool:
    """Forces, slips and loads of the closed pairs at a node, and gaps of the others; False without forces.

    The forces are those under which the gaps stay closed: with J the gap Jacobian and F the directions of the
    forces, `J F N = -(J a + b)`, a the free accelerations and b those at constant rates.
    """
    read_motion(tables, mode, mask, z_re, z_im, work.motion)
    return find_forces(pairs, tables, rim_speed, mode, mask, node, work)


@jit_lean_sum
def find_forces(
    pairs: CurvedPairs,
    tables: CurvedTables,
    rim_speed: Floats,
    mode: int,
    mask: int,
    node: int,
    work: CurvedWork,
) -> bool:
    """Go on where `evaluate` has read the motions into `work.motion`."""
    q, d = tables.bound.shape[1], tables.bound.shape[2]
    find_heights(pairs, tables, mode, mask, node, work)
    for i in range(q):
        gap, bends = fill_geometry(pairs, i, d, work)
        work.active[i] = is_closed(mask, i)
        if work.active[i]:
            for j in range(d):
                bends += work.jacobian[i, j] * work.motion[2, i, j]
            work.opening[i] = bends
            work.slip[node, i] = slip_of(pairs, i, d, rim_speed[i], work)
        else:
            opens = 0.0
            for j in range(d):
                opens += work.jacobian[i, j] * work.motion[1, i, j]
            work.gap[0, node, i], work.gap[1, node, i] = gap, opens
    for i in range(q):
        if work.active[i]:
            for k in range(q):
                if work.active[k]:
                    total = 0.0
                    for a in range(d + 1):
                        if work.jacobian[i, a] != 0.0:
                            for c in range(d + 1):
                                total += work.jacobian[i, a] * pairs.gram[i, a, k, c] * work.direction[k, c]
                    work.matrix[i, k] = total
    if not solve_active(work.matrix, work.opening, work.active, work.force[node], work.elimination):
        return False
    is_finite = True
    for i in range(q):
        if work.active[i]:
            force = work.force[node, i]
            is_finite = is_finite and np.isfinite(force)
            work.load[node, i, HEIGHT], work.load[node, i, HEIGHT_RATE] = work.h[node, i], work.rate[node, i]
            work.load[node, i, LOAD_ALONG] = force * (work.direction[i, ALONG] - 1.0)
            work.load[node, i, LOAD_ACROSS] = force * (work.direction[i, ACROSS] - pairs.friction[i])
            for j in range(BENDING, d):
                work.load[node, i, j + 2] = force * work.direction[i, j]
    return is_finite


@jit_inline_sum
def lone_pair(mask: int, q: int) -> int:
    """The closed pair, where it is the only pair; else -1."""
    return 0 if q == 1 and mask == 1 else -1


@jit_lean_sum
def read_free(
    tables: CurvedTables, mode: int, p_re: Floats, p_im: Floats, z_re: Floats, z_im: Floats, free: Floats
) -> None:
    """What is read (3 d + 1,) of the only pair after a step with the powers `p` (m,), without loads."""
    for r in range(free.size):
        re, im = tables.read_re[mode, 0, r], tables.read_im[mode, 0, r]
        total = 0.0
        for k in range(z_re.size):
            total += re[k] * (p_re[k] * z_re[k] - p_im[k] * z_im[k])
            total -= im[k] * (p_re[k] * z_im[k] + p_im[k] * z_re[k])
        free[r] = total


@jit_lean_sum
def read_loaded(tables: CurvedTables, mode: int, level: int, node: int, work: CurvedWork) -> None:
    """Fill the motion of the only pair at a node of a step of 2^level ticks, under the loads at its nodes."""
    d, n_load = tables.bound.shape[2], work.load.shape[2]
    free, motion = work.free[node - 1], work.motion
    for r in range(free.size):
        total = free[r]
        for a in range(N_NODE):
            row = tables.reach[mode, level, node - 1, a, r]
            for j in range(n_load):
                total += row[j] * work.load[a, 0, j]
        if r < d:
            motion[0, 0, r] = total
        elif r <= 2 * d:
            motion[1, 0, r - d] = total
        else:
            motion[2, 0, r - 2 * d - 1] = total


@jit_lean_sum
def respond(tables: CurvedTables, mode: int, mask: int, node: int, work: CurvedWork) -> None:
    """Rates of the coordinates under the loads at a node, into `work.response`."""
    re, im = work.response[node, 0], work.response[node, 1]
    for k in range(re.size):
        re[k], im[k] = 0.0, 0.0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for a in range(work.load.shape[2]):
                load = work.load[node, i, a]
                row_re, row_im = tables.load_re[mode, i, a], tables.load_im[mode, i, a]
                for k in range(re.size):
                    re[k] += row_re[k] * load
                    im[k] += row_im[k] * load


@jit_lean_sum
def add_responses(
    tables: CurvedTables, mode: int, level: int, node: int, response: Floats, re: Floats, im: Floats
) -> None:
    """Add the responses at a node of a step of 2^level ticks to the loads at the three nodes."""
    for a in range(N_NODE):
        w_re = tables.weight_re[mode, level, node - 1, a]
        w_im = tables.weight_im[mode, level, node - 1, a]
        r_re, r_im = response[a, 0], response[a, 1]
        for k in range(re.size):
            re[k] += w_re[k] * r_re[k] - w_im[k] * r_im[k]
            im[k] += w_re[k] * r_im[k] + w_im[k] * r_re[k]


@jit_lean_sum
def predict_loads(mask: int, step: float, work: CurvedWork) -> None:
    """Loads in the middle and at the end of a step (s): those of the step before, gone on as it went."""
    q, n_load = work.load.shape[1], work.load.shape[2]
    ratio = step / work.span[0] if work.span[0] > 0.0 else 0.0
    for node in range(1, N_NODE):
        t = 1.0 + 0.5 * node * ratio  # in units of the step before
        for i in range(q):
            if is_closed(mask, i):
                for a in range(n_load):
                    first, middle, last = work.before[0, i, a], work.before[1, i, a], work.before[2, i, a]
                    bend = 2.0 * (first - 2.0 * middle + last)
                    slope = last - first + bend  # at its end
                    load = work.load[0, i, a]
                    if ratio > 0.0:
                        load += (t - 1.0) * (slope + (t - 1.0) * bend)
                    work.load[node, i, a] = load
                work.h[node, i], work.rate[node, i] = (
                    work.load[node, i, HEIGHT],
                    work.load[node, i, HEIGHT_RATE],
                )


@jit_inline_sum
def load_change(pairs: CurvedPairs, mask: int, node: int, before: Floats, work: CurvedWork) -> float:
    """By how much the loads at a node differ from those `before` (q, 4 + b), as a force, N."""
    largest = 0.0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            force = pairs.stiffness[i] * abs(work.load[node, i, HEIGHT] - before[i, HEIGHT])
            force += abs(work.load[node, i, LOAD_ALONG] - before[i, LOAD_ALONG])
            force += abs(work.load[node, i, LOAD_ACROSS] - before[i, LOAD_ACROSS])
            for a in range(LOAD_BENDING, work.load.shape[2]):
                force += pairs.leverage[i, a - LOAD_BENDING] * abs(work.load[node, i, a] - before[i, a])
            largest = max(largest, force)
    return largest
