"""Derivatives of h, its rate and the force of several closed pairs by the coordinates, for `curved_joint`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import add_rows
from rubhpc.kernels.curved_contact import (
    ACROSS,
    ALONG,
    BENDING,
    LOAD_ALONG,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)
from rubhpc.kernels.curved_newton import (
    N_STATE,
    STATE_FORCE,
    STATE_H,
    STATE_RATE,
    factorise,
    solve,
)

Floats = NDArray[np.float64]

# Rows of `CurvedWork.balance`: accelerations under the forces; derivatives of the force balance by rates and
# by free accelerations; response of the gap to a unit force on each motion.
PULL, MOVING, PRESSING, GIVEN = range(4)


@linked_sum
def fill_answers(
    pairs: CurvedPairs, tables: CurvedTables, mode: int, mask: int, node: int, work: CurvedWork
) -> bool:
    """Derivatives of the states at a node by the coordinates, and effects of a unit of force.

    Into `work.follow` and `work.push`. The motions are `m = u - E h`, where u is read from the coordinates.
    With s the derivatives of h by them and t those of its rate, `(1 + s E) dh = s du` and
    `(1 + s E) dh' = s du' + t (du - E dh)`; the forces obey
    `J gram F dN = -(dJ (a + gram F N) + J da + db + J gram dF N)`. Returns False where one of the two systems
    is singular.
    """
    q, d = tables.bound.shape[1], tables.bound.shape[2]
    moved, accel, accel_rate = tables.moved[mode], tables.accel[mode], tables.accel_rate[mode]
    moving, pressing = work.balance[MOVING, :d], work.balance[PRESSING, :d]
    read_re, read_im, follow = tables.read_re[mode], tables.read_im[mode], work.follow[node - 1]
    for i in range(q):
        if is_closed(mask, i):
            fill_gradients(pairs, i, d, work)
    for i in range(q):
        if is_closed(mask, i):
            for k in range(q):
                if is_closed(mask, k):
                    total = 1.0 if i == k else 0.0
                    for j in range(ACROSS, d):
                        total += work.steep[i, j] * moved[i, j, k]
                    work.mutual[i, k] = total
    if not invert(mask, work.mutual, work):
        return False
    for i in range(q):
        if is_closed(mask, i):
            for part in range(2):
                read, right = read_re[i] if part == 0 else read_im[i], work.right[i, part]
                right[:] = 0.0
                add_rows(read[:d], work.steep[i], right)
    combine(mask, STATE_H, follow, work)
    for i in range(q):
        if is_closed(mask, i):
            for part in range(2):
                read, right = read_re[i] if part == 0 else read_im[i], work.right[i, part]
                right[:] = 0.0
                add_rows(read[:d], work.steeper[i], right)
                add_rows(read[d : 2 * d], work.steep[i], right)
                c = 0
                for k in range(q):
                    if is_closed(mask, k):
                        total = 0.0
                        for j in range(ACROSS, d):
                            total -= work.steeper[i, j] * moved[i, j, k]
                        add_multiple(total, follow[N_STATE * c + STATE_H, part], right)
                        c += 1
    combine(mask, STATE_RATE, follow, work)
    for i in range(q):
        if is_closed(mask, i):
            for k in range(q):
                if is_closed(mask, k):
                    total = 0.0
                    for a in range(d):
                        for b in range(d + 1):
                            total += work.jacobian[i, a] * pairs.gram[i, a, k, b] * work.direction[k, b]
                    work.mutual[i, k] = total
    if not invert(mask, work.mutual, work):
        return False
    for i in range(q):
        if is_closed(mask, i):
            fill_force_gradient(pairs, i, mask, d, node, work)
            for part in range(2):
                read, right = read_re if part == 0 else read_im, work.right[i, part]
                right[:] = 0.0
                for k in range(q):
                    if is_closed(mask, k):
                        add_rows(read[k, :d], work.bending[k], right)
                add_rows(read[i, d : 2 * d], moving, right)
                add_rows(read[i, 2 * d + 1 : 3 * d + 1], pressing, right)
                c = 0
                for k in range(q):
                    if is_closed(mask, k):
                        by_h, by_rate = 0.0, 0.0
                        for j in range(d):
                            by_h += pressing[j] * accel[i, j, k]
                            by_rate += pressing[j] * accel_rate[i, j, k]
                            by_rate -= moving[j] * moved[i, j, k]
                            for other in range(q):
                                if is_closed(mask, other):
                                    by_h -= work.bending[other, j] * moved[other, j, k]
                        add_multiple(by_h, follow[N_STATE * c + STATE_H, part], right)
                        add_multiple(by_rate, follow[N_STATE * c + STATE_RATE, part], right)
                        c += 1
    combine(mask, STATE_FORCE, follow, work)
    c = 0
    for i in range(q):
        if is_closed(mask, i):
            lever = work.levers[node - 1, c]
            lever[0] = work.direction[i, ALONG] - 1.0
            lever[1] = work.direction[i, ACROSS] - pairs.friction[i]
            for j in range(BENDING, d):
                lever[j] = work.direction[i, j]
            push = work.push[node - 1, c]
            push[:] = 0.0
            add_rows(tables.load_re[mode, i, LOAD_ALONG:], lever, push[0])
            add_rows(tables.load_im[mode, i, LOAD_ALONG:], lever, push[1])
            c += 1
    return True


@linked_sum
def add_multiple(factor: float, row: Floats, target: Floats) -> None:
    """Add a row, times a factor, to the target."""
    for k in range(target.size):
        target[k] += factor * row[k]


@linked_sum
def invert(mask: int, matrix: Floats, work: CurvedWork) -> bool:
    """Fill `work.inverse` with the inverse for the closed pairs (q, q); False where it is singular."""
    q, n = matrix.shape[0], 0
    for i in range(q):
        if is_closed(mask, i):
            c = 0
            for k in range(q):
                if is_closed(mask, k):
                    work.elimination[n, c] = matrix[i, k]
                    c += 1
            n += 1
    if not factorise(work.elimination, work.exchanged[:n]):
        return False
    for c in range(n):
        for k in range(n):
            work.unknown[k] = 1.0 if k == c else 0.0
        solve(work.elimination, work.exchanged[:n], work.unknown[:n])
        for k in range(n):
            work.inverse[k, c] = work.unknown[k]
    return True


@linked_sum
def combine(mask: int, state: int, follow: Floats, work: CurvedWork) -> None:
    """Rows of a state of all closed pairs: the inverse times `work.right`."""
    q, n = work.right.shape[0], 0
    for i in range(q):
        if is_closed(mask, i):
            target, c = follow[N_STATE * n + state], 0
            target[:] = 0.0
            for k in range(q):
                if is_closed(mask, k):
                    for part in range(2):
                        add_multiple(work.inverse[n, c], work.right[k, part], target[part])
                    c += 1
            n += 1


@linked_sum
def fill_gradients(pairs: CurvedPairs, i: int, d: int, work: CurvedWork) -> None:
    """Derivatives of h of pair i, of its rate (at given rates) and of its normal's angle by the motions."""
    motion, rates, radius = work.motion[0, i], work.motion[1, i], pairs.radius[i]
    across, back = pairs.aside[i] + motion[ACROSS], 0.0
    steep, steeper = work.steep[i], work.steeper[i]
    steep[ALONG], steep[ACROSS], steeper[ALONG], steeper[ACROSS] = 0.0, 0.0, 0.0, 0.0
    for j in range(BENDING, d):
        back += 0.5 * motion[j] * motion[j]
        steep[j], steeper[j] = motion[j], rates[j]
    turn = work.turn[i]
    turn[:] = 0.0
    if pairs.is_round:
        root = np.sqrt(radius * radius - across * across)
        steep[ACROSS] = across / root
        steeper[ACROSS] = radius * radius / (root * root * root) * rates[ACROSS]
        reach = radius + pairs.clearance[i] + motion[ALONG] + back
        near = 1.0 / np.sqrt(reach * reach + across * across)
        along, aslant = work.normal[0, i], work.normal[1, i]
        turn[ALONG], turn[ACROSS] = -aslant * near, along * near
        for j in range(BENDING, d):
            turn[j] = -aslant * near * motion[j]


