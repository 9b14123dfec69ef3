"""Closed contacts with curved gaps at given coordinates: heights, normals, slips and forces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.complementarity import solve_active
from rubhpc.kernels.contact_modes import dot
from rubhpc.kernels.curved_contact import (
    ACROSS,
    ALONG,
    BENDING,
    HEIGHT,
    HEIGHT_RATE,
    LOAD_ACROSS,
    LOAD_ALONG,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)

Floats = NDArray[np.float64]

MOST_PASSES = 8  # iterations for h at given coordinates; two or three are usual
EXACT = 1e-17  # m, change of h at which they end
CLOSE = 1e-11  # m, the same for a method that squares the error


@linked_sum
def curvature(radius: float, across: float, is_round: bool) -> float:
    """Height of a round rim above its chord at a closed pair, m: r - sqrt(r^2 - d^2) without cancellation."""
    if not is_round:
        return 0.0
    square = across * across
    return float(square / (radius + np.sqrt(radius * radius - square)))


@linked_sum
def read_motion(
    tables: CurvedTables, mode: int, mask: int, which: int, z_re: Floats, z_im: Floats, motion: Floats
) -> None:
    """Motions (3, q, 3 + b) of the pairs `which` and their rates, at h = 0.

    Free accelerations of the closed pairs too.
    """
    q, d = tables.bound.shape[1], tables.bound.shape[2]
    for i in range(q):
        if not is_closed(which, i):
            continue
        for j in range(d):
            motion[0, i, j] = dot(tables.read_re[mode, i, j], tables.read_im[mode, i, j], z_re, z_im)
        for j in range(d + 1):
            a = d + j
            motion[1, i, j] = dot(tables.read_re[mode, i, a], tables.read_im[mode, i, a], z_re, z_im)
        if is_closed(mask, i):
            for j in range(d):
                a = 2 * d + 1 + j
                motion[2, i, j] = dot(tables.read_re[mode, i, a], tables.read_im[mode, i, a], z_re, z_im)


@linked_sum
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
    take_off(tables, mode, mask, mask, 0, h[node], motion)
    for i in range(q):  # derivatives of h by the motions
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
    take_off(tables, mode, mask, mask, 1, rate[node], motion)
    for i in range(q):
        for k in range(q):
            if is_closed(mask, i) and is_closed(mask, k):
                for j in range(d):
                    motion[2, i, j] += (
                        tables.accel[mode, i, j, k] * h[node, k]
                        + tables.accel_rate[mode, i, j, k] * rate[node, k]
                    )


@linked_sum
def take_off(
    tables: CurvedTables, mode: int, mask: int, which: int, derivative: int, h: Floats, motion: Floats
) -> None:
    """Subtract the part by h (q,), or by its rate, from the motions or rates of the pairs `which`."""
    q, n_row = h.size, tables.bound.shape[2] + derivative
    for i in range(q):
        for k in range(q):
            if is_closed(which, i) and is_closed(mask, k):
                for j in range(n_row):
                    motion[derivative, i, j] -= tables.moved[mode, i, j, k] * h[k]


@linked_sum
def fill_geometry(pairs: CurvedPairs, i: int, d: int, work: CurvedWork) -> tuple[float, float]:
    """Normal, gap Jacobian and force direction of pair i at `work.motion`; gap (m) and its curvature (m/s2).

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


@linked_sum
def slip_of(pairs: CurvedPairs, i: int, d: int, rim_speed: float, work: CurvedWork) -> float:
    """Slip speed, m/s, of pair i with its geometry filled; positive in steady sliding."""
    motion = work.motion
    turning = 0.0
    for j in range(BENDING, d):
        turning += motion[0, i, j] * motion[1, i, j]
    slide = work.normal[0, i] * motion[1, i, ACROSS] - work.normal[1, i] * (motion[1, i, ALONG] + turning)
    return float(rim_speed + pairs.sense * (pairs.radius[i] * motion[1, i, d] - slide))


@linked_sum
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
    """Forces, slips and loads of the closed pairs at a node; False where no forces are found.

    The forces keep the gaps closed: `J F N = -(J a + b)`, with J the gap Jacobian, F the directions of the
    forces, a the free accelerations and b the accelerations at constant rates.
    """
    read_motion(tables, mode, mask, mask, z_re, z_im, work.motion)
    q, d = tables.bound.shape[1], tables.bound.shape[2]
    find_heights(pairs, tables, mode, mask, node, work)
    for i in range(q):
        work.active[i] = is_closed(mask, i)
        if work.active[i]:
            _, bends = fill_geometry(pairs, i, d, work)
            for j in range(d):
                bends += work.jacobian[i, j] * work.motion[2, i, j]
            work.opening[i] = bends
            work.slip[node, i] = slip_of(pairs, i, d, rim_speed[i], work)
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
            is_finite = is_finite and np.isfinite(work.force[node, i])
            fill_loads(pairs, i, d, node, work)
    return is_finite


