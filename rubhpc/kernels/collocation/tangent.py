"""The tangent of a motion: how small changes of the coordinates go on through flights, steps and events.

Columns (nx, k) are changes of the coordinates. In a step they follow from its equations, linearised where
they are solved. An event comes earlier or later where the state changes: with the rates f of the coordinates
before it, and the impulse P of the state at the event,

    dx+ = dx + f- dt + dP(dq + q' dt),    dt = -de / e',

where e is the event function. From there on the column is of a motion that is late by dt. The motion is made
up for with the rates at the next event, -f dt, not with those after this one: a step does not follow at once
the fast modes that the forces of a touch set going, and the rates after it are none of its own.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.collocation.equations import change_pair, change_residual
from rubhpc.kernels.collocation.gaps import see_bend
from rubhpc.kernels.collocation.impacts import find_forces, find_impulses, push_instant, see_rates
from rubhpc.kernels.collocation.laws import static_friction
from rubhpc.kernels.collocation.motions import add_response, list_closed, move_freely, n_force, see_start
from rubhpc.kernels.collocation.newton import multiply
from rubhpc.kernels.collocation.observing import N_LOOK, value_at
from rubhpc.kernels.collocation.structures import (
    FRICTION,
    MATRIX,
    NORMAL,
    OPEN,
    TWIST,
    Bodies,
    Nodes,
    Solution,
    Tables,
)
from rubhpc.kernels.collocation.tables import end_of_step, place_row, row_of, within_step

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

DIFFERENCE = 1e-6  # of the size of a local motion: difference for the derivative of impulses
N_EVENT, FULL = range(2)  # items of `count`
PAIR, KIND, BEFORE, AFTER = range(4)  # columns of `event`
HIGH, LOW = range(2)  # rows of `swing`


class Trail(Struct):
    """Tangent and events of a motion, filled in as it goes on; k events fit."""

    columns: Floats  # (nx, c), changes of the coordinates
    delay: Floats  # (c,), s, by which the motion of a column is late
    event: Ints  # (k, 4), pair, kind (NORMAL or FRICTION), its state before and after
    tick: Ints  # (k,)
    approach: (
        Floats  # (k + 1,), rate at which the gap of a pair closes, m/s; NaN of other events; last: work space
    )
    count: Ints  # (2,), number of events, and 1 where there was no room for another
    least: Floats  # (2, q), smallest gap, m, and force, N, where they turn between events
    swing: Floats  # (2, q), largest force since it turned or began, and smallest since then, N
    before: Floats  # (nx,), coordinates before an event
    state: Ints  # (q,), states before it
    column: Floats  # (nx,), work space
    after: Floats  # (nx,)
    load: Floats  # (s R,)
    rates: Floats  # (nx,), of the coordinates before an event
    kick: (
        Floats  # (2 R, nx), change of the coordinates by impulses that change with a local motion or velocity
    )


@linked_sum
def carry_freely(n_complex: int, turn: Complexes, trail: Trail) -> None:
    """Carry the columns through a flight with the factors `turn` (nm,)."""
    columns = trail.columns
    for c in range(columns.shape[1]):
        for k in range(n_complex):
            a, b, re, im = columns[k, c], columns[n_complex + k, c], turn[k].real, turn[k].imag
            columns[k, c], columns[n_complex + k, c] = re * a - im * b, re * b + im * a
        for k in range(n_complex, turn.size):
            columns[n_complex + k, c] *= turn[k].real


@linked_sum
def carry_step(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    taken: float,
    state: Ints,
    force: Floats,
    solution: Solution,
    trail: Trail,
) -> None:
    """Carry the columns through a part of a step whose matrix is that at its solution."""
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    has_place = not bodies.is_straight
    n_closed, _, n = list_closed(bodies, nodes, state, solution)
    step, n_x = tables.tick * 2.0 ** (tables.first_level + slot), trail.column.size
    blocks, listed = (0, 2 * s - 1), (0, n_closed)
    change, moved, begun, pushed = solution.change, solution.moved, solution.begun, solution.pushed
    column, load, target, answer = trail.column, trail.load, solution.residual, solution.answer
    forced, free, local = tables.forced[slot], tables.free[slot], bodies.local
    for i in range(pushed.shape[0]):
        for k in range(s):
            pushed[i, NORMAL, k], pushed[i, FRICTION, k] = 0.0, 0.0
    for c in range(trail.columns.shape[1]):
        for k in range(n_x):
            column[k] = trail.columns[k, c]
        for r in range(2 * n_row):
            total = 0.0
            for k in range(n_x):
                total += local[r, k] * column[k]
            begun[r] = total
        move_freely(bodies, s, free, column, blocks, listed, change, solution)
        for k in range(s):
            for r in range(n_row):
                moved[k, r] = 0.0
                if k == 0:
                    moved[k, r] = begun[r]
                elif not has_place:
                    moved[k, r] = change[row_of(s, n_local, r, 0, k)]
        for r in range(load.size):
            load[r] = 0.0
        for p in range(n_closed):  # loads turn with the motion at the first node
            i = solution.closed[p]
            first = i * n_local
            for a in range(n_local if has_place else 0):
                total = 0.0
                for b in range(n_local):
                    total += solution.turning[i * s, a, b] * begun[first + b]
                load[first + a] = total
                add_response(bodies, s, total, forced[first + a], blocks, listed, change, solution)
        row = 0
        for p in range(n_closed):
            i = solution.closed[p]
            change_pair(bodies, nodes, i, 0, begun, change, moved, solution)
            row = change_residual(
                bodies, nodes, tables, slot, state, force, i, pushed[i], row, target, solution
            )
        for p in range(n_closed if has_place else 0):
            for k in range(1, s):
                first = place_row(s, n_local, solution.closed[p], k)
                for a in range(n_local):
                    if a != TWIST:
                        target[row] = -change[first + a]
                        row += 1
        multiply(solution.matrix[solution.used[MATRIX]], n, target, answer)
        row = 0
        for p in range(n_closed):
            i = solution.closed[p]
            for f in range(n_force(bodies, state[i])):
                for k in range(s):
                    for a in range(n_local):
                        at = k * n_row + i * n_local + a
                        load[at] -= solution.direction[i * s + k, f, a] * answer[row]
                    row += 1
        for p in range(n_closed if has_place else 0):
            i = solution.closed[p]
            for k in range(1, s):
                for b in range(n_local):
                    if b == TWIST:
                        continue
                    for a in range(n_local):
                        at = k * n_row + i * n_local + a
                        load[at] -= solution.turning[i * s + k, a, b] * answer[row]
                    row += 1
        if taken == 1.0:
            end_of_step(bodies, tables, slot, column, load, trail.after)
        else:
            within_step(bodies, nodes, step, taken, column, load, solution.turn, trail.after)
        for k in range(n_x):
            trail.columns[k, c] = trail.after[k]


@linked_sum
def rates_of(bodies: Bodies, s: int, x: Floats, state: Ints, solution: Solution, rates: Floats) -> bool:
    """Fill the rates of the coordinates at an instant, with the forces that keep contacts closed."""
    n = bodies.n_complex
    see_start(bodies, x, solution)
    if not find_forces(bodies, s, state, solution, solution.instant):
        return False
    for k in range(bodies.exponent.size):
        re, im = bodies.exponent[k].real, bodies.exponent[k].imag
        if k < n:
            rates[k] = re * x[k] - im * x[n + k]
            rates[n + k] = re * x[n + k] + im * x[k]
        else:
            rates[n + k] = re * x[n + k]
    push_instant(bodies, s, solution.instant, solution, rates)
    return True


@linked_sum
def carry_event(
    bodies: Bodies,
    s: int,
    pair: int,
    kind: int,
    least: float,
    has_impulses: bool,
    solution: Solution,
    trail: Trail,
) -> bool:
    """Carry the columns across an event of a pair at `trail.before`; False where no forces obey the laws."""
    n_local, n_row, n_x = bodies.n_local, bodies.load.shape[0], trail.column.size
    if not make_up(bodies, s, trail.before, trail.state, solution, trail):
        return False
    start, first, row, begun = solution.start, pair * n_local, pair * s, solution.begun
    for r in range(n_row):  # velocities and accelerations of the local motions, before the event
        begun[r], total = start[n_row + r], start[2 * n_row + r]
        for i in range(trail.state.size):
            if trail.state[i] != OPEN:
                n, t = solution.instant[i, NORMAL], solution.instant[i, FRICTION]
                for a in range(n_local):
                    load = n * solution.normal[i * s, a] + t * solution.tangent[i * s, a]
                    total += bodies.compliance[r, i * n_local + a] * load
        begun[n_row + r] = total
    see_rates(bodies, s, pair, solution)
    see_bend(bodies, row, solution)
    slope = solution.moved[0]
    rate_slope = solution.moved[1]
    for r in range(n_row):
        slope[r], rate_slope[r] = 0.0, 0.0
    for a in range(n_local):
        if kind == NORMAL:
            slope[first + a] = solution.normal[row, a]
        else:
            rate_slope[first + a] = -solution.tangent[row, a]
            for b in range(n_local):
                slope[first + a] -= start[n_row + first + b] * solution.tangent_bend[b, a]
    passing = 0.0
    for r in range(n_row):
        passing += slope[r] * begun[r] + rate_slope[r] * begun[n_row + r]
    if has_impulses:
        fill_kicks(bodies, s, least, solution, trail)
    for c in range(trail.columns.shape[1]):
        for k in range(n_x):
            trail.column[k] = trail.columns[k, c]
        delay = 0.0
        for r in range(2 * n_row):
            weight = slope[r] if r < n_row else rate_slope[r - n_row]
            if weight != 0.0:
                for k in range(n_x):
                    delay -= weight * bodies.local[r, k] * trail.column[k] / passing
        shift_column(delay, c, trail)
        if has_impulses:
            for r in range(2 * n_row):
                total = begun[r] * delay
                for k in range(n_x):
                    total += bodies.local[r, k] * trail.column[k]
                for k in range(n_x):
                    trail.columns[k, c] += trail.kick[r, k] * total
    return True


@linked_sum
def shift_column(delay: float, c: int, trail: Trail) -> None:
    """Let the motion of a column without delay go on by `delay` (s, for a unit column)."""
    trail.delay[c] = delay
    for k in range(trail.column.size):
        trail.columns[k, c] += trail.rates[k] * delay


@linked_sum
def make_up(bodies: Bodies, s: int, x: Floats, state: Ints, solution: Solution, trail: Trail) -> bool:
    """Make up for the delays of the columns at the coordinates x; False where no forces obey the laws."""
    if not rates_of(bodies, s, x, state, solution, trail.rates):
        return False
    for c in range(trail.delay.size):
        shift_column(-trail.delay[c], c, trail)
        trail.delay[c] = 0.0
    return True


@linked_sum
def carry_breakaway(bodies: Bodies, s: int, pair: int, solution: Solution, trail: Trail) -> bool:
    """Carry the columns across the breakaway of a sticking pair, whose friction falls to that of sliding."""
    if not make_up(bodies, s, trail.before, trail.state, solution, trail):
        return False
    n_x, size, pace = trail.column.size, 0.0, 0.0
    for k in range(n_x):
        trail.column[k] = trail.rates[k]
        size, pace = max(size, abs(trail.before[k])), max(pace, abs(trail.rates[k]))
    passing = margin_change(bodies, s, pair, DIFFERENCE * size / pace, solution, trail)
    for c in range(trail.columns.shape[1]):
        largest = 0.0
        for k in range(n_x):
            trail.column[k] = trail.columns[k, c]
            largest = max(largest, abs(trail.column[k]))
        if largest > 0.0 and passing != 0.0:
            change = margin_change(bodies, s, pair, DIFFERENCE * size / largest, solution, trail)
            shift_column(-change / passing, c, trail)
    return True


@linked_sum
def margin_change(bodies: Bodies, s: int, pair: int, size: float, solution: Solution, trail: Trail) -> float:
    """Change of the friction that a sticking pair has left, for a unit of `trail.column`, by differences."""
    change = 0.0
    for sense in (-1.0, 1.0):
        for k in range(trail.column.size):
            trail.after[k] = trail.before[k] + sense * size * trail.column[k]
        see_start(bodies, trail.after, solution)
        if find_forces(bodies, s, trail.state, solution, solution.instant):
            bound = static_friction(bodies, pair) * solution.instant[pair, NORMAL]
            change += sense * (bound - abs(solution.instant[pair, FRICTION])) / (2.0 * size)
    return change


@linked_sum
def fill_kicks(bodies: Bodies, s: int, least: float, solution: Solution, trail: Trail) -> None:
    """Fill `trail.kick` by differences of the impulses in the local motions and velocities `start`."""
    n_local, n_row, start, kick = bodies.n_local, bodies.load.shape[0], solution.start, trail.kick
    fastest = 1e-30
    for r in range(n_row):
        fastest = max(fastest, abs(start[n_row + r]))
    for r in range(2 * n_row):
        for k in range(kick.shape[1]):
            kick[r, k] = 0.0
        i, a = (r % n_row) // n_local, r % n_local
        if not solution.touching[i]:
            continue
        size = DIFFERENCE * (abs(bodies.radius[i]) if r < n_row else fastest)
        if r < n_row and a > TWIST:
            size = DIFFERENCE * math.sqrt(abs(bodies.radius[i]))
        held = start[r]
        for sense in (-1.0, 1.0):
            start[r] = held + sense * size
            find_impulses(bodies, s, solution.touching, solution.kept, solution.bound, least, solution)
            for k in range(trail.after.size):
                trail.after[k] = 0.0
            push_instant(bodies, s, solution.impulse, solution, trail.after)
            for k in range(trail.after.size):
                kick[r, k] += sense * trail.after[k] / (2.0 * size)
        start[r] = held


@linked_sum
def note_least(nodes: Nodes, taken: float, seen: float, state: Ints, force: Floats, trail: Trail) -> None:
    """Note forces that turn, where they are smallest, in the part of a step that is taken.

    A force turns where it has fallen and risen by more than is `seen`, N: less may be its error.
    """
    look, swing = taken / N_LOOK, trail.swing
    for i in range(state.size):
        if state[i] == OPEN:
            continue
        before = now = force[i, NORMAL, 0]
        for k in range(N_LOOK + 1):
            behind = value_at(nodes, force[i, NORMAL], min(k + 1, N_LOOK) * look)
            bend, value = before - 2.0 * now + behind, now
            if now < before and now < behind:
                value -= 0.125 * (behind - before) ** 2 / bend
            if value >= swing[HIGH, i]:
                swing[HIGH, i] = swing[LOW, i] = value
            elif value < swing[LOW, i]:
                swing[LOW, i] = value
            elif min(value, swing[HIGH, i]) > swing[LOW, i] + seen:
                trail.least[1, i] = min(trail.least[1, i], swing[LOW, i])
                swing[HIGH, i] = swing[LOW, i] = value
            before, now = now, behind


@linked_sum
def note_event(
    pair: int, kind: int, before: int, after: int, tick: int, approach: float, trail: Trail
) -> None:
    """Note an event, unless there is no room; a force that begins has not turned yet."""
    if before == OPEN:
        trail.swing[HIGH, pair] = -np.inf
    if trail.tick.size == 0:
        return  # none is asked for
    k = trail.count[N_EVENT]
    if k == trail.tick.size:
        trail.count[FULL] = 1
        return
    trail.event[k, PAIR], trail.event[k, KIND] = pair, kind
    trail.event[k, BEFORE], trail.event[k, AFTER] = before, after
    trail.tick[k], trail.approach[k] = tick, approach
    trail.count[N_EVENT] = k + 1
