"""Events within a step: polynomials of the event functions, and their first root."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.flight import GAP_TOLERANCE
from rubhpc.kernels.collocation.gaps import see_gap
from rubhpc.kernels.collocation.laws import spring_end, static_friction
from rubhpc.kernels.collocation.observing import value_at
from rubhpc.kernels.collocation.structures import (
    FRICTION,
    GAP,
    N_NEAR,
    NORMAL,
    OPEN,
    RATE,
    SLIP,
    STICKING,
    Bodies,
    Nodes,
    Solution,
)
from rubhpc.kernels.collocation.tables import place_row, rate_row
from rubhpc.kernels.laws import LAGRANGE, PENALTY

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

N_LOOK = 16  # parts of a step in which a root is looked for
MOST_HALVINGS = 60
NO_ROOT = 2.0
LEAST_PART = 1e-2  # of the time to a node, of a flight that none sees
BREAKING = 0.3  # of the accuracy: friction beyond its bound, of the error of T, at which a pair breaks away
STILL = 1e-9  # m/s, slip that rounding leaves where a pair begins to slide


@linked_sum
def first_root(nodes: Nodes, values: Floats, begin: float) -> float:
    """First place in [0, 1] where the polynomial with the values (s,) falls below zero; 2 without one."""
    s, lowest = nodes.at.size, np.inf
    for k in range(s):
        coefficient = 0.0
        for j in range(s):
            coefficient += nodes.bernstein[k, j] * values[j]
        lowest = min(lowest, coefficient)
    if lowest > 0.0:
        return NO_ROOT
    before = values[0] if begin == 0.0 else value_at(nodes, values, begin)
    for k in range(1, N_LOOK + 1):
        end = k / N_LOOK
        if end <= begin:
            continue
        after = value_at(nodes, values, end) if k < N_LOOK else values[s - 1]
        if after < 0.0:
            if before <= 0.0:
                return end if k > 1 else 0.0
            return root_between(nodes, values, begin, before, end, after)
        before, begin = after, end
    return NO_ROOT


@linked_sum
def root_between(
    nodes: Nodes, values: Floats, begin: float, before: float, end: float, after: float
) -> float:
    """Root between a place with a positive value and one with a negative value (Illinois' method)."""
    middle = end
    for _ in range(MOST_HALVINGS):
        middle = end - after * (end - begin) / (after - before)
        now = value_at(nodes, values, middle)
        if now < 0.0:
            end, after = middle, now
            before *= 0.5
        else:
            begin, before = middle, now
            after *= 0.5
        if end - begin < 1e-14 or now == 0.0:
            break
    return middle


@linked_sum
def is_near(i: int, solution: Solution) -> bool:
    """Whether a pair is closed or may touch in the step that was solved last."""
    is_listed = False
    for p in range(solution.used[N_NEAR]):
        is_listed = is_listed or solution.closed[p] == i
    return is_listed


@linked_sum
def fill_events(
    bodies: Bodies, nodes: Nodes, state: Ints, force: Floats, accuracy: float, solution: Solution
) -> None:
    """Fill the event functions (q, 2, s) at the nodes, positive while a pair keeps its state; 1: unused."""
    s, n_local, n_row, event = nodes.at.size, bodies.n_local, bodies.load.shape[0], solution.event
    for i in range(state.size):
        first = i * n_local
        for k in range(s):
            row = i * s + k
            event[i, NORMAL, k], event[i, FRICTION, k] = 1.0, 1.0
            if state[i] == OPEN:
                if not is_near(i, solution):
                    continue
                at, v = (solution.start, first) if k == 0 else (solution.y, place_row(s, n_local, i, k))
                see_gap(bodies, i, at, v, row, solution)
                v = n_row + first if k == 0 else rate_row(s, n_local, i, k)
                rate = 0.0
                for a in range(n_local):
                    rate += solution.normal[row, a] * at[v + a]
                solution.seen[row, GAP], solution.seen[row, RATE] = solution.gap[row], rate
                event[i, NORMAL, k] = solution.gap[row]
                if bodies.normal_law[i] == PENALTY:
                    event[i, NORMAL, k] += bodies.damping[i] / bodies.stiffness[i] * max(rate, 0.0)
                continue
            if bodies.normal_law[i] == LAGRANGE:
                event[i, NORMAL, k] = force[i, NORMAL, k]
            else:
                event[i, NORMAL, k] = spring_end(bodies, i, solution.seen[row, GAP], solution.seen[row, RATE])
            if not bodies.may_stick:
                continue
            if state[i] == STICKING:  # breaks away beyond the error of T: else stick and slip would alternate
                bound = (1.0 + BREAKING * accuracy) * static_friction(bodies, i) * force[i, NORMAL, k]
                event[i, FRICTION, k] = bound - abs(force[i, FRICTION, k])
            else:
                event[i, FRICTION, k] = state[i] * solution.seen[row, SLIP] + STILL


@linked_sum
def return_place(parts: float, comes: float, sunk: float) -> float:
    """Place in [0, 1] where a gap is back where it was, by its rates (m/s) at both ends and their mean.

    Of a cubic: a parabola comes back late where the acceleration fades, and rebounds would not shrink.
    """
    if parts <= 0.0:
        return 0.0
    bend, twist = 3.0 * (sunk - parts) - (comes - parts), (comes - parts) - 2.0 * (sunk - parts)
    return float(2.0 * parts / (math.sqrt(bend * bend - 4.0 * twist * parts) - bend))


@linked_sum
def first_event(
    bodies: Bodies, nodes: Nodes, step: float, state: Ints, solution: Solution
) -> tuple[float, int, int]:
    """Place of the first event in a step, its pair and its kind, NORMAL or FRICTION; place 2 without one."""
    s, event = nodes.at.size, solution.event
    place, pair, kind = NO_ROOT, -1, NORMAL
    for i in range(state.size):
        values, begin = event[i, NORMAL], 0.0
        least = values[0] - GAP_TOLERANCE  # lower, a gap has closed; so it does not where rounding opens it
        is_opening = solution.seen[i * s, RATE] > 0.0 or values[1] > least
        if state[i] == OPEN and values[0] <= 0.0 and is_opening:
            # Closed within tolerance, and opening: no event before it has opened, or comes back.
            k = 1
            while k < s and values[k] <= 0.0 and (solution.seen[i * s + k, RATE] >= 0.0 or values[k] > least):
                k += 1
            if k == s:
                continue
            begin = nodes.at[k]
            if values[k] <= 0.0:  # it has opened and come back before the node
                sunk = (values[k] - values[0]) / (begin * step)
                back = return_place(solution.seen[i * s, RATE], solution.seen[i * s + k, RATE], sunk)
                root = begin * max(LEAST_PART, back)
                if root < place:
                    place, pair, kind = root, i, NORMAL
                continue
        for f in range(2):
            if f == FRICTION and (state[i] == OPEN or not bodies.may_stick):
                continue
            root = first_root(nodes, event[i, f], begin if f == NORMAL else 0.0)
            if f == NORMAL and state[i] != OPEN and root == 0.0 and values[1] > 0.0 and values[s - 1] > 0.0:
                continue  # rounding where it has just closed
            if root < place:
                place, pair, kind = root, i, f
    return place, pair, kind