@linked_sum
def find_gaps(
    pairs: CurvedPairs,
    tables: CurvedTables,
    mode: int,
    mask: int,
    node: int,
    z_re: Floats,
    z_im: Floats,
    work: CurvedWork,
) -> None:
    """Gaps of the open pairs at a node and their rates; h of the closed pairs is known."""
    q, d = tables.bound.shape[1], tables.bound.shape[2]
    read_motion(tables, mode, mask, ~mask, z_re, z_im, work.motion)
    take_off(tables, mode, mask, ~mask, 0, work.h[node], work.motion)
    take_off(tables, mode, mask, ~mask, 1, work.rate[node], work.motion)
    for i in range(q):
        if not is_closed(mask, i):
            work.gap[0, node, i], _ = fill_geometry(pairs, i, d, work)
            opens = 0.0
            for j in range(d):
                opens += work.jacobian[i, j] * work.motion[1, i, j]
            work.gap[1, node, i] = opens


@linked_sum
def fill_loads(pairs: CurvedPairs, i: int, d: int, node: int, work: CurvedWork) -> None:
    """Fill the loads of pair i at a node from its geometry and force."""
    force, load, direction = work.force[node, i], work.load[node, i], work.direction[i]
    load[HEIGHT], load[HEIGHT_RATE] = work.h[node, i], work.rate[node, i]
    load[LOAD_ALONG] = force * (direction[ALONG] - 1.0)
    load[LOAD_ACROSS] = force * (direction[ACROSS] - pairs.friction[i])
    for j in range(BENDING, d):
        load[j + 2] = force * direction[j]


@linked_sum
def find_lone_forces(
    pairs: CurvedPairs, tables: CurvedTables, rim_speed: Floats, mode: int, node: int, work: CurvedWork
) -> bool:
    """`evaluate` for a single closed pair: h by Newton's method, the rest without linear systems."""
    d = tables.bound.shape[2]
    motion, rates, free = work.motion[0, 0], work.motion[1, 0], work.motion[2, 0]
    jacobian, direction, radius = work.jacobian[0], work.direction[0], pairs.radius[0]
    moved = tables.moved[mode, 0]
    h, steep = work.h[node, 0], 0.0
    for _ in range(MOST_PASSES):
        across = motion[ACROSS] + pairs.aside[0] - moved[ACROSS, 0] * h
        value = curvature(radius, across, pairs.is_round)
        steep = across / np.sqrt(radius * radius - across * across) if pairs.is_round else 0.0
        slope = -steep * moved[ACROSS, 0]
        for j in range(BENDING, d):
            at = motion[j] - moved[j, 0] * h
            value += 0.5 * at * at
            slope -= at * moved[j, 0]
        change = (value - h) / (1.0 - slope)
        h += change
        if abs(change) <= CLOSE:
            break
    follows, answers = steep * rates[ACROSS], 1.0 + steep * moved[ACROSS, 0]
    for j in range(d):
        motion[j] -= moved[j, 0] * h
        if j >= BENDING:
            follows += motion[j] * rates[j]
            answers += motion[j] * moved[j, 0]
    rate = follows / answers
    for j in range(d + 1):
        rates[j] -= moved[j, 0] * rate
    _, bends = fill_geometry(pairs, 0, d, work)
    for j in range(d):
        accel = free[j] + tables.accel[mode, 0, j, 0] * h + tables.accel_rate[mode, 0, j, 0] * rate
        bends += jacobian[j] * accel
    give = 0.0
    for a in range(d + 1):
        row = pairs.gram[0, a, 0]
        total = 0.0
        for c in range(d + 1):
            total += row[c] * direction[c]
        give += jacobian[a] * total
    force = -bends / give if give != 0.0 else np.inf
    work.h[node, 0], work.rate[node, 0], work.force[node, 0] = h, rate, force
    work.slip[node, 0] = slip_of(pairs, 0, d, rim_speed[0], work)
    fill_loads(pairs, 0, d, node, work)
    return bool(np.isfinite(force))
