"""The loads of a single pair over a step, by a Newton method in h, its rate and the force at the nodes.

The loads x at the nodes after the first are a fixed point: the motion under them has the loads g(x). All but
h and its rate are the force N times a direction u. A change of x acts through h, its rate and N. Its effect
through the directions is a hundred times smaller and is left to the next sweep. With Q the derivatives of
these three states by the loads, P the loads by a unit of each, and r = g(x) - x the residual, the next trial
is `x + r + P (I - Q P)^-1 Q r`: a system of three unknowns per node.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import add_rows
from rubhpc.kernels.curved_contact import (
    ACROSS,
    ALONG,
    BENDING,
    HEIGHT,
    HEIGHT_RATE,
    LOAD_ALONG,
    N_NODE,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
)
from rubhpc.kernels.curved_loads import LOADS, MISSED, MOVE

Floats = NDArray[np.float64]

# Rows of `CurvedWork.part`, derivatives by the motions: of the force by displacements, at given h and rate,
# and by rates; of the cosine and the sine of the normal; then products with `gram`.
FORCE, FORCE_RATE, COSINE, SINE, GIVEN, TAKEN = range(6)
N_STATE = 3  # states per node, through which loads act: h, its rate and the force
STATE_H, STATE_RATE, STATE_FORCE = range(N_STATE)


@linked_sum
def fill_slopes(pairs: CurvedPairs, tables: CurvedTables, mode: int, node: int, work: CurvedWork) -> None:
    """Derivatives of h, its rate and the force of the single pair at a node by its readings.

    They go into `work.slope`, the loads by a unit of force into `work.lever`.
    """
    d, moved = tables.bound.shape[2], tables.moved[mode, 0]
    motion, rates, free = work.motion[0, 0], work.motion[1, 0], work.motion[2, 0]
    jacobian, direction, radius = work.jacobian[0], work.direction[0], pairs.radius[0]
    force, h, rate = work.force[node, 0], work.h[node, 0], work.rate[node, 0]
    friction, part, slope = pairs.friction[0], work.part, work.slope[node - 1]
    along, aslant = work.normal[0, 0], work.normal[1, 0]
    accel, accel_rate = tables.accel[mode, 0], tables.accel_rate[mode, 0]
    back, turning, bending = 0.0, 0.0, 0.0
    for j in range(BENDING, d):
        back += 0.5 * motion[j] * motion[j]
        turning += motion[j] * rates[j]
        bending += rates[j] * rates[j]
    reach = radius + pairs.clearance[0] + motion[ALONG] + back
    across = pairs.aside[0] + motion[ACROSS]
    steep, steeper, curve = 0.0, 0.0, 0.0  # slopes of h across; 1 / distance
    if pairs.is_round:
        root = np.sqrt(radius * radius - across * across)
        steep, steeper = across / root, radius * radius / (root * root * root)
        curve = 1.0 / np.sqrt(reach * reach + across * across)
    slide = along * rates[ACROSS] - aslant * (rates[ALONG] + turning)
    # h = f(m) and its rate, at the motion m = u - moved h, where u is the reading.
    answers = 1.0 + steep * moved[ACROSS, 0]
    turned = steeper * rates[ACROSS] * moved[ACROSS, 0]
    for j in range(BENDING, d):
        answers += motion[j] * moved[j, 0]
        turned += rates[j] * moved[j, 0]
    # The normal, whose angle is that of the line of centres.
    for j in range(d):
        towards = 1.0 if j == ALONG else motion[j]
        part[COSINE, j] = aslant * aslant * curve * towards
        part[SINE, j] = -along * aslant * curve * towards
    part[COSINE, ACROSS] = -along * aslant * curve
    part[SINE, ACROSS] = along * along * curve
    # The force N = -B / (J gram F).
    give = 0.0
    for a in range(d + 1):
        given, taken = 0.0, 0.0
        for c in range(d + 1):
            given += pairs.gram[0, a, 0, c] * direction[c]
            taken += jacobian[c] * pairs.gram[0, c, 0, a]
        part[GIVEN, a], part[TAKEN, a] = given, taken
        give += jacobian[a] * given
    inverse = 1.0 / give
    by_along, by_across, by_pressing = 0.0, 0.0, 0.0  # d(B + N give) in the normal's cosine and sine
    by_h, by_rate = 0.0, 0.0
    for j in range(d):
        pull = free[j] + accel[j, 0] * h + accel_rate[j, 0] * rate + force * part[GIVEN, j]
        by_h -= jacobian[j] * accel[j, 0] * inverse
        by_rate -= jacobian[j] * accel_rate[j, 0] * inverse
        if j == ALONG:
            by_along += pull
            by_pressing += force * part[TAKEN, j]
        elif j == ACROSS:
            by_across += pull + force * part[TAKEN, j]
            by_along += friction * force * part[TAKEN, j]
        else:
            by_along += motion[j] * pull
            by_pressing += force * part[TAKEN, j] * motion[j]
    by_along += bending + by_pressing
    by_across -= friction * by_pressing
    if pairs.is_round:
        by_along += 2.0 * slide * curve * rates[ACROSS]
        by_across -= 2.0 * slide * curve * (rates[ALONG] + turning)
    for j in range(d):
        total = by_along * part[COSINE, j] + by_across * part[SINE, j]
        moving = 0.0
        if pairs.is_round:
            towards = 1.0 if j == ALONG else motion[j]
            nearer = along * towards if j != ACROSS else aslant
            total -= slide * slide * curve * curve * nearer
            moving = 2.0 * slide * curve * (along if j == ACROSS else -aslant * towards)
        if j >= BENDING:
            pull = free[j] + accel[j, 0] * h + accel_rate[j, 0] * rate + force * part[GIVEN, j]
            total += along * pull + force * direction[ALONG] * part[TAKEN, j]
            moving += 2.0 * along * rates[j]
            if pairs.is_round:
                total -= 2.0 * slide * curve * aslant * rates[j]
        part[FORCE, j], part[FORCE_RATE, j] = -total * inverse, -moving * inverse
        by_h -= part[FORCE, j] * moved[j, 0]
        by_rate -= part[FORCE_RATE, j] * moved[j, 0]
    for j in range(d):
        of_h, bent = 0.0, 0.0
        if j == ACROSS:
            of_h, bent = steep / answers, steeper * rates[ACROSS]
        elif j >= BENDING:
            of_h, bent = motion[j] / answers, rates[j]
        of_rate = (bent - turned * of_h) / answers
        slope[STATE_H, j], slope[STATE_RATE, j], slope[STATE_RATE, d + j] = of_h, of_rate, of_h
        slope[STATE_FORCE, j] = part[FORCE, j] + by_h * of_h + by_rate * of_rate
        slope[STATE_FORCE, d + j] = part[FORCE_RATE, j] + by_rate * of_h
        slope[STATE_FORCE, 2 * d + 1 + j] = -jacobian[j] * inverse
    lever = work.lever[node - 1]
    lever[0], lever[1] = direction[ALONG] - 1.0, direction[ACROSS] - friction
    for j in range(BENDING, d):
        lever[j] = direction[j]


@linked_sum
def find_system(tables: CurvedTables, mode: int, level: int, work: CurvedWork) -> bool:
    """Fill `work.answer` with Q of a step of 2^level ticks, and `work.system` with the factors of I - Q P.

    Returns False where that is singular.
    """
    n_load, n_read, answer, system = work.load.shape[2], work.slope.shape[2], work.answer, work.system
    for node in range(N_NODE - 1):
        reached = tables.reached[mode, level, node * n_read : (node + 1) * n_read]
        for state in range(N_STATE):
            row = answer[N_STATE * node + state]
            for j in range(row.size):
                row[j] = 0.0
            add_rows(reached, work.slope[node, state], row)
    for i in range(system.shape[0]):
        for node in range(N_NODE - 1):
            first, own = node * n_load, N_STATE * node
            total = 0.0
            for a in range(LOAD_ALONG, n_load):
                total += answer[i, first + a] * work.lever[node, a - LOAD_ALONG]
            system[i, own + STATE_H] = -answer[i, first + HEIGHT]
            system[i, own + STATE_RATE] = -answer[i, first + HEIGHT_RATE]
            system[i, own + STATE_FORCE] = -total
        system[i, i] += 1.0
    return factorise(system, work.order)


@linked_sum
def factorise(system: Floats, order: NDArray[np.int64]) -> bool:
    """Replace a matrix (n, n) by its factors, with row exchanges in `order`; False if it is singular."""
    n = order.size
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(system[i, k]) > abs(system[pivot, k]):
                pivot = i
        order[k] = pivot
        if not abs(system[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(n):
                system[k, j], system[pivot, j] = system[pivot, j], system[k, j]
        inverse = 1.0 / system[k, k]
        for i in range(k + 1, n):
            factor = system[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, n):
                    system[i, j] -= factor * system[k, j]
            system[i, k] = factor
    return True


@linked_sum
def solve(system: Floats, order: NDArray[np.int64], value: Floats) -> None:
    """Replace `value` (n,) by the solution with a factorised matrix."""
    n = order.size
    for k in range(n):
        if order[k] != k:
            value[k], value[order[k]] = value[order[k]], value[k]
    for k in range(n):
        total = value[k]
        for j in range(k):
            total -= system[k, j] * value[j]
        value[k] = total
    for k in range(n - 1, -1, -1):
        total = value[k]
        for j in range(k + 1, n):
            total -= system[k, j] * value[j]
        value[k] = total / system[k, k]


@linked_sum
def move_by_newton(work: CurvedWork) -> None:
    """Correct the loads by their residual and by its effect through the states."""
    n_load, point, state, n = work.load.shape[2], work.point, work.unknown, work.point.shape[1]
    for i in range(state.size):
        row, total = work.answer[i], 0.0
        for j in range(n):
            total += row[j] * point[MISSED, j]
        state[i] = total
    solve(work.system, work.order, state)
    for j in range(n):
        point[MOVE, j] = point[MISSED, j]
    for node in range(N_NODE - 1):
        first, own = node * n_load, N_STATE * node
        point[MOVE, first + HEIGHT] += state[own + STATE_H]
        point[MOVE, first + HEIGHT_RATE] += state[own + STATE_RATE]
        for a in range(LOAD_ALONG, n_load):
            point[MOVE, first + a] += work.lever[node, a - LOAD_ALONG] * state[own + STATE_FORCE]
    for j in range(n):
        point[LOADS, j] += point[MOVE, j]


@linked_sum
def take_states(work: CurvedWork) -> None:
    """Copy h, its rate and the force of the single pair at the nodes from the last correction."""
    for node in range(1, N_NODE):
        work.h[node, 0], work.rate[node, 0] = work.load[node, 0, HEIGHT], work.load[node, 0, HEIGHT_RATE]
        work.force[node, 0] += work.unknown[N_STATE * (node - 1) + STATE_FORCE]
