"""The exact modal integrator under set-valued friction: closed-form motion while no pair changes its state.

As `event_loop`, with four states of a pair in place of two: open, sliding in either sense, sticking. Each
pair has two switch functions: gap and 1 (open), normal force and slip in its sense (sliding), or what the
friction has left of its cone on either side (sticking). Beside the coordinates of `event_loop` stand a 1 and,
for each pair that sticks, the displacement along its rim, which grows linearly: the only one that does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_sum
from rubhpc.kernels.accumulators import DRIVE_WORK, FRICTION_LOSS
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
    DYING,
    FORCED_LEVEL,
    RESOLVED,
    SAMPLES_AT_ONCE,
    ModeTables,
    Reduced,
    bounded,
    dot,
    enter,
    find_mode,
    floor_log2,
    is_beyond,
    propagate,
    resolved_time,
)
from rubhpc.kernels.event_loop import GAP_TOLERANCE
from rubhpc.kernels.friction_events import FrictionWork, change_states, observe_states
from rubhpc.kernels.friction_states import BACKWARD, OPEN, STUCK, FrictionBodies, state_of, stuck_pairs
from rubhpc.kernels.measuring import (
    FORCE,
    FORCE_RATE,
    SLIP,
    SLIP_RATE,
    Recorder,
    begin_span,
    end_span,
    take_samples,
    turning_value,
)

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_EVENTS = 4096  # in a revolution; more are left to short steps
# Steps in contact over those of steady sliding: what the rim drives through a pair that sticks is not small
# against what the vibration feels of it.
FINER = 0.25


@jit_sum
def advance_with_friction(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    last_tick: int,
    is_recorded: bool,
    progress: Progress,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    work: FrictionWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
) -> int:
    """Advance a case from the tick reached to `last_tick`, as `event_loop.advance` does.

    `reduced.clearance` (q + 1,) ends with a 1, the coordinate that the steady part of the motion goes with.

    Returns
    -------
    int
        FINISHED, DIVERGED (at an event), MODE_WANTED, PAUSED, or CONTACT_UNSOLVED with the motion in
        `motion`: no forces obey the laws, or events follow one another without end.
    """
    # Tuples are opened here: a field read inside the loop would count a reference at every step.
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    mask, switch_re, switch_im = tables.mask, tables.switch_re, tables.switch_im
    rate_re, rate_im, bound = tables.rate_re, tables.rate_im, tables.bound
    power_re, power_im, n_eigenmode = tables.power_re, tables.power_im, tables.n_eigenmode
    rim_speed = bodies.rim_speed
    q = rim_speed.size
    interval = clock.tick * (1 << clock.sample_level)
    highest_level = power_re.shape[1] - 1
    last_step = progress.n_step + MOST_STEPS
    progress.halving_level, progress.is_after_event = NONE, 0
    if is_recorded and progress.wanted < 0:
        if progress.energy_from < 0:
            begin_span(tables, z, progress, recorder)
        begin_friction(tables, bodies, progress.mode, z, z_next, recorder)
        observe_states(mask[progress.mode], accumulator)
    while True:
        if progress.wanted >= 0:
            found = find_mode(mask, progress.wanted)
            if found < 0:
                return MODE_WANTED
            angle = shaft_angle(clock, progress.tick)
            enter(tables, found, reduced.clearance, np.cos(angle), np.sin(angle), motion, z)
            progress.mode, progress.wanted, progress.entered = found, NONE, progress.tick
            progress.contact_age, progress.halving_level, progress.is_after_event = NONE, NONE, 1
            if is_recorded:
                begin_span(tables, z, progress, recorder)
                begin_friction(tables, bodies, found, z, z_next, recorder)
                observe_states(mask[found], accumulator)
        is_sample = is_recorded and progress.tick == progress.next_sample << clock.sample_level
        if progress.tick >= last_tick:
            if is_recorded and progress.tick == clock.n_sample << clock.sample_level:
                if is_sample:  # it closes the last interval
                    take_samples(
                        tables,
                        progress.mode,
                        z_re,
                        z_im,
                        clock.n_sample,
                        clock.n_sample + 1 - progress.next_sample,
                        interval,
                        recorder,
                        samples,
                        accumulator,
                    )
                end_span(tables, clock, z, progress, recorder, accumulator)
            return FINISHED
        is_at_event = progress.is_after_event == 1 or progress.halving_level >= 0
        if progress.n_step > last_step and not is_at_event:
            return PAUSED
        mode = progress.mode
        states = mask[mode]
        # The longest step up to the next sample that resolves a recorded contact.
        limit = last_tick
        if is_recorded:
            reach = SAMPLES_AT_ONCE if is_sample and states == 0 else 1
            limit = min(limit, ((progress.tick >> clock.sample_level) + reach) << clock.sample_level)
        level = min(highest_level, floor_log2(limit - progress.tick))
        if is_recorded and states != 0:
            # What an event sets off is fast at first: no step is longer than its states have lasted.
            age = floor_log2(max(1, progress.tick - progress.entered))
            if age != progress.contact_age:
                resolved = resolved_friction(tables, mode, z_re, z_im) / clock.tick
                resolved = min(resolved, 1.0 * (1 << highest_level))
                progress.contact_age, progress.resolved_level = age, floor_log2(int(max(1.0, resolved)))
            level = min(level, clock.contact_level, max(age, FORCED_LEVEL), progress.resolved_level)
        is_event_free = False
        if progress.is_after_event == 1:
            progress.is_after_event = 0
            level, is_event_free = min(level, FORCED_LEVEL), True
        elif progress.halving_level >= 0:
            level = min(level, progress.halving_level)
        else:
            free = change_free_interval(
                states, mode, switch_re, switch_im, rate_re, rate_im, bound, z_re, z_im
            )
            while level > clock.search_level and (1 << level) * clock.tick > free:
                level -= 1
            is_event_free = (1 << level) * clock.tick <= free
        step = (1 << level) * clock.tick
        propagate(power_re[mode, level], power_im[mode, level], z_re, z_im, next_re, next_im)
        if stuck_pairs(states) != 0:
            first = n_eigenmode[mode] + 2 + q
            for i in range(q):
                if state_of(states, i) == STUCK:
                    next_re[first + i] += rim_speed[i] * step
        progress.n_step += 1
        crossing = int(np.int64(0))
        if not is_event_free:
            crossing = find_change(states, mode, switch_re, switch_im, next_re, next_im)
        if crossing != 0 and level > 0:
            progress.halving_level = level - 1
            continue
        if is_sample:
            count = max(1, (1 << level) >> clock.sample_level)
            taken = progress.next_sample
            take_samples(tables, mode, z_re, z_im, taken, count, interval, recorder, samples, accumulator)
            progress.next_sample = taken + count
        if crossing != 0:  # an event within the next tick is taken here
            outcome = take_change(
                tables,
                reduced,
                bodies,
                clock,
                crossing,
                is_recorded,
                progress,
                z,
                motion,
                work,
                recorder,
                samples,
                accumulator,
            )
            if outcome != UNDER_WAY:
                return outcome
            continue
        for k in range(z_re.size):
            z_re[k], z_im[k] = next_re[k], next_im[k]
        if is_recorded and states != 0:
            observe_friction(
                tables,
                bodies,
                mode,
                step,
                z_re,
                z_im,
                progress.tick >> clock.sample_level,
                1.0 / interval,
                recorder,
                samples,
                accumulator,
            )
        progress.tick += 1 << level
        progress.halving_level = max(progress.halving_level - 1, NONE)


@jit_inline_sum
def change_free_interval(
    states: int,
    mode: int,
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    bound: Floats,
    z_re: Floats,
    z_im: Floats,
) -> float:
    """Time, s, before which no switch function (2 q, m) of a set of states can reach zero."""
    proved = np.inf
    for j in range(switch_re.shape[1]):
        if j % 2 == 1 and state_of(states, j // 2) == OPEN:
            continue
        s = dot(switch_re[mode, j], switch_im[mode, j], z_re, z_im)
        rate = dot(rate_re[mode, j], rate_im[mode, j], z_re, z_im)
        b = bounded(bound[mode, j], z_re, z_im)
        if not s > 0.0:
            proved = 0.0
        elif b > 0.0:
            proved = min(proved, (rate + np.sqrt(rate * rate + 2.0 * b * s)) / b)
        elif rate < 0.0:
            proved = min(proved, -s / rate)
    return proved


@jit_inline_sum
def find_change(
    states: int, mode: int, switch_re: Floats, switch_im: Floats, z_re: Floats, z_im: Floats
) -> int:
    """Bits of the switch functions (2 q, m) of a set of states that are negative."""
    crossing = int(np.int64(0))
    for j in range(switch_re.shape[1]):
        is_open = state_of(states, j // 2) == OPEN
        if is_open and j % 2 == 1:
            continue
        if dot(switch_re[mode, j], switch_im[mode, j], z_re, z_im) < (-GAP_TOLERANCE if is_open else 0.0):
            crossing |= 1 << j
    return crossing


@jit_sum
def take_change(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    crossing: int,
    is_recorded: bool,
    progress: Progress,
    z: Floats,
    motion: Floats,
    work: FrictionWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
) -> int:
    """Take the event of the switch functions `crossing`: what it makes of `motion`, and the states wanted.

    Returns
    -------
    int
        UNDER_WAY, DIVERGED or CONTACT_UNSOLVED.
    """
    q, n = reduced.gap_jacobian.shape
    mode = progress.mode
    if progress.tick - progress.counted_from > clock.samples_per_revolution << clock.sample_level:
        progress.counted_from, progress.n_event = progress.tick, 0
    progress.n_event += 1
    for k in range(2 * n):
        motion[k] = dot(tables.motion_re[mode, k], tables.motion_im[mode, k], z[0], z[1])
    if is_beyond(reduced, motion):
        return DIVERGED
    if is_recorded:
        end_span(tables, clock, z, progress, recorder, accumulator)
        work.impulse[:] = accumulator.impulse
    angle = shaft_angle(clock, progress.tick)
    wanted = change_states(
        reduced,
        bodies,
        tables.mask[mode],
        crossing,
        (1 << FORCED_LEVEL) * clock.tick,
        np.cos(angle),
        np.sin(angle),
        motion,
        is_recorded,
        work,
        accumulator,
    )
    if is_recorded:
        interval = clock.tick * (1 << clock.sample_level)
        for i in range(q):
            gained = accumulator.impulse[i] - work.impulse[i]
            samples.force[i, progress.tick >> clock.sample_level] += gained / interval
            if wanted >= 0:
                is_closed = state_of(wanted, i) != OPEN
                accumulator.n_contact[i] += 1 if is_closed and not accumulator.is_touching[i] else 0
                accumulator.is_touching[i] = is_closed
    if wanted < 0 or progress.n_event > MOST_EVENTS:
        return CONTACT_UNSOLVED
    progress.wanted = wanted
    return UNDER_WAY


@jit_inline_sum
def read_friction(
    tables: ModeTables, bodies: FrictionBodies, mode: int, i: int, z_re: Floats, z_im: Floats
) -> tuple[float, float, float, float]:
    """Normal force (N) of closed pair i, its rate, slip speed (m/s) and its rate.

    Where the pair sticks, the last two are its friction (N) and its rate.
    """
    a = dot(tables.switch_re[mode, 2 * i], tables.switch_im[mode, 2 * i], z_re, z_im)
    b = dot(tables.switch_re[mode, 2 * i + 1], tables.switch_im[mode, 2 * i + 1], z_re, z_im)
    a_rate = dot(tables.rate_re[mode, 2 * i], tables.rate_im[mode, 2 * i], z_re, z_im)
    b_rate = dot(tables.rate_re[mode, 2 * i + 1], tables.rate_im[mode, 2 * i + 1], z_re, z_im)
    state = state_of(tables.mask[mode], i)
    if state == STUCK:
        share = 0.5 / bodies.static[i]
        return share * (a + b), share * (a_rate + b_rate), 0.5 * (b - a), 0.5 * (b_rate - a_rate)
    sense = -1.0 if state == BACKWARD else 1.0
    return a, a_rate, sense * b, sense * b_rate


@jit_sum
def resolved_friction(tables: ModeTables, mode: int, z_re: Floats, z_im: Floats) -> float:
    """Time, s, over which cubics follow the switch functions of the pairs closed in contact mode `mode`."""
    time = np.inf
    for i in range(tables.switch_re.shape[1] // 2):
        state = state_of(tables.mask[mode], i)
        if state == OPEN:
            continue
        pace = tables.pace[mode]
        for j in range(2 * i, 2 * i + 2):
            re, im = tables.switch_re[mode, j], tables.switch_im[mode, j]
            if state == STUCK or j == 2 * i:
                time = min(time, resolved_time(re, im, pace, z_re, z_im))
                continue
            size, bend = 0.0, 0.0  # of the slip, but for that of the steady spin
            for k in range(z_re.size):
                if pace[k] > 0.0:
                    share = np.sqrt((re[k] * re[k] + im[k] * im[k]) * (z_re[k] * z_re[k] + z_im[k] * z_im[k]))
                    size += share
                    square = pace[k] * pace[k]
                    bend += share * square * square
            if bend > 0.0:
                time = min(time, (RESOLVED * size / bend) ** 0.25)
    return time * FINER


@jit_sum
def begin_friction(
    tables: ModeTables, bodies: FrictionBodies, mode: int, z: Floats, calm: Floats, recorder: Recorder
) -> None:
    """Read the closed pairs in contact mode `mode`, at its beginning or where a record begins.

    What dies before the first step ends is left out: no cubic follows it. `calm` (2, m) is work space.
    """
    for k in range(z.shape[1]):
        dies = tables.pace[mode, k] == DYING
        calm[0, k], calm[1, k] = (0.0, 0.0) if dies else (z[0, k], z[1, k])
    for i in range(bodies.rim_speed.size):
        if state_of(tables.mask[mode], i) != OPEN:
            force, rate, across, across_rate = read_friction(tables, bodies, mode, i, calm[0], calm[1])
            recorder.node[FORCE, i], recorder.node[FORCE_RATE, i] = force, rate
            recorder.node[SLIP, i], recorder.node[SLIP_RATE, i] = across, across_rate


@jit_inline_sum
def observe_friction(
    tables: ModeTables,
    bodies: FrictionBodies,
    mode: int,
    step: float,
    z_re: Floats,
    z_im: Floats,
    i_sample: int,
    share: float,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
) -> None:
    """Add a step (s) of the closed pairs: forces and slip as cubics, Simpson's rule for friction.

    `z` are the coordinates at its end; `share` (1/s) takes an impulse to the mean force of sample `i_sample`.
    """
    for i in range(bodies.rim_speed.size):
        state = state_of(tables.mask[mode], i)
        if state == OPEN:
            continue
        before, rate_before = recorder.node[FORCE, i], recorder.node[FORCE_RATE, i]
        across_before, across_rate_before = recorder.node[SLIP, i], recorder.node[SLIP_RATE, i]
        after, rate_after, across_after, across_rate_after = read_friction(
            tables, bodies, mode, i, z_re, z_im
        )
        recorder.node[FORCE, i], recorder.node[FORCE_RATE, i] = after, rate_after
        recorder.node[SLIP, i], recorder.node[SLIP_RATE, i] = across_after, across_rate_after
        bend = step * (rate_before - rate_after)
        impulse = step * (0.5 * (before + after) + bend / 12.0)
        peak = max(before, after)
        if rate_before * rate_after < 0.0:
            peak = max(peak, turning_value(before, rate_before, after, rate_after, step))
        samples.force[i, i_sample] += impulse * share
        accumulator.contact_time[i] += step
        accumulator.impulse[i] += impulse
        accumulator.peak_force[i] = max(accumulator.peak_force[i], peak)
        across_bend = step * (across_rate_before - across_rate_after)
        if state == STUCK:
            rubbed = step * (0.5 * (across_before + across_after) + across_bend / 12.0)
            accumulator.stick_time[i] += step
            accumulator.least_slip[i] = min(accumulator.least_slip[i], 0.0)
        else:
            sense = -1.0 if state == BACKWARD else 1.0
            rubbed = sense * bodies.sliding[i] * impulse
            middle = 0.5 * (before + after) + 0.125 * bend
            across_middle = 0.5 * (across_before + across_after) + 0.125 * across_bend
            work = before * across_before + 4.0 * middle * across_middle + after * across_after
            friction_work = sense * bodies.sliding[i] * work * step / 6.0
            accumulator.friction_work[i] += friction_work
            accumulator.energy[FRICTION_LOSS] += friction_work
            accumulator.least_slip[i] = min(accumulator.least_slip[i], across_before, across_after)
        accumulator.energy[DRIVE_WORK] += bodies.rim_speed[i] * rubbed
