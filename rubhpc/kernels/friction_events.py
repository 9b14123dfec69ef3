"""Events under set-valued friction: impacts, what forces hold, and what they bring to rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked, linked_sum
from rubhpc.kernels.accumulators import (
    IMPACT,
    IMPACT_LOSS,
    Accumulator,
    observe_rub,
    observe_sense,
    observe_solution,
)
from rubhpc.kernels.complementarity import UNSOLVED, natural_residual
from rubhpc.kernels.contact_modes import Reduced  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.contact_pairs import Workspace  # noqa: TC001 - likewise
from rubhpc.kernels.coulomb_friction import ROUNDING, friction_residual
from rubhpc.kernels.event_forces import (
    FrictionWork,
    gap_change,
    slip_change,
    solve_active_pairs,
    solve_expected,
)
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies, state_of
from rubhpc.kernels.mode_change import AT_REST, OPENING, hidden_flight, least_flight, product

Floats = NDArray[np.float64]


@linked
def observe_event(problem: int, pivots: int, solver: Workspace, accumulator: Accumulator) -> None:
    """Note what a problem has taken, and how far its solution is from the laws."""
    distance, moved = 0.0, 0.0
    for i in range(solver.force.size):
        if solver.force[i] > 0.0 or solver.active[i]:
            end = solver.gap[i] - solver.target[i] + gap_change(solver, i)
            distance = max(distance, natural_residual(solver.matrix[i, i], solver.force[i], end))
            moved = max(moved, solver.matrix[i, i] * solver.force[i])
            slipped, held = friction_residual(solver, i)
            distance, moved = max(distance, slipped), max(moved, held)
    observe_solution(problem, pivots, distance, moved, accumulator)


@linked_sum
def takes_part(states: int, crossing: int, i: int) -> bool:
    """Whether an event with the switch functions `crossing` concerns pair i: it is closed, or closes."""
    return state_of(states, i) != OPEN or (crossing >> (2 * i)) & 1 == 1


@linked_sum
def see_pairs(
    reduced: Reduced, bodies: FrictionBodies, states: int, crossing: int, motion: Floats, work: FrictionWork
) -> None:
    """Read from a motion (2 n,) what its event asks of the pairs that it concerns."""
    q, velocity = work.rate.size, motion[motion.size // 2 :]
    for i in range(q):
        if takes_part(states, crossing, i):
            work.rate[i] = product(reduced.gap_jacobian[i], velocity)
            work.slip[i] = bodies.rim_speed[i] + product(reduced.slip[i], velocity)
            work.drawn[i] = product(bodies.pull[i], motion)
            work.drawn[q + i] = product(bodies.pull[q + i], motion)


@linked_sum
def give_impulses(reduced: Reduced, motion: Floats, work: FrictionWork) -> None:
    """Add the impulses that `work.solver` holds to the motion (2 n,), and to those of the event."""
    solver, velocity = work.solver, motion[motion.size // 2 :]
    for i in range(work.rate.size):
        force, traction = solver.force[i], solver.traction[i]
        if force != 0.0 or traction != 0.0:
            work.given[0, i] += force
            work.given[1, i] += traction
            for k in range(velocity.size):
                velocity[k] += force * reduced.gap_jacobian[i, k] - traction * reduced.slip[i, k]


@linked_sum
def collide(
    reduced: Reduced,
    bodies: FrictionBodies,
    states: int,
    crossing: int,
    motion: Floats,
    is_recorded: bool,
    work: FrictionWork,
    accumulator: Accumulator,
) -> bool:
    """Take the impacts of rigid pairs whose gaps close; False where none obey the laws.

    Fills which pairs take part in what goes on: the gap in `work.solver` of any other is infinite. A pair
    that stuck has not slid by an impact elsewhere: whether it is held is seen by the forces that go on.
    """
    solver = work.solver
    is_impact = False
    for i in range(work.rate.size):
        state = state_of(states, i)
        first, second = (crossing >> (2 * i)) & 1, (crossing >> (2 * i + 1)) & 1
        solver.slip[i] = work.slip[i]
        solver.is_sticking[i] = state == STUCK and first == 0 and second == 0
        solver.gap[i], solver.target[i] = np.inf, 0.0
        if state == OPEN:
            if first == 1:
                solver.gap[i] = work.rate[i]
                solver.target[i] = max(-reduced.restitution * work.rate[i], 0.0)
                is_impact = is_impact or work.rate[i] < 0.0
        elif state == STUCK or first == 0:
            solver.gap[i] = 0.0
    if not is_impact:
        return True
    pivots = solve_expected(bodies, states, crossing, work, True)
    if pivots == UNSOLVED:
        return False
    for i in range(work.rate.size):
        if not solver.force[i] > 0.0:
            solver.force[i], solver.traction[i] = 0.0, 0.0
    if is_recorded:
        observe_event(IMPACT, pivots, solver, accumulator)
        observe_impacts(bodies, work, accumulator)
    give_impulses(reduced, motion, work)
    see_pairs(reduced, bodies, states, crossing, motion, work)
    for i in range(work.rate.size):
        if solver.force[i] > 0.0:
            bound = solver.cone[i] * solver.force[i] * (1.0 - ROUNDING)
            solver.is_sticking[i] = solver.is_sticking[i] or abs(solver.traction[i]) < bound
    return True


@linked_sum
def rate_without_forces(
    bodies: FrictionBodies, row: int, cosine: float, sine: float, work: FrictionWork
) -> float:
    """What changes a gap's or a slip's rate, by its row of `work.drawn`, without contact forces, m/s2."""
    turned = bodies.turned[row]
    return float(turned[0] * cosine + turned[1] * sine - work.drawn[row])


@linked_sum
def part_pairs(
    reduced: Reduced, bodies: FrictionBodies, moment: float, cosine: float, sine: float, work: FrictionWork
) -> None:
    """Fill what the gaps and slips of rigid pairs do over a `moment` (s) without forces, m/s2.

    Those that part take no part in what goes on.
    """
    solver, q, hidden = work.solver, work.rate.size, hidden_flight(reduced)
    for i in range(q):
        if solver.gap[i] < np.inf:
            opening, rate = rate_without_forces(bodies, i, cosine, sine, work), work.rate[i]
            time = least_flight(opening, moment, hidden)
            # A pair that parts so slowly that it is pressed together again at once has not parted.
            if rate <= OPENING + max(-opening, 0.0) * time:
                solver.gap[i] = opening + (rate / time if abs(rate) > OPENING else 0.0)
                along = rate_without_forces(bodies, q + i, cosine, sine, work)
                solver.slip[i] = work.slip[i] / moment + along
            else:
                solver.gap[i] = np.inf
        solver.target[i] = 0.0


@linked_sum
def bring_to_rest(
    reduced: Reduced,
    bodies: FrictionBodies,
    states: int,
    motion: Floats,
    is_recorded: bool,
    work: FrictionWork,
    accumulator: Accumulator,
) -> None:
    """Stop what the states that go on hold still, gaps and slips.

    A pair that parts for a moment lacks as much of its impulse as presses it together again. One that sticks
    has been slipping at the tick before its slip vanishes.
    """
    q = work.rate.size
    moves = False
    for i in range(q):
        state = state_of(states, i)
        work.rest_speed[i], work.rest_speed[q + i] = work.rate[i], work.slip[i]
        is_held = state != OPEN and reduced.spring == 0.0
        work.is_at_rest[i], work.is_at_rest[q + i] = is_held, state == STUCK
        moves = moves or (is_held and abs(work.rate[i]) > AT_REST)
        moves = moves or (state == STUCK and abs(work.slip[i]) > AT_REST)
    if not moves:
        return
    if not solve_active_pairs(bodies, states, work):
        return
    if is_recorded:
        observe_impacts(bodies, work, accumulator)
    give_impulses(reduced, motion, work)
    for i in range(q):
        work.rate[i] += gap_change(work.solver, i)
        work.slip[i] += slip_change(work.solver, i)


@linked
def observe_impacts(bodies: FrictionBodies, work: FrictionWork, accumulator: Accumulator) -> None:
    """Add impulses and their work, which is that of the mean of the velocities before and after."""
    solver = work.solver
    for i in range(solver.force.size):
        if solver.force[i] != 0.0 or solver.traction[i] != 0.0:
            change = slip_change(solver, i)
            slip = work.slip[i] + 0.5 * change
            friction_work = solver.traction[i] * slip
            accumulator.impulse[i] += solver.force[i]
            accumulator.friction_work[i] += friction_work
            after = work.slip[i] + change
            after = after if abs(after) > AT_REST else 0.0
            accumulator.least_slip[i] = min(accumulator.least_slip[i], work.slip[i], after)
            observe_rub(solver.traction[i] * bodies.rim_speed[i], friction_work, accumulator)
            accumulator.energy[IMPACT_LOSS] -= solver.force[i] * (work.rate[i] + 0.5 * gap_change(solver, i))


@linked
def observe_states(states: int, accumulator: Accumulator) -> None:
    """Note the senses in which pairs slide in a set of states."""
    for i in range(accumulator.sense.size):
        state = state_of(states, i)
        if state == FORWARD:
            observe_sense(i, 1, accumulator)
        elif state == BACKWARD:
            observe_sense(i, -1, accumulator)
