"""The modal integrator for curved gaps: closed-form flights, and steps of order 4 while contacts are closed.

As `event_loop`, but for what is closed: there the motion has no closed form, and `curved_step` takes steps
with control of their error. In flight the gap is a convex function of the motion, so that it is never smaller
than its linear continuation: what bounds the linear gap of a fixed normal bounds a curved one as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    FINISHED,
    MODE_WANTED,
    MOST_STEPS,
    NONE,
    PAUSED,
    UNDER_WAY,
    Clock,
    Progress,
    shaft_angle,
)
from rubhpc.kernels.contact_modes import (
    FORCED_LEVEL,
    ModeTables,
    Reduced,
    bounded,
    dot,
    enter,
    event_free_interval,
    find_mode,
    is_beyond,
    propagate,
)
from rubhpc.kernels.curved_contact import (
    ALONG,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    evaluate,
    fill_geometry,
    is_closed,
    read_motion,
)
from rubhpc.kernels.curved_events import change_curved
from rubhpc.kernels.curved_measuring import (
    observe_curved_step,
    observe_power,
    place,
    take_curved_sample,
)
from rubhpc.kernels.curved_step import go_on, take_step
from rubhpc.kernels.event_loop import MOST_EVENTS, EventWork
from rubhpc.kernels.event_steps import (
    GAP_TOLERANCE,
    choose_step,
    contact_age,
    end_record,
    longest_step,
    record_event,
    record_touch,
    sample_step,
)
from rubhpc.kernels.measuring import Recorder, begin_span, end_span
from rubhpc.kernels.mode_change import product

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples

Floats = NDArray[np.float64]


@jit_lean_sum
def advance_curved(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    reduced: Reduced,
    skew: Floats,
    clock: Clock,
    tolerance: float,
    last_tick: int,
    is_recorded: bool,
    progress: Progress,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    work: CurvedWork,
    events: EventWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
) -> int:
    """Advance a case from the tick reached to `last_tick`, as `event_loop.advance` does.

    Parameters
    ----------
    skew : (n, n) or (0, n)
        Skew part of the stiffness; without rows where there is none.
    tolerance : float
        Of the loads of closed contacts (`curved_step.take_step`).
    """
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    mask = tables.mask
    interval = clock.tick * (1 << clock.sample_level)
    highest_level = tables.power_re.shape[1] - 1
    last_step = progress.n_step + MOST_STEPS
    progress.halving_level, progress.is_after_event = NONE, 0
    is_begun = False
    while True:
        if progress.wanted >= 0:
            found = find_mode(mask, progress.wanted)
            if found < 0:
                return MODE_WANTED
            if not enter_curved(tables, curved, pairs, reduced, clock, found, progress, z, motion, work):
                return CONTACT_UNSOLVED
            is_begun = False
        mode = progress.mode
        closed = int(mask[mode])
        if is_recorded and not is_begun:
            if closed == 0:
                if progress.energy_from < 0:
                    begin_span(tables, z, progress, recorder)
            else:
                angle = shaft_angle(clock, progress.tick)
                observe_power(reduced, skew, tables, curved, mode, 0, angle, z_re, z_im, work)
        is_begun = True
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
                shaft_angle(clock, progress.tick),
                z_re,
                z_im,
                i_sample,
                interval,
                work,
                recorder,
                samples,
                accumulator,
            )
            progress.next_sample += 1
        if is_end:
            if is_recorded and closed == 0:
                end_record(tables, clock, is_sample, z, progress, recorder, samples, accumulator)
            return FINISHED
        is_at_event = progress.is_after_event == 1 or progress.halving_level >= 0
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
                crossing = open_crossing(tables, curved, pairs, mode, next_re, next_im, work)
        else:
            # What an event sets off is fast at first: no step is longer than the contact has lasted.
            age = contact_age(progress)
            level = min(longest, age if is_recorded else max(age, FORCED_LEVEL), progress.resolved_level)
            level = min(level, curved.weight_re.shape[1] - 1)
            if is_recorded:
                level = min(level, clock.contact_level)
            is_event_free = progress.tick - progress.entered < 1 << FORCED_LEVEL  # so that time goes on
            if progress.halving_level >= 0:
                level = min(level, progress.halving_level)
            step = (1 << level) * clock.tick
            progress.n_step += 1
            is_good, may_grow = take_step(
                pairs, curved, tables, reduced.rim_speed, mode, level, step, tolerance, z, z_next, work
            )
            if not is_good:
                if level == 0:
                    return CONTACT_UNSOLVED
                progress.resolved_level = level - 1
                continue
            if may_grow and level >= progress.resolved_level and progress.halving_level < 0:
                progress.resolved_level = level + 1
            progress.is_after_event = 0
            if not is_event_free:
                crossing = closed_crossing(closed, step, work)
        if crossing != 0 and level > 0:
            progress.halving_level = level - 1
            continue
        if is_sample and closed == 0:
            sample_step(tables, clock, level, z_re, z_im, progress, recorder, samples, accumulator)
        if crossing != 0:  # an event within the next tick is taken here
            outcome = take_curved_event(
                tables,
                curved,
                pairs,
                reduced,
                clock,
                crossing,
                is_recorded,
                progress,
                z,
                motion,
                work,
                events,
                recorder,
                samples,
                accumulator,
            )
            if outcome != UNDER_WAY:
                return outcome
            continue
        if closed != 0:
            step = (1 << level) * clock.tick
            if is_recorded:
                angle = shaft_angle(clock, progress.tick) + 0.5 * clock.spin * step
                middle = work.middle
                observe_power(reduced, skew, tables, curved, mode, 1, angle, middle[0], middle[1], work)
                angle += 0.5 * clock.spin * step
                observe_power(reduced, skew, tables, curved, mode, 2, angle, next_re, next_im, work)
                i_sample = progress.tick >> clock.sample_level
                observe_curved_step(
                    reduced, closed, step, i_sample, 1.0 / interval, work, samples, accumulator
                )
            go_on(closed, step, work)
        for k in range(z_re.size):
            z_re[k], z_im[k] = next_re[k], next_im[k]
        progress.tick += 1 << level
        progress.halving_level = max(progress.halving_level - 1, NONE)


@jit_lean_sum
def enter_curved(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    reduced: Reduced,
    clock: Clock,
    found: int,
    progress: Progress,
    z: Floats,
    motion: Floats,
    work: CurvedWork,
) -> bool:
    """Enter contact mode `found` with the reduced motion (2 n,); False where its forces are not found."""
    q, n = reduced.gap_jacobian.shape
    closed = int(tables.mask[found])
    for i in range(q):
        work.h[0, i], work.rate[0, i] = 0.0, 0.0
        if is_closed(closed, i):
            work.h[0, i] = -pairs.clearance[i] - product(pairs.row[i, ALONG], motion[:n])
            work.rate[0, i] = -product(pairs.row[i, ALONG], motion[n:])
    for i in range(q):
        if is_closed(closed, i):
            for k in range(n):
                motion[k] += curved.shift[found, i, k] * work.h[0, i]
                motion[n + k] += curved.shift[found, i, k] * work.rate[0, i]
    angle = shaft_angle(clock, progress.tick)
    enter(tables, found, reduced.clearance, np.cos(angle), np.sin(angle), motion, z)
    progress.mode, progress.wanted, progress.entered = found, NONE, progress.tick
    progress.resolved_level, progress.halving_level, progress.is_after_event = FORCED_LEVEL, NONE, 1
    work.span[0], work.span[1] = 0.0, 0.0
    if closed == 0:
        return True
    return evaluate(pairs, curved, reduced.rim_speed, found, closed, 0, z[0], z[1], work)


@jit_lean_sum
def curved_free_interval(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    mode: int,
    enough: float,
    z_re: Floats,
    z_im: Floats,
    work: CurvedWork,
) -> float:
    """Time, s, in which no gap closes, all being open; it need not be longer than `enough`.

    A gap along the stator's axis is the smaller one. Where it does not do, the gap is continued along its
    momentary normal, below which a convex function of the motion does not go.
    """
    free = event_free_interval(
        tables.switch_re, tables.switch_im, tables.rate_re, tables.rate_im, tables.bound, mode, z_re, z_im
    )
    if free >= enough:
        return free
    d = curved.bound.shape[2]
    read_motion(curved, mode, 0, z_re, z_im, work.motion)
    free = np.inf
    for i in range(pairs.radius.size):
        gap, _ = fill_geometry(pairs, i, d, work)
        rate, bound = 0.0, 0.0
        for j in range(d):
            rate += work.jacobian[i, j] * work.motion[1, i, j]
            bound += abs(work.jacobian[i, j]) * bounded(curved.bound[mode, i, j], z_re, z_im)
        if not gap > 0.0:
            free = 0.0
        elif bound > 0.0:
            free = min(free, (rate + np.sqrt(rate * rate + 2.0 * bound * gap)) / bound)
        elif rate < 0.0:
            free = min(free, -gap / rate)
    return free


@jit_lean_sum
def open_crossing(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    mode: int,
    z_re: Floats,
    z_im: Floats,
    work: CurvedWork,
) -> int:
    """Set of the pairs, all open, whose gap is negative."""
    crossing = int(np.int64(0))
    is_near = False
    for i in range(pairs.radius.size):
        gap = dot(tables.switch_re[mode, i], tables.switch_im[mode, i], z_re, z_im)
        is_near = is_near or gap < -GAP_TOLERANCE
    if not is_near:
        return crossing
    read_motion(curved, mode, 0, z_re, z_im, work.motion)
    for i in range(pairs.radius.size):
        gap, _ = fill_geometry(pairs, i, curved.bound.shape[2], work)
        if gap < -GAP_TOLERANCE:
            crossing |= 1 << i
    return crossing


@jit_lean_sum
def closed_crossing(closed: int, step: float, work: CurvedWork) -> int:
    """Set of the pairs whose force or, of those open, gap is negative at a node of a step (s)."""
    crossing = int(np.int64(0))
    for i in range(work.h.shape[1]):
        if is_closed(closed, i):
            first, middle, last = work.force[0, i], work.force[1, i], work.force[2, i]
            if min(middle, last) < 0.0 or lowest(first, middle, last) < 0.0 < first:
                crossing |= 1 << i
        elif min(work.gap[0, 1, i], work.gap[0, 2, i]) < -GAP_TOLERANCE:
            crossing |= 1 << i
    return crossing


@jit_lean_sum
def lowest(first: float, middle: float, last: float) -> float:
    """Least value of the parabola through the beginning, middle and end of a step, within it."""
    slope, bend = 4.0 * middle - 3.0 * first - last, 2.0 * (first - 2.0 * middle + last)
    if bend > 0.0 and 0.0 < -slope < 2.0 * bend:
        return first - 0.25 * slope * slope / bend
    return min(first, middle, last)


@jit_lean_sum
def take_curved_event(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    reduced: Reduced,
    clock: Clock,
    crossing: int,
    is_recorded: bool,
    progress: Progress,
    z: Floats,
    motion: Floats,
    work: CurvedWork,
    events: EventWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
) -> int:
    """Take the event of the pairs `crossing`, as `event_loop.take_event` does."""
    q = reduced.gap_jacobian.shape[0]
    mode = progress.mode
    closed = int(tables.mask[mode])
    progress.n_event += 1
    place(tables, curved, mode, z[0], z[1], work.h[0], work.rate[0], motion)
    if is_beyond(reduced, motion):
        return DIVERGED
    if is_recorded:
        if closed == 0:
            end_span(tables, clock, z, progress, recorder, accumulator)
        for i in range(q):
            events.impulse[i] = accumulator.impulse[i]
    angle = shaft_angle(clock, progress.tick)
    progress.wanted = change_curved(
        pairs,
        reduced,
        closed,
        crossing,
        clock.spin,
        (1 << FORCED_LEVEL) * clock.tick,
        np.cos(angle),
        np.sin(angle),
        motion,
        is_recorded,
        work,
        events.force,
        events.speed,
        events.active,
        events.elimination,
        accumulator,
    )
    if progress.wanted < 0 or progress.n_event > MOST_EVENTS:
        return CONTACT_UNSOLVED
    if is_recorded:
        for i in range(q):
            record_event(clock, progress, events.impulse, i, samples, accumulator)
            record_touch(i, is_closed(progress.wanted, i), accumulator)
    return UNDER_WAY
