"""Events under set-valued friction and a penalty: which pairs go on open, lifted, sliding or sticking.

A spring and a damper give the normal force, so that nothing impacts: motion is continuous, and so are normal
forces but for the damper's where a gap closes. What a pair sticks with follows from Coulomb's law alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.accumulators import PRESSING, Accumulator
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact_modes import Reduced  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.coulomb_friction import ROUNDING
from rubhpc.kernels.event_steps import GAP_TOLERANCE
from rubhpc.kernels.friction_events import FrictionWork, bring_to_rest, observe_event, solve_event
from rubhpc.kernels.friction_states import (
    BACKWARD,
    FORWARD,
    OPEN,
    STUCK,
    FrictionBodies,
    lifted_place,
    state_of,
)
from rubhpc.kernels.mode_change import product
from rubhpc.kernels.penalty_events import force_of, gap_of

Floats = NDArray[np.float64]


@jit_lean_sum
def change_soft_states(
    reduced: Reduced,
    bodies: FrictionBodies,
    states: int,
    crossing: int,
    moment: float,
    cosine: float,
    sine: float,
    motion: Floats,
    is_recorded: bool,
    work: FrictionWork,
    accumulator: Accumulator,
) -> int:
    """States of all pairs that go on, as `friction_events.change_states` gives them; -1 where there are none.

    `work.solver` is that of `soften`: a normal force follows from its own gap alone.
    """
    q, n = reduced.gap_jacobian.shape
    velocity, solver = motion[n:], work.solver
    lifted = int(np.int64(0))
    for i in range(q):
        state = state_of(states, i)
        first, second = (crossing >> (2 * i)) & 1, (crossing >> (2 * i + 1)) & 1
        is_closed = state != OPEN
        is_lifted = (states >> lifted_place(q, i)) & 1 == 1
        if state == OPEN and first == 1:
            is_closed = not is_lifted or gap_of(reduced, i, motion) < 0.0
            is_lifted = False
        elif state in (FORWARD, BACKWARD) and first == 1:
            is_closed, is_lifted = False, reduced.damper > 0.0
        elif is_lifted:
            is_lifted = gap_of(reduced, i, motion) < 0.0
        if is_lifted:
            lifted |= 1 << lifted_place(q, i)
        work.slip[i] = bodies.rim_speed[i] + product(reduced.slip[i], velocity)
        solver.is_sticking[i] = state == STUCK and first == 0 and second == 0
        solver.gap[i], solver.target[i] = np.inf, 0.0
        if is_closed:
            solver.gap[i] = -max(force_of(reduced, i, motion), GAP_TOLERANCE * reduced.spring)
    acceleration = work.acceleration
    for k in range(n):
        acceleration[k] = (
            reduced.force_cosine[k] * cosine
            + reduced.force_sine[k] * sine
            - product(reduced.stiffness[k], motion[:n])
            - product(reduced.damping[k], velocity)
        )
    for i in range(q):
        solver.slip[i] = work.slip[i] / moment + product(reduced.slip[i], acceleration)
    pivots = solve_event(bodies, work, False)
    if pivots == UNSOLVED:
        return -1
    if is_recorded:
        observe_event(PRESSING, pivots, solver, accumulator)
    remaining = lifted
    for i in range(q):
        if solver.gap[i] == np.inf:
            continue
        traction, bound = solver.traction[i], solver.cone[i] * solver.force[i] * (1.0 - ROUNDING)
        if abs(traction) < bound:
            found = STUCK
        elif traction != 0.0:
            found = FORWARD if traction > 0.0 else BACKWARD
        else:
            found = FORWARD if solver.slip[i] >= 0.0 else BACKWARD
        remaining |= found << (2 * i)
    bring_to_rest(reduced, bodies, remaining, velocity, is_recorded, work, accumulator)
    return remaining
