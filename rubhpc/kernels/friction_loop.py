"""The exact modal integrator under set-valued friction: closed-form motion while no pair changes its state.

As `event_loop`, with four states of a pair in place of two: open, sliding in either sense, sticking. Each
pair has two switch functions: gap and 1 (open), normal force and slip in its sense (sliding), or what the
friction has left of its cone on either side (sticking). Beside the coordinates of `event_loop` stand a 1 and,
for each pair that sticks, the displacement along its rim, which grows linearly: the only one that does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.case_progress import (
    FINISHED,
    MODE_WANTED,
    MOST_STEPS,
    NONE,
    PAUSED,
    UNDER_WAY,
    Clock,
    Coordinates,
    Progress,
    Sections,
)
from rubhpc.kernels.contact_modes import ModeTables, Reduced, used_width
from rubhpc.kernels.coordinate_steps import floor_log2, go_on, turn_on
from rubhpc.kernels.event_bounds import FEW_BITS, WORTH_ASKING, free_until
from rubhpc.kernels.event_forces import FrictionWork  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.event_search import approach_change, find_change, move_stuck
from rubhpc.kernels.event_steps import choose_step, end_samples, enter_wanted, note_section
from rubhpc.kernels.friction_change import take_change
from rubhpc.kernels.friction_events import observe_states
from rubhpc.kernels.friction_measuring import observe_span
from rubhpc.kernels.friction_states import FrictionBodies, stuck_pairs
from rubhpc.kernels.measuring import begin_span
from rubhpc.kernels.sampling import Measured  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.trail import note_piece

Floats = NDArray[np.float64]

LONGEST = 128  # samples after which a span is ended without an event: its forces are bounded by its beginning


@linked_sum
def advance_with_friction(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    last_tick: int,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    work: FrictionWork,
    measured: Measured,
    sections: Sections,
) -> int:
    """Advance a case from the tick reached to `last_tick`, as `event_loop.advance` does.

    `reduced.clearance` (q + 1,) ends with a 1, the coordinate that the steady part of the motion goes with.

    Returns
    -------
    int
        FINISHED, DIVERGED (at an event), MODE_WANTED, PAUSED, or CONTACT_UNSOLVED with the motion in
        `coordinates`: no forces obey the laws, or events follow one another without end.
    """
    z, z_next, motion = coordinates.z, coordinates.z_next, coordinates.motion
    mask, switch_re, switch_im = tables.mask, tables.switch_re, tables.switch_im
    rate_re, rate_im = tables.rate_re, tables.rate_im
    power_re, power_im, n_eigenmode = tables.power_re, tables.power_im, tables.n_eigenmode
    rim_speed, overlap = bodies.rim_speed, reduced.overlap
    highest_level = power_re.shape[1] - 1
    if is_recorded:
        highest_level = min(highest_level, clock.sample_level + floor_log2(LONGEST))
    last_step = progress.n_step + MOST_STEPS
    progress.halving_level, progress.is_after_event = NONE, 0
    is_new = True  # the contact mode, to this call
    while True:
        if progress.wanted >= 0:
            if not enter_wanted(tables, reduced, clock, progress, motion, z):
                return MODE_WANTED
            note_piece(work.trail, mask[progress.mode], z)
            is_new = True
        if is_new:
            is_new = False
            # Ticks until when no event can be, until when none passes unseen, and when both are asked anew.
            free_to = sure_to = renewed_at = progress.tick
            work.free_until[:] = progress.tick
            used = used_width(tables, progress.mode)
            z_re, z_im, next_re, next_im = z[0, :used], z[1, :used], z_next[0, :used], z_next[1, :used]
            if is_recorded:
                observe_states(mask[progress.mode], measured.accumulator)
        if is_recorded and progress.energy_from < 0:
            begin_span(z, progress, measured.recorder)
        is_over, crossing = progress.tick >= last_tick, int(np.int64(0))
        if not is_over:
            is_at_event = progress.is_after_event == 1 or progress.halving_level >= 0
            if progress.n_step > last_step and not is_at_event:
                return PAUSED
            mode = progress.mode
            states = mask[mode]
            longest, left = highest_level, last_tick - progress.tick
            if left < 1 << highest_level:
                longest = floor_log2(left)
            if not is_at_event and progress.tick >= renewed_at and progress.tick + (1 << longest) > sure_to:
                free_to, sure_to = free_until(
                    states,
                    tables,
                    mode,
                    z_re,
                    z_im,
                    progress.tick,
                    clock.tick,
                    1 << clock.search_level,
                    1 << highest_level,
                    work.free_until,
                )
                renewed_at = sure_to - (sure_to - progress.tick) // WORTH_ASKING
            is_forced = progress.is_after_event == 1
            if is_at_event:
                level, _ = choose_step(clock, progress, longest, (sure_to - progress.tick) * clock.tick)
                count = 1 << level
            else:
                reach = min(sure_to - progress.tick, left, 1 << highest_level)
                count = max(leading(reach), 1 << min(longest, clock.search_level))
                level = floor_log2(count)
            step, ends = count * clock.tick, progress.tick + count
            progress.n_step += 1
            is_checked = not is_forced and ends > free_to
            if is_checked:
                go_on(count, power_re[mode], power_im[mode], z_re, z_im, next_re, next_im)
                if stuck_pairs(states) != 0:
                    move_stuck(states, n_eigenmode[mode], rim_speed, step, next_re)
                crossing = find_change(
                    states,
                    mode,
                    switch_re,
                    switch_im,
                    next_re,
                    next_im,
                    rate_re,
                    rate_im,
                    overlap,
                    ends,
                    work.free_until,
                )
                if crossing != 0 and level > clock.sample_level:
                    progress.halving_level = level - 1
                    continue
            passed = count
            if crossing != 0:
                passed, crossing = approach_change(
                    tables,
                    bodies,
                    clock,
                    mode,
                    crossing,
                    overlap,
                    count,
                    z,
                    z_next,
                    progress.tick,
                    work.free_until,
                )
            elif is_checked:
                for k in range(z_re.size):
                    z_re[k], z_im[k] = next_re[k], next_im[k]
            else:
                turn_on(count, power_re[mode], power_im[mode], z_re, z_im)
                if stuck_pairs(states) != 0:
                    move_stuck(states, n_eigenmode[mode], rim_speed, step, z_re)
            progress.tick += passed
            progress.halving_level = max(progress.halving_level - 1, NONE)
        outcome = UNDER_WAY
        if crossing != 0:  # within the next tick
            outcome = take_change(
                tables,
                reduced,
                bodies,
                clock,
                crossing,
                is_recorded,
                progress,
                coordinates,
                work,
                measured,
            )
        if is_recorded:
            n_sample = (progress.tick >> clock.sample_level) - (progress.energy_from >> clock.sample_level)
            if is_over or crossing != 0 or n_sample >= LONGEST:
                observe_span(tables, bodies, clock, z, progress, measured)
        if is_over:
            if is_recorded:
                is_sample = progress.tick == progress.next_sample << clock.sample_level
                end_samples(tables, clock, is_sample, z, progress, measured)
            elif note_section(tables, reduced, clock, progress, z, measured.accumulator, sections):
                last_tick += clock.samples_per_revolution << clock.sample_level
                last_step = progress.n_step + MOST_STEPS
                progress.halving_level, progress.is_after_event = NONE, 0
                is_new = True
                continue
            return FINISHED
        if outcome != UNDER_WAY:
            return outcome


@linked_sum
def leading(count: int) -> int:
    """The count of ticks less all but its first bits; 0 of none."""
    unit = 1 << max(floor_log2(max(count, 1)) - FEW_BITS, 0)
    return int(max(count, 0) // unit * unit)
