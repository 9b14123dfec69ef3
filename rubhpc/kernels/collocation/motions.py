"""Motions of the pairs in a step: under the loads of the closed ones, with the pairs that may touch in it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.gaps import see_gap
from rubhpc.kernels.collocation.structures import (
    FRICTION,
    NORMAL,
    OPEN,
    STICKING,
    Bodies,
    Nodes,
    Solution,
)
from rubhpc.kernels.collocation.tables import place_row

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@linked_sum
def n_force(bodies: Bodies, state: int) -> int:
    """Unknown forces of a closed pair at a node."""
    return 1 if state != STICKING and not bodies.depends_on_slip else 2


@linked_sum
def list_closed(bodies: Bodies, nodes: Nodes, state: Ints, solution: Solution) -> tuple[int, int, int]:
    """Number of closed pairs, which are listed, and of unknown forces and of all unknowns."""
    s, n_closed, n_unknown = nodes.at.size, 0, 0
    for i in range(state.size):
        if state[i] != OPEN:
            solution.closed[n_closed] = i
            n_closed += 1
            n_unknown += s * n_force(bodies, state[i])
    n_place = 0 if bodies.is_straight else n_closed * (s - 1) * (bodies.n_local - 1)
    return n_closed, n_unknown, n_unknown + n_place


@linked_sum
def see_start(bodies: Bodies, x: Floats, solution: Solution) -> None:
    """Local motions, velocities and free accelerations at the coordinates x."""
    see_motions(bodies, x, solution.start.size, solution)


@linked_sum
def see_motions(bodies: Bodies, x: Floats, n: int, solution: Solution) -> None:
    """The first n of them."""
    start, local = solution.start, bodies.local
    for r in range(n):
        row, total = local[r], 0.0
        for k in range(x.size):
            total += row[k] * x[k]
        start[r] = total


@linked_sum
def push_closed(
    bodies: Bodies, nodes: Nodes, state: Ints, force: Floats, n_closed: int, solution: Solution
) -> None:
    """Loads at the nodes by the forces and directions there; T of steady sliding follows from N."""
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    for c in range(n_closed):
        i = solution.closed[c]
        is_bound = n_force(bodies, state[i]) == 1
        for k in range(s):
            row, first = i * s + k, k * n_row + i * n_local
            if is_bound:
                force[i, FRICTION, k] = state[i] * bodies.friction[i] * force[i, NORMAL, k]
            n, t = force[i, NORMAL, k], force[i, FRICTION, k]
            for a in range(n_local):
                solution.load[first + a] = n * solution.normal[row, a] + t * solution.tangent[row, a]


@linked_sum
def move_freely(
    bodies: Bodies,
    s: int,
    free: Floats,
    x: Floats,
    blocks: tuple[int, int],
    pairs: tuple[int, int],
    y: Floats,
    solution: Solution,
) -> None:
    """Motions y of listed pairs without loads, in blocks of y: displacements at the nodes, and so on."""
    n_local = bodies.n_local
    for p in range(pairs[0], pairs[1]):
        first = place_row(s, n_local, solution.closed[p], 1)
        for r in range(first + blocks[0] * n_local, first + blocks[1] * n_local):
            row, total = free[r], 0.0
            for k in range(x.size):
                total += row[k] * x[k]
            y[r] = total


@linked_sum
def add_response(
    bodies: Bodies,
    s: int,
    size: float,
    row: Floats,
    blocks: tuple[int, int],
    pairs: tuple[int, int],
    y: Floats,
    solution: Solution,
) -> None:
    """Add the response to a load, of a row of `Tables.forced`, to blocks of y of listed pairs."""
    n_local = bodies.n_local
    for p in range(pairs[0], pairs[1]):
        first = place_row(s, n_local, solution.closed[p], 1)
        for r in range(first + blocks[0] * n_local, first + blocks[1] * n_local):
            y[r] += size * row[r]


@linked_sum
def respond(
    bodies: Bodies,
    s: int,
    forced: Floats,
    n_closed: int,
    blocks: tuple[int, int],
    pairs: tuple[int, int],
    load: Floats,
    solution: Solution,
) -> None:
    """Motions y of listed pairs under the loads of the closed ones, in blocks of y."""
    n_local, n_row, closed, y = bodies.n_local, bodies.load.shape[0], solution.closed, solution.y
    for p in range(pairs[0], pairs[1]):
        first = place_row(s, n_local, closed[p], 1)
        for r in range(first + blocks[0] * n_local, first + blocks[1] * n_local):
            y[r] = solution.y_free[r]
    for node in range(0, load.size, n_row):
        for c in range(n_closed):
            begun = node + closed[c] * n_local
            for a in range(begun, begun + n_local):
                add_response(bodies, s, load[a], forced[a], blocks, pairs, y, solution)


@linked_sum
def see_gaps(bodies: Bodies, nodes: Nodes, n_closed: int, solution: Solution) -> None:
    """See the gaps of the closed pairs at the displacements of the nodes after the first."""
    for c in range(n_closed):
        i = solution.closed[c]
        for k in range(1, nodes.at.size):
            see_gap(bodies, i, solution.place[k], i * bodies.n_local, i * nodes.at.size + k, solution)


@linked_sum
def follow_loads(bodies: Bodies, nodes: Nodes, n_closed: int, solution: Solution) -> None:
    """Take the displacements of the closed pairs at the nodes from y."""
    s, n_local = nodes.at.size, bodies.n_local
    for c in range(n_closed):
        i = solution.closed[c]
        for k in range(1, s):
            for a in range(n_local):
                solution.place[k, i * n_local + a] = solution.y[place_row(s, n_local, i, k) + a]


@linked_sum
def list_near(
    bodies: Bodies, nodes: Nodes, step: float, x: Floats, state: Ints, n_closed: int, solution: Solution
) -> int:
    """List the open pairs that may touch within a step, after the closed ones; returns the number of all.

    Bounds of the accelerations are those of a flight, and for each load its size and how much it changes in
    the step times the sum of what the modes respond.
    """
    s, n_local, n_row, n = nodes.at.size, bodies.n_local, bodies.load.shape[0], n_closed
    if n_closed == state.size:
        return n
    size, n_complex, start, load = solution.size, bodies.n_complex, solution.start, solution.load
    for k in range(n_complex):
        size[k] = math.sqrt(x[k] * x[k] + x[n_complex + k] * x[n_complex + k])
    for k in range(n_complex, size.size):
        size[k] = abs(x[n_complex + k])
    for c in range(n_closed):
        first = solution.closed[c] * n_local
        for a in range(first, first + n_local):
            total = abs(load[a])
            for k in range(1, s):
                total += abs(load[k * n_row + a] - load[(k - 1) * n_row + a])
            solution.begun[a] = total
    for i in range(state.size):
        if state[i] != OPEN:
            continue
        first, rate, bound = i * n_local, 0.0, 0.0
        see_gap(bodies, i, start, first, i * s, solution)
        for a in range(n_local):
            slope, total = solution.normal[i * s, a], 0.0
            if slope != 0.0:
                bend, reach = bodies.bend[first + a], bodies.reach[first + a]
                for k in range(size.size):
                    total += bend[k] * size[k]
                for c in range(n_closed):
                    begun = solution.closed[c] * n_local
                    for b in range(begun, begun + n_local):
                        total += reach[b] * solution.begun[b]
                rate += slope * start[n_row + first + a]
                bound += abs(slope) * total
        least = solution.gap[i * s] + step * (min(rate, 0.0) - 0.5 * bound * step)
        if bodies.radius[i] < 0.0 or least <= 0.0:  # the gap of a bore is not convex
            solution.closed[n] = i
            n += 1
    return n