@linked_sum
def fill_force_gradient(pairs: CurvedPairs, i: int, mask: int, d: int, node: int, work: CurvedWork) -> None:
    """Derivatives of the force balance of pair i by motions, `work.bending`, rates and free accelerations.

    Those by rates and accelerations are rows of `work.balance`; signs are those of the right-hand side.
    """
    q, motion, rates = work.h.shape[1], work.motion[0, i], work.motion[1, i]
    along, aslant = work.normal[0, i], work.normal[1, i]
    across, back, square, turning = pairs.aside[i] + motion[ACROSS], 0.0, 0.0, 0.0
    for j in range(BENDING, d):
        back += 0.5 * motion[j] * motion[j]
        square += rates[j] * rates[j]
        turning += motion[j] * rates[j]
    reach = pairs.radius[i] + pairs.clearance[i] + motion[ALONG] + back
    near = 1.0 / np.sqrt(reach * reach + across * across) if pairs.is_round else 0.0
    slide = along * rates[ACROSS] - aslant * (rates[ALONG] + turning)
    balance = work.balance
    pull, moving, pressing, given = balance[PULL], balance[MOVING], balance[PRESSING], balance[GIVEN]
    for a in range(d):
        pull[a] = work.motion[2, i, a]
        pressing[a], moving[a] = -work.jacobian[i, a], 0.0
    for k in range(q):
        if is_closed(mask, k):
            force, direction, bent = work.force[node, k], work.direction[k], work.bending[k]
            for b in range(d + 1):
                given[b] = 0.0
            for a in range(d):
                for b in range(d + 1):
                    one = pairs.gram[i, a, k, b]
                    pull[a] += one * direction[b] * force
                    given[b] += work.jacobian[i, a] * one
            by_turn = direction[ALONG] * given[ACROSS] - direction[ACROSS] * given[ALONG]
            for j in range(BENDING, d):
                by_turn -= direction[ACROSS] * work.motion[0, k, j] * given[j]
            for j in range(d):
                bent[j] = -force * by_turn * work.turn[k, j]
            for j in range(BENDING, d):
                bent[j] -= force * direction[ALONG] * given[j]
    by_turn = along * pull[ACROSS] - aslant * (pull[ALONG] + square)
    for j in range(BENDING, d):
        by_turn -= aslant * motion[j] * pull[j]
    by_turn -= 2.0 * slide * near * (aslant * rates[ACROSS] + along * (rates[ALONG] + turning))
    own = work.bending[i]
    for j in range(d):
        towards = aslant if j == ACROSS else along
        own[j] -= by_turn * work.turn[i, j]
        if j < BENDING:
            own[j] += slide * slide * near * near * towards
        else:
            own[j] -= along * pull[j] - 2.0 * slide * near * aslant * rates[j]
            own[j] += slide * slide * near * near * towards * motion[j]
            moving[j] = -2.0 * along * rates[j] + 2.0 * slide * near * aslant * motion[j]
    moving[ALONG], moving[ACROSS] = 2.0 * slide * near * aslant, -2.0 * slide * near * along
