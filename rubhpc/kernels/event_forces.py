"""Forces and impulses of an event under set-valued friction, pairs rigid or with a penalty.

Most events go as expected: pairs that are closed stay so, and slide or stick as before. The forces of these
states solve a linear system; where they obey the laws, all is found. Otherwise Lemke's method finds forces,
in some five pivots of a larger tableau, or finds that there are none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.complementarity import UNSOLVED, solve_rows
from rubhpc.kernels.contact_pairs import Workspace  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.coulomb_friction import ROUNDING, UNNOTICED, solve_cones
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies, state_of
from rubhpc.kernels.trail import Trail, no_trail

Floats = NDArray[np.float64]

CLEARLY = 1e-9  # share by which expected forces are to be within the laws


class FrictionWork(Struct):
    """Work space of an event, q pairs."""

    solver: Workspace  # compliances are those of velocities, 1/kg
    rate: Floats  # (q,), of gaps, m/s
    slip: Floats  # (q,), m/s
    drawn: Floats  # (2 q,), how rates of gaps, then of slips change with the motion, `pull` times it, m/s2
    given: Floats  # (2, q), normal impulses of the event and tractions, N s
    free_until: NDArray[
        np.int64
    ]  # (2, 2 q), what is known of the switch functions: `event_bounds.free_until`
    impulse: Floats  # (q,), accumulated before the event, N s
    rest_speed: Floats  # (2 q,), rates of the gaps, then slips, m/s
    is_at_rest: NDArray[np.bool_]  # (2 q,)
    held: NDArray[np.int64]  # (2 q,), places of those at rest
    elimination: Floats  # (2 q, 2 q + 1)
    trail: Trail  # of the motion


def friction_work(solver: Workspace, q: int) -> FrictionWork:
    """Work space of the events of q pairs, with that of their laws, without a trail."""
    return FrictionWork(
        solver=solver,
        rate=np.zeros(q),
        slip=np.zeros(q),
        drawn=np.zeros(2 * q),
        given=np.zeros((2, q)),
        free_until=np.zeros((2, 2 * q), dtype=np.int64),
        impulse=np.zeros(q),
        rest_speed=np.zeros(2 * q),
        is_at_rest=np.zeros(2 * q, dtype=np.bool_),
        held=np.zeros(2 * q, dtype=np.int64),
        elimination=np.zeros((2 * q, 2 * q + 1)),
        trail=no_trail(),
    )


@linked
def solve_event(bodies: FrictionBodies, work: FrictionWork, feeds_none: bool) -> int:
    """Forces or impulses that obey the laws with `solver.gap` and `slip`; pivots taken, or UNSOLVED.

    A pair that sticks holds up to the coefficient of rest; once that is passed it slides. With `feeds_none`,
    a pair whose friction would feed energy in, because its slip turns round, has none.
    """
    solver = work.solver
    q = solver.force.size
    for i in range(q):
        solver.cone[i] = bodies.static[i] if solver.is_sticking[i] else bodies.sliding[i]
    pivots = 0
    for _ in range(2 * q + 1):
        taken = solve_cones(solver)
        if taken == UNSOLVED:
            return UNSOLVED
        pivots += taken
        is_settled = True
        for i in range(q):
            bound = solver.cone[i] * solver.force[i]
            if solver.cone[i] > bodies.sliding[i] and abs(solver.traction[i]) >= bound * (1.0 - ROUNDING):
                solver.cone[i] = bodies.sliding[i]
                is_settled = False
            elif feeds_none and bound > 0.0:
                both = 2.0 * solver.slip[i] + slip_change(solver, i)
                least = UNNOTICED * abs(solver.tangential[1, i, i]) * bound
                if solver.traction[i] * both < -abs(solver.traction[i]) * least:
                    solver.cone[i] = 0.0
                    is_settled = False
        if is_settled:
            return pivots
    return pivots


@linked
def slip_change(solver: Workspace, i: int) -> float:
    """Change of the slip of pair i by the forces found."""
    change = 0.0
    for j in range(solver.force.size):
        change += (
            solver.tangential[0, i, j] * solver.force[j] + solver.tangential[1, i, j] * solver.traction[j]
        )
    return change


@linked
def gap_change(solver: Workspace, i: int) -> float:
    """Change of the gap of pair i by the forces found."""
    change = 0.0
    for j in range(solver.force.size):
        change += solver.matrix[i, j] * solver.force[j] + solver.coupling[i, j] * solver.traction[j]
    return change


@linked_sum
def expected_states(states: int, crossing: int, work: FrictionWork) -> int:
    """States that the pairs with a finite gap in `work.solver` are expected in, others open.

    A pair that sticks does so still, one whose slip vanishes begins to, and one that closes slides.
    """
    expected = int(np.int64(0))
    for i in range(work.rate.size):
        if work.solver.gap[i] < np.inf:
            state = state_of(states, i)
            is_stopped = state != OPEN and (crossing >> (2 * i + 1)) & 1 == 1
            if work.solver.is_sticking[i] or is_stopped or state == STUCK:
                state = STUCK
            elif state == OPEN:
                state = FORWARD if work.solver.slip[i] >= 0.0 else BACKWARD
            expected |= state << (2 * i)
    return expected


@linked_sum
def solve_expected(
    bodies: FrictionBodies, states: int, crossing: int, work: FrictionWork, feeds_none: bool
) -> int:
    """As `solve_event`, at the event of switch functions `crossing`; a solution where it goes as expected.

    A pair that would hold more than its friction may slides in a second solution.
    """
    expected = expected_states(states, crossing, work)
    for tried in range(1, 3):
        if not solve_states(bodies, expected, work):
            break
        if obeys_laws(bodies, expected, work, feeds_none):
            return tried
        following = sliding_instead(bodies, expected, work)
        if following == expected:
            break
        expected = following
    return int(solve_event(bodies, work, feeds_none))


@linked_sum
def sliding_instead(bodies: FrictionBodies, states: int, work: FrictionWork) -> int:
    """States in which pairs slide that stick with more friction than their cones of `work.solver` allow.

    Not where friction at rest is greater: once one slides, another one may hold.
    """
    solver, found = work.solver, states
    for i in range(work.rate.size):
        is_held = state_of(states, i) == STUCK and bodies.static[i] == bodies.sliding[i]
        if is_held and abs(solver.traction[i]) > solver.cone[i] * solver.force[i]:
            found ^= (STUCK ^ (FORWARD if solver.traction[i] > 0.0 else BACKWARD)) << (2 * i)
    return found


@linked_sum
def solve_active_pairs(bodies: FrictionBodies, states: int, work: FrictionWork) -> bool:
    """Forces of `work.solver` that stop `work.rest_speed` where `work.is_at_rest`; False where none do."""
    solver, q, rows = work.solver, work.rate.size, work.elimination
    n = int(np.int64(0))
    for i in range(2 * q):
        if work.is_at_rest[i]:
            work.held[n] = i
            n += 1
    for row in range(n):
        i = work.held[row]
        by_force = solver.matrix[i] if i < q else solver.tangential[0, i - q]
        by_traction = solver.coupling[i] if i < q else solver.tangential[1, i - q]
        for column in range(n):
            j = work.held[column]
            if j < q:  # with the friction of a pair that slides
                rows[row, column] = by_force[j] + rub_of(bodies, states, j) * by_traction[j]
            else:
                rows[row, column] = by_traction[j - q]
        rows[row, 2 * q] = -work.rest_speed[i]
    if not solve_rows(rows, n):
        return False
    for i in range(q):
        solver.force[i], solver.traction[i] = 0.0, 0.0
    for row in range(n):
        i = work.held[row]
        if i < q:
            solver.force[i] = rows[row, 2 * q]
            solver.traction[i] = rub_of(bodies, states, i) * rows[row, 2 * q]
        else:
            solver.traction[i - q] = rows[row, 2 * q]
    return True


@linked_sum
def rub_of(bodies: FrictionBodies, states: int, i: int) -> float:
    """Traction of pair i for a unit normal force where it slides; 0 where it does not."""
    state = state_of(states, i)
    rubs = bodies.sliding[i] if state == FORWARD else 0.0
    return -bodies.sliding[i] if state == BACKWARD else rubs


@linked_sum
def solve_states(bodies: FrictionBodies, states: int, work: FrictionWork) -> bool:
    """Forces with which pairs go on in a set of states, gaps at their targets; False where there are none."""
    solver, q = work.solver, work.rate.size
    for i in range(q):
        state = state_of(states, i)
        work.rest_speed[i], work.rest_speed[q + i] = solver.gap[i] - solver.target[i], solver.slip[i]
        work.is_at_rest[i], work.is_at_rest[q + i] = state != OPEN, state == STUCK
    return bool(solve_active_pairs(bodies, states, work))


@linked_sum
def obeys_laws(bodies: FrictionBodies, states: int, work: FrictionWork, feeds_none: bool) -> bool:
    """Whether the forces found for a set of states clearly obey the laws; fills `solver.cone`, `active`."""
    solver, q = work.solver, work.rate.size
    obeys, most = True, 0.0
    for i in range(q):
        most = max(most, solver.matrix[i, i] * solver.force[i])
    for i in range(q):
        state = state_of(states, i)
        solver.active[i] = state != OPEN
        is_held = solver.is_sticking[i] and state == STUCK
        solver.cone[i] = bodies.static[i] if is_held else bodies.sliding[i]
        if state != OPEN:
            force, traction, slip = solver.force[i], solver.traction[i], solver.slip[i]
            bound, end = solver.cone[i] * force, slip + slip_change(solver, i)
            moved = abs(solver.tangential[1, i, i] * traction)
            obeys = obeys and solver.matrix[i, i] * force > CLEARLY * most
            if state == STUCK:
                obeys = obeys and abs(traction) < bound * (1.0 - CLEARLY)
            else:
                obeys = obeys and (end if state == FORWARD else -end) > CLEARLY * (abs(slip) + moved)
            if feeds_none:
                least = UNNOTICED * abs(solver.tangential[1, i, i]) * bound
                obeys = obeys and traction * (slip + end) >= -abs(traction) * least
    return obeys
