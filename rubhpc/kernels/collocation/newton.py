"""A step of closed contacts: forces that obey the laws at the nodes (`equations`), by Newton's method."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.equations import (
    change_pair,
    change_residual,
    fill_residual,
    fill_slopes,
    see_pair,
)
from rubhpc.kernels.collocation.gaps import see_gap
from rubhpc.kernels.collocation.motions import (
    add_response,
    follow_loads,
    list_closed,
    list_near,
    move_freely,
    n_force,
    push_closed,
    respond,
    see_gaps,
    see_motions,
)
from rubhpc.kernels.collocation.structures import (
    FRICTION,
    MATRIX,
    N_NEAR,
    NORMAL,
    STICKING,
    TWIST,
    Bodies,
    Nodes,
    Solution,
    Tables,
)
from rubhpc.kernels.collocation.tables import place_row
from rubhpc.kernels.elimination import eliminate
from rubhpc.kernels.laws import LAGRANGE, PENALTY

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_ITERATIONS = 26
ROUNDING = 2e-16  # of displacements
SLOW = 0.2  # of the last change: with less progress the matrix is made anew


@linked_sum
def fill_column(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    state: Ints,
    force: Floats,
    n_closed: int,
    col: int,
    solution: Solution,
) -> None:
    """Fill a column of the matrix by the changes `change`, `moved` and `pushed` of one unknown."""
    s, n_local, row = nodes.at.size, bodies.n_local, 0
    target, change, moved = solution.residual, solution.change, solution.moved
    if bodies.is_straight:
        for c in range(n_closed):
            i = solution.closed[c]
            for k in range(1, s):
                for a in range(n_local):
                    moved[k, i * n_local + a] = change[place_row(s, n_local, i, k) + a]
    for c in range(n_closed):
        i = solution.closed[c]
        change_pair(bodies, nodes, i, 1, solution.begun, change, moved, solution)
        row = change_residual(
            bodies, nodes, tables, slot, state, force, i, solution.pushed[i], row, target, solution
        )
    for c in range(0 if bodies.is_straight else n_closed):
        i = solution.closed[c]
        for k in range(1, s):
            for a in range(n_local):
                if a != TWIST:
                    target[row] = moved[k, i * n_local + a] - change[place_row(s, n_local, i, k) + a]
                    row += 1
    for r in range(row):
        solution.rows[r, col] = target[r]


@linked_sum
def fill_matrix(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    state: Ints,
    force: Floats,
    n_closed: int,
    blocks: tuple[int, int],
    solution: Solution,
) -> bool:
    """Make the matrix of the equations, and its inverse; False where it is singular."""
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    forced, change, moved, pushed, col = (
        tables.forced[slot],
        solution.change,
        solution.moved,
        solution.pushed,
        0,
    )
    listed = (0, n_closed)
    fill_slopes(bodies, nodes, state, force, n_closed, solution)
    for r in range(solution.begun.size):
        solution.begun[r] = 0.0
    for k in range(6):
        solution.changed[0, k] = 0.0
    for k in range(s):
        for r in range(n_row):
            moved[k, r] = 0.0
    for i in range(pushed.shape[0]):
        for k in range(s):
            pushed[i, NORMAL, k], pushed[i, FRICTION, k] = 0.0, 0.0
    for c in range(n_closed):
        i = solution.closed[c]
        for f in range(n_force(bodies, state[i])):
            for k in range(s):
                for r in range(change.size):
                    change[r] = 0.0
                for a in range(n_local):
                    size, row = solution.direction[i * s + k, f, a], forced[k * n_row + i * n_local + a]
                    add_response(bodies, s, size, row, blocks, listed, change, solution)
                pushed[i, f, k] = 1.0
                fill_column(bodies, nodes, tables, slot, state, force, n_closed, col, solution)
                pushed[i, f, k] = 0.0
                col += 1
    for c in range(0 if bodies.is_straight else n_closed):
        i = solution.closed[c]
        for k in range(1, s):
            for b in range(n_local):
                if b == TWIST:
                    continue
                for r in range(change.size):
                    change[r] = 0.0
                for a in range(n_local):
                    size, row = solution.turning[i * s + k, a, b], forced[k * n_row + i * n_local + a]
                    if size != 0.0:
                        add_response(bodies, s, size, row, blocks, listed, change, solution)
                moved[k, i * n_local + b] = 1.0
                fill_column(bodies, nodes, tables, slot, state, force, n_closed, col, solution)
                moved[k, i * n_local + b] = 0.0
                col += 1
    rows, inverse = solution.rows, solution.matrix[solution.used[MATRIX]]
    for r in range(col):
        for k in range(col):
            rows[r, col + k] = 1.0 if k == r else 0.0
    is_regular = eliminate(rows[:, : 2 * col], col)
    for r in range(col):
        for k in range(col):
            inverse[k, r] = rows[r, col + k]
    return is_regular


@linked_sum
def multiply(inverse: Floats, n: int, residual: Floats, answer: Floats) -> None:
    """Fill `answer` with the product of an inverse, which is kept transposed, and the first n residuals."""
    for i in range(n):
        answer[i] = 0.0
    for j in range(n):
        size, row = residual[j], inverse[j]
        for i in range(n):
            answer[i] += size * row[i]


@linked_sum
def noise_of(
    bodies: Bodies,
    nodes: Nodes,
    state: Ints,
    n_closed: int,
    n_pushed: int,
    n: int,
    solution: Solution,
) -> float:
    """Largest force that the rounding of displacements causes, N."""
    s, residual, size, row = nodes.at.size, solution.residual, 0.0, 0
    for k in range(1, s):
        for r in range(bodies.load.shape[0]):
            size = max(size, abs(solution.place[k, r]))
    for r in range(n):
        residual[r] = 0.0
    for c in range(n_closed):
        i = solution.closed[c]
        for f in range(n_force(bodies, state[i])):
            if (f == NORMAL and bodies.normal_law[i] == LAGRANGE) or (f == FRICTION and state[i] == STICKING):
                for k in range(s):
                    residual[row + k] = ROUNDING * size * (1.0 if k % 2 == 0 else -1.0)
            row += s
    multiply(solution.matrix[solution.used[MATRIX]], n, residual, solution.answer)
    noise = 0.0
    for r in range(n_pushed):
        noise = max(noise, abs(solution.answer[r]))
    return noise


@linked_sum
def code_of(state: Ints) -> int:
    """States of the pairs as one number, not zero where a pair is closed."""
    code = 0
    for i in range(state.size):
        code = code * 7 + state[i] + 2
    return code


@linked_sum
def use_matrix(bodies: Bodies, tables: Tables, slot: int, state: Ints, solution: Solution) -> int:
    """Point at the matrix of a length of step and of states, with which it is made unless it was so before.

    Of straight gaps several are kept for each length of step: they do not change with the motion.
    """
    code = code_of(state)
    n_way = solution.states.size // tables.is_filled.size
    way = code % n_way if bodies.is_straight else 0
    used = slot * n_way + way
    if solution.states[used] != code:
        solution.states[used] = 0
    solution.used[MATRIX] = used
    return code


@linked_sum
def take_step(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    x: Floats,
    state: Ints,
    force: Floats,
    tolerance: float,
    is_whole: bool,
    is_exact: bool,
    solution: Solution,
) -> int:
    """Solve a step from the coordinates x: `force` (q, 2, s), a guess, becomes the solution.

    Returns the number of iterations, negative where they do not converge. `tolerance` is that of forces, N.
    Where it is not `is_whole`, velocities at the nodes between may be left out; where `is_exact`, the matrix
    is that at the solution, for the tangent.
    """
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    n_closed, n_pushed, n = list_closed(bodies, nodes, state, solution)
    place, residual, load, states = solution.place, solution.residual, solution.load, solution.states
    answer = solution.answer
    is_lean, is_linear = not bodies.depends_on_slip, bodies.is_straight and not bodies.depends_on_slip
    for c in range(n_closed):
        law = bodies.normal_law[solution.closed[c]]
        is_lean, is_linear = is_lean and law == LAGRANGE, is_linear and law in (LAGRANGE, PENALTY)
    n_block, free = 2 * s - 1, tables.free[slot]
    used_blocks = (0, s if is_lean else n_block)
    step, forced = tables.tick * 2.0 ** (tables.first_level + slot), tables.forced[slot]
    code = use_matrix(bodies, tables, slot, state, solution)
    used = solution.used[MATRIX]
    see_motions(bodies, x, 2 * n_row, solution)
    listed = (0, n_closed)
    move_freely(bodies, s, free, x, used_blocks, listed, solution.y_free, solution)
    for a in range(load.size):
        load[a] = 0.0
    for r in range(n_row):
        place[0, r] = solution.start[r]
    for c in range(n_closed):  # loads as at the beginning, to find the first displacements
        i = solution.closed[c]
        for k in range(s):
            see_gap(bodies, i, place[0], i * n_local, i * s + k, solution)
    push_closed(bodies, nodes, state, force, n_closed, solution)
    respond(bodies, s, forced, n_closed, used_blocks, listed, load, solution)
    follow_loads(bodies, nodes, n_closed, solution)
    last, largest, iteration, is_solved, is_fresh = np.inf, 0.0, 0, False, False
    while iteration < MOST_ITERATIONS:
        iteration += 1
        if not bodies.is_straight:
            see_gaps(bodies, nodes, n_closed, solution)
        if not bodies.is_straight or iteration > 1:
            push_closed(bodies, nodes, state, force, n_closed, solution)
            respond(bodies, s, forced, n_closed, used_blocks, listed, load, solution)
        if bodies.is_straight:
            follow_loads(bodies, nodes, n_closed, solution)
            see_gaps(bodies, nodes, n_closed, solution)
        if is_solved:
            if is_whole:
                n_near = list_near(bodies, nodes, step, x, state, n_closed, solution)
                near, rest = (0, n_near), (used_blocks[1] if n_near == n_closed else 0, n_block)
                move_freely(bodies, s, free, x, (used_blocks[1], n_block), listed, solution.y_free, solution)
                move_freely(bodies, s, free, x, (0, n_block), (n_closed, n_near), solution.y_free, solution)
                respond(bodies, s, forced, n_closed, rest, near, load, solution)
                solution.used[N_NEAR] = n_near
            for c in range(n_closed):
                see_pair(bodies, nodes, solution.closed[c], is_lean and not is_whole, solution)
            if not is_exact:
                return iteration
            if is_linear:
                fill_slopes(bodies, nodes, state, force, n_closed, solution)
                return iteration
        fill_residual(bodies, nodes, tables, slot, state, force, n_closed, is_lean, solution)
        if states[used] == 0 or is_solved:
            states[used] = 0
            if not fill_matrix(bodies, nodes, tables, slot, state, force, n_closed, used_blocks, solution):
                return -iteration
            states[used], is_fresh = code, True
            solution.noise[used] = noise_of(bodies, nodes, state, n_closed, n_pushed, n, solution)
            if is_solved:
                return iteration
            fill_residual(bodies, nodes, tables, slot, state, force, n_closed, is_lean, solution)
        multiply(solution.matrix[used], n, residual, answer)
        change, largest, row = 0.0, 0.0, 0
        for r in range(n_pushed):
            change = max(change, abs(answer[r]))
        if not change < 1e200:
            states[used] = 0
            return -iteration
        for c in range(n_closed):
            i = solution.closed[c]
            for f in range(n_force(bodies, state[i])):
                for k in range(s):
                    force[i, f, k] -= answer[row + k]
                    if f == NORMAL:
                        largest = max(largest, abs(force[i, f, k]))
                row += s
        for c in range(0 if bodies.is_straight else n_closed):
            first = solution.closed[c] * n_local
            for k in range(1, s):
                for a in range(n_local):
                    if a != TWIST:
                        place[k, first + a] -= answer[row]
                        row += 1
        floor = max(tolerance, solution.noise[used])
        if is_linear or change <= floor or (iteration > 1 and change * min(1.0, change / last) <= tolerance):
            is_solved = True
        elif iteration > 3 and change > 0.1 * last and (change < 1e-7 * largest or change < 30.0 * floor):
            is_solved = True  # rounding: no further progress
        elif iteration > 1 and change > SLOW * last and (not is_fresh or iteration > 2):
            states[used] = 0
        last, is_fresh = change, False
    states[used] = 0
    return -iteration
