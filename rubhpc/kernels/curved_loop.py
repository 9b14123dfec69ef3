"""The modal integrator for curved gaps: closed-form flights, and steps of order 8 while contacts are closed.

As `event_loop`, except while a pair is closed: the motion then has no closed form, and `curved_step` takes
steps with error control. In flight the gap is a convex function of the motion. It is never smaller than its
linearisation, so that bounds on the linear gap of a fixed normal hold for a curved gap too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    FINISHED,
    MODE_WANTED,
    MOST_STEPS,
    NONE,
    PAUSED,
    UNDER_WAY,
    Clock,
    Coordinates,
    Progress,
    shaft_turn,
)
from rubhpc.kernels.contact_modes import (
    FORCED_LEVEL,
    ModeTables,
    Reduced,
    find_mode,
    propagate,
)
from rubhpc.kernels.coordinate_steps import floor_log2
from rubhpc.kernels.curved_contact import (
    RESOLVED,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
)
from rubhpc.kernels.curved_entry import enter_curved
from rubhpc.kernels.curved_event import take_curved_event
from rubhpc.kernels.curved_measuring import (
    begin_curved_span,
    observe_curved_step,
    observe_energies,
    resolved_transient,
    take_curved_sample,
)
from rubhpc.kernels.curved_search import (
    closed_crossing,
    curved_free_interval,
    first_crossing,
    next_crossing,
    open_crossing,
)
from rubhpc.kernels.curved_step import follow_loads, go_on, take_step
from rubhpc.kernels.event_loop import stand_still
from rubhpc.kernels.event_steps import choose_step, contact_age, end_record, longest_step, sample_step
from rubhpc.kernels.measuring import begin_span
from rubhpc.kernels.sampling import Measured  # noqa: TC001 - part of a kernel's signature

if TYPE_CHECKING:
    from rubhpc.kernels.mode_change import EventWork

Floats = NDArray[np.float64]

GROWTH = 2  # steps are at most 2^this times the age of the contact
OBSERVED = 3e-3  # of the tolerance of loads, while recording, so that energies balance


@jit_sum
def advance_curved(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    reduced: Reduced,
    clock: Clock,
    tolerance: float,
    last_tick: int,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    work: CurvedWork,
    events: EventWork,
    measured: Measured,
) -> int:
    """Advance a case from the tick reached to `last_tick`, as `event_loop.advance` does.

    Parameters
    ----------
    tolerance : float
        Of the loads of closed contacts (`curved_step.take_step`).
    """
    z, z_next, motion = coordinates.z, coordinates.z_next, coordinates.motion
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    mask = tables.mask
    interval = clock.tick * (1 << clock.sample_level)
    highest_level = tables.power_re.shape[1] - 1
    last_step = progress.n_step + MOST_STEPS
    tolerance *= OBSERVED if is_recorded else 1.0
    progress.halving_level, progress.is_after_event = NONE, 0
    due = int(np.int64(NONE))  # ticks until a closed contact is expected to end, or another pair to touch
    groping = int(np.int64(0))  # level of the next step after that
    while True:
        if progress.wanted >= 0:
            found = find_mode(mask, progress.wanted)
            if found < 0:
                return MODE_WANTED
            if not enter_curved(tables, curved, pairs, reduced, clock, found, progress, z, motion, work):
                return CONTACT_UNSOLVED
        mode = progress.mode
        closed = int(mask[mode])
        if is_recorded and progress.energy_from < 0:
            if closed == 0:
                begin_span(z, progress, measured.recorder)
            else:
                begin_curved_span(pairs, tables, curved, clock, z, progress, work)
        is_sample = is_recorded and progress.tick == progress.next_sample << clock.sample_level
        is_end = progress.tick >= last_tick
        is_last = is_end and is_recorded and progress.tick == clock.n_sample << clock.sample_level
        if closed != 0 and is_sample and (is_last or not is_end):
            i_sample = progress.next_sample
            take_curved_sample(
                tables,
                curved,
                pairs,
                reduced,
                mode,
                shaft_turn(clock, progress.tick),
                z_re,
                z_im,
                i_sample,
                interval,
                work,
                measured,
            )
            progress.next_sample += 1
        if is_end:
            if is_recorded and closed == 0:
                end_record(tables, clock, is_sample, z, progress, measured)
            elif is_last:
                progress.energy_from = NONE
            return FINISHED
        is_at_event = progress.is_after_event == 1 or progress.halving_level >= 0 or due >= 0
        if progress.n_step > last_step and not is_at_event:
            return PAUSED
        is_ahead = is_sample and closed == 0
        longest = longest_step(clock, last_tick, highest_level, is_recorded, is_ahead, progress.tick)
        crossing = int(np.int64(0))
        if closed == 0:
            interval_free = 0.0
            if not is_at_event:
                interval_free = curved_free_interval(
                    tables, curved, pairs, mode, (1 << longest) * clock.tick, z_re, z_im, work
                )
            level, is_event_free = choose_step(clock, progress, longest, interval_free)
            propagate(
                tables.power_re[mode, level], tables.power_im[mode, level], z_re, z_im, next_re, next_im
            )
            progress.n_step += 1
            if not is_event_free:
                crossing = open_crossing(tables, curved, pairs, mode, reduced.overlap, next_re, next_im, work)
        else:
            # Vibration after an event is fast at first: steps grow with the age of the contact.
            age = contact_age(progress) + GROWTH
            level = min(longest, age if is_recorded else max(age, FORCED_LEVEL), progress.resolved_level)
            level = min(level, curved.weight_re.shape[1] - 1)
            if is_recorded:
                begun = floor_log2(max(1, progress.tick - progress.energy_from))
                if begun != progress.contact_age:
                    progress.contact_age = begun
                    work.span[RESOLVED] = resolved_transient(tables, mode, work)
                while level > FORCED_LEVEL and (1 << level) * clock.tick > work.span[RESOLVED]:
                    level -= 1
            is_event_free = progress.tick - progress.entered < 1 << FORCED_LEVEL  # so that time advances
            if due >= 0:
                level = min(level, floor_log2(due) if due > 0 else groping)
            step = (1 << level) * clock.tick
            progress.n_step += 1
            is_good, growth = take_step(
                pairs,
                curved,
                tables,
                reduced.rim_speed,
                mode,
                level,
                step,
                tolerance,
                is_recorded,
                z,
                z_next,
                work,
            )
            if not is_good:
                if level == 0:
                    return CONTACT_UNSOLVED
                progress.resolved_level = level - 1
                continue
            if level >= progress.resolved_level and due < 0:
                progress.resolved_level = level + growth
            progress.is_after_event = 0
            if not is_event_free:
                crossing = closed_crossing(closed, reduced.overlap, work)
        if crossing != 0 and level > 0 and closed == 0:
            if not stand_still(
                crossing, tables.switch_re[mode], tables.switch_im[mode], z_re, z_im, next_re, next_im
            ):
                progress.halving_level = level - 1
                continue
        elif crossing != 0 and level > 0:
            due = min(int(first_crossing(closed, crossing, work) * (1 << level)), (1 << level) - 1)
            follow_loads(closed, (1 << level) * clock.tick, 0.0, work)
            groping = 0
            continue
        if is_sample and closed == 0:
            sample_step(tables, clock, level, z_re, z_im, progress, measured)
        if crossing != 0:  # an event within the next tick, or before anything moves, is taken here
            outcome = take_curved_event(
                tables,
                curved,
                pairs,
                reduced,
                clock,
                crossing,
                is_recorded,
                progress,
                coordinates,
                work,
                events,
                measured,
            )
            if outcome != UNDER_WAY:
                return outcome
            due = NONE
            continue
        if closed != 0:
            step = (1 << level) * clock.tick
            if is_recorded:
                observe_energies(
                    pairs, tables, curved, clock, level, z, z_next, progress, work, measured.accumulator
                )
                i_sample = progress.tick >> clock.sample_level
                observe_curved_step(
                    reduced,
                    closed,
                    progress.tick * clock.tick,
                    step,
                    i_sample,
                    1.0 / interval,
                    work,
                    measured.samples,
                    measured.accumulator,
                )
            if due >= 0:
                groping = groping + 1 if due == 0 else 0
                due = max(due - (1 << level), 0)
                ahead = next_crossing(closed, work) * (1 << level)
                if groping == 0 and ahead <= 2.0 * (1 << level):
                    due = int(ahead)
                elif groping > FORCED_LEVEL:  # no event occurred
                    due = NONE
            go_on(closed, step, work)
        for k in range(z_re.size):
            z_re[k], z_im[k] = next_re[k], next_im[k]
        progress.tick += 1 << level
        progress.halving_level = max(progress.halving_level - 1, NONE)
