"""From one contact mode to the next, at an event under set-valued friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    MODE_WANTED,
    NONE,
    UNDER_WAY,
    Clock,
    Progress,
    shaft_turn,
)
from rubhpc.kernels.contact_modes import FORCED_LEVEL, ModeTables, Reduced, find_mode, is_beyond
from rubhpc.kernels.event_forces import FrictionWork  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.event_steps import count_event, record_touch
from rubhpc.kernels.friction_change import change_seen
from rubhpc.kernels.friction_coordinates import begin_states, leave_states, used_width
from rubhpc.kernels.friction_events import add_kick, see_pairs, takes_part
from rubhpc.kernels.friction_spans import copy_coordinates, note_impulse
from rubhpc.kernels.friction_states import OPEN, FrictionBodies, state_of
from rubhpc.kernels.sampling import Recorder  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.trail import note_after, note_event
from rubhpc.kernels.transitions import (
    UNKNOWN,
    WORTH_A_TABLE,
    Transitions,
    add_impulses,
    is_far,
    pass_over,
    see,
)

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples

Floats = NDArray[np.float64]

MOST_EVENTS = 65536  # in a revolution; more are left to short steps


@linked_sum
def take_change(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    crossing: int,
    is_recorded: bool,
    progress: Progress,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    work: FrictionWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
    transitions: Transitions,
) -> int:
    """Take the event of the switch functions `crossing`.

    Where its transition is tabulated, the coordinates in the contact mode that goes on are left in `z`.
    Otherwise that mode is wanted, with the motion in `motion`.

    Returns
    -------
    int
        UNDER_WAY, DIVERGED, CONTACT_UNSOLVED, or MODE_WANTED where a transition is to be tabulated.
    """
    mode, q = progress.mode, work.rate.size
    states, m, used = tables.mask[mode], z.shape[1], used_width(tables, mode)
    is_known = transitions.mode.size > 0 and transitions.mode[mode] >= 0
    count_event(clock, progress)
    interval = clock.tick * (1 << clock.sample_level)
    (cosine, sine), moment = shaft_turn(clock, progress.tick), (1 << FORCED_LEVEL) * clock.tick
    if is_known:
        first = tables.n_eigenmode[mode]
        z[0, first], z[1, first] = cosine, sine
        for i in range(q):
            if takes_part(states, crossing, i):
                rate, slip, along_gap, along_slip = see(transitions, mode, m, i, used, z)
                work.rate[i], work.slip[i] = rate, bodies.rim_speed[i] + slip
                work.drawn[i], work.drawn[q + i] = along_gap, along_slip
    is_left = not is_known or is_far(transitions, mode, q, m, reduced.displacement_limit, z)
    if is_left:
        leave_states(tables, mode, z, motion)
        if is_beyond(reduced, motion):
            return DIVERGED
        if not is_known:
            see_pairs(reduced, bodies, states, crossing, motion, work)
    if is_recorded:
        for i in range(q):
            work.impulse[i] = accumulator.impulse[i]
    wanted = change_seen(
        reduced,
        bodies,
        states,
        crossing,
        moment,
        cosine,
        sine,
        motion,
        is_recorded,
        work,
        accumulator,
    )
    if is_recorded:
        for i in range(q):
            gained = accumulator.impulse[i] - work.impulse[i]
            samples.force[i, progress.tick >> clock.sample_level] += gained / interval
            note_impulse(recorder.spans, i, gained)
            if wanted >= 0:
                record_touch(i, state_of(wanted, i) != OPEN, accumulator)
    following, passed = NONE, UNKNOWN
    if wanted >= 0 and transitions.mode.size > 0:
        following = find_mode(tables.mask, wanted)
        if following >= 0:
            passed = transitions.entry[mode, following]
            if passed < 0:
                passed -= 1
                transitions.entry[mode, following] = passed
    is_unsolved = wanted < 0 or progress.n_event > MOST_EVENTS
    if (passed < 0 or is_unsolved) and not is_left:
        leave_states(tables, mode, z, motion)
    note_event(work.trail, progress.tick, crossing)
    add_kick(work, motion)
    if is_unsolved:
        return CONTACT_UNSOLVED
    note_after(work.trail, work.rate, work.slip, work.given)
    if passed < 0:
        progress.wanted = wanted
        return MODE_WANTED if passed == UNKNOWN - WORTH_A_TABLE else UNDER_WAY
    pass_over(transitions, passed, m, z, z_next)
    add_impulses(transitions, following, q, m, work.given, z_next)
    copy_coordinates(z_next, z)
    begin_states(tables, following, reduced.clearance, cosine, sine, progress, z)
    return UNDER_WAY
