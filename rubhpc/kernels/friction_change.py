"""An event under set-valued friction, pairs rigid or with a penalty: the states that go on after it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked, linked_sum
from rubhpc.kernels.accumulators import PRESSING, Accumulator
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    UNDER_WAY,
    Clock,
    Coordinates,
    Progress,
    shaft_turn,
)
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact_modes import FORCED_LEVEL, ModeTables, Reduced, is_beyond, leave
from rubhpc.kernels.contact_pairs import Workspace  # noqa: TC001 - likewise
from rubhpc.kernels.coulomb_friction import ROUNDING
from rubhpc.kernels.event_forces import FrictionWork, solve_expected
from rubhpc.kernels.event_steps import count_event, record_touch
from rubhpc.kernels.friction_events import (
    bring_to_rest,
    collide,
    observe_event,
    part_pairs,
    rate_without_forces,
    see_pairs,
)
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies, state_of
from rubhpc.kernels.sampling import Measured  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.soft_friction_events import press_pairs
from rubhpc.kernels.trail import note_after, note_event

Floats = NDArray[np.float64]

LEAVING = 1e-3  # of the cone, within which friction is a tick before it is outside
MOST_EVENTS = 65536  # in a revolution; more are left to collocation


@linked_sum
def take_change(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    crossing: int,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    work: FrictionWork,
    measured: Measured,
) -> int:
    """Take the event of the switch functions `crossing`: what it makes of the motion, and the states wanted.

    Returns
    -------
    int
        UNDER_WAY, DIVERGED or CONTACT_UNSOLVED.
    """
    motion, accumulator = coordinates.motion, measured.accumulator
    count_event(clock, progress)
    leave(tables, progress.mode, coordinates.z, motion)
    if is_beyond(reduced, motion):
        return DIVERGED
    if is_recorded:
        for i in range(work.impulse.size):
            work.impulse[i] = accumulator.impulse[i]
    cosine, sine = shaft_turn(clock, progress.tick)
    states, moment = tables.mask[progress.mode], (1 << FORCED_LEVEL) * clock.tick
    wanted = change_states(
        reduced, bodies, states, crossing, moment, cosine, sine, motion, is_recorded, work, accumulator
    )
    if is_recorded:
        interval = clock.tick * (1 << clock.sample_level)
        for i in range(work.impulse.size):
            gained = accumulator.impulse[i] - work.impulse[i]
            measured.samples.force[i, progress.tick >> clock.sample_level] += gained / interval
            measured.recorder.given[i] = gained
            if wanted >= 0:
                record_touch(i, state_of(wanted, i) != OPEN, accumulator)
    note_event(work.trail, progress.tick, crossing)
    if wanted < 0 or progress.n_event > MOST_EVENTS:
        return CONTACT_UNSOLVED
    note_after(work.trail, work.rate, work.slip, work.given)
    progress.wanted = wanted
    return UNDER_WAY


@jit_sum
def change_states(
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
    """Take an event, in `motion` (2 n,): the states of all pairs that go on; -1 where there are none.

    `crossing` has a bit for each switch function that turns negative, two a pair. Impulses obey Coulomb's law
    with the velocities after them. What goes on follows from the forces of a virtual step of `moment` (s): a
    pair whose normal force vanishes is open, one whose friction is within its cone sticks. Under a penalty
    nothing impacts, a normal force follows from its own gap alone, and `work.solver` is that of a march's
    `_soften`.
    """
    see_pairs(reduced, bodies, states, crossing, motion, work)
    q, solver = work.rate.size, work.solver
    is_soft = reduced.spring > 0.0
    remaining = int(np.int64(0))
    work.given[:] = 0.0
    if is_soft:
        remaining = press_pairs(reduced, states, crossing, motion, work)
        for i in range(q):
            if solver.gap[i] < np.inf:
                along = rate_without_forces(bodies, q + i, cosine, sine, work)
                solver.slip[i] = work.slip[i] / moment + along
    else:
        if not collide(reduced, bodies, states, crossing, motion, is_recorded, work, accumulator):
            return -1
        part_pairs(reduced, bodies, moment, cosine, sine, work)
    pivots = solve_expected(bodies, states, crossing, work, False)
    if pivots == UNSOLVED:
        return -1
    if is_recorded:
        observe_event(PRESSING, pivots, solver, accumulator)
    for i in range(q):
        if solver.gap[i] < np.inf if is_soft else solver.force[i] > 0.0:
            leaves = state_of(states, i) == STUCK and (crossing >> (2 * i)) & 3 != 0
            remaining |= state_by_forces(solver, i, leaves) << (2 * i)
        elif is_recorded and reduced.restitution > 0.0:
            has_bounced = state_of(states, i) == OPEN and (crossing >> (2 * i)) & 1 == 1
            accumulator.n_contact[i] += 1 if has_bounced else 0
    bring_to_rest(reduced, bodies, remaining, motion, is_recorded, work, accumulator)
    return remaining


@linked
def state_by_forces(solver: Workspace, i: int, leaves: bool) -> int:
    """State in which closed pair i goes on, by its forces: within its cone it sticks.

    One that `leaves` its cone within the next tick is within it by a hair yet, and slides.
    """
    traction, bound = solver.traction[i], solver.cone[i] * solver.force[i] * (1.0 - ROUNDING)
    if abs(traction) < (bound * (1.0 - LEAVING) if leaves else bound):
        return STUCK
    if traction != 0.0:
        return FORWARD if traction > 0.0 else BACKWARD
    return FORWARD if solver.slip[i] >= 0.0 else BACKWARD
