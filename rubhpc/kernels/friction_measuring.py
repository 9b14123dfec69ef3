"""What is measured of a span between events under set-valued friction.

It is one linear piece of a motion, so that nothing is measured step by step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.accumulators import DAMPING_LOSS, observe_force, observe_rub
from rubhpc.kernels.case_progress import Clock, Progress  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE, ModeTables, copy_coordinates
from rubhpc.kernels.event_search import move_ticks
from rubhpc.kernels.force_average import AVERAGING_TIME
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies, state_of
from rubhpc.kernels.friction_work import rub_through
from rubhpc.kernels.measuring import end_span
from rubhpc.kernels.peak_search import follow_force, recent_impulse
from rubhpc.kernels.sampling import Measured, take_samples
from rubhpc.kernels.span_forces import RUBBED, begin_force, pass_force

Floats = NDArray[np.float64]


@linked_sum
def observe_span(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    z: Floats,
    progress: Progress,
    measured: Measured,
) -> None:
    """Measure the span from `progress.energy_from` to now, at coordinates (2, m); none is under way then."""
    recorder, accumulator = measured.recorder, measured.accumulator
    mode, begin, end, given = progress.mode, progress.energy_from, progress.tick, recorder.given
    end_span(tables, clock, z, progress, measured)
    if end > begin:
        pass_parts(tables, bodies, clock, begin, z, progress, measured)
        add_rubs(tables, bodies, clock, mode, end - begin, z, measured)
    for i in range(given.size):
        if given[i] != 0.0:
            observe_force(i, end * clock.tick, 0.0, given[i], 0.0, 0.0, accumulator)
            given[i] = 0.0


@linked_sum
def pass_parts(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    begin: int,
    z: Floats,
    progress: Progress,
    measured: Measured,
) -> None:
    """Read the samples of the span, and the forces in the parts between them.

    Samples are read one by one, or ahead while no pair is closed.
    """
    recorder, samples, accumulator = measured.recorder, measured.samples, measured.accumulator
    mode, end, level = progress.mode, progress.tick, clock.sample_level
    states, interval, at_once = tables.mask[mode], clock.tick * (1 << level), 1
    if states == 0:
        at_once = min(SAMPLES_AT_ONCE, max(1, (1 << (tables.power_re.shape[1] - 1)) >> level))
    here, spare, time = recorder.path[0], recorder.path[1], (end - begin) * clock.tick
    copy_coordinates(recorder.begun, here)
    copy_coordinates(here, spare)
    for i in range(bodies.rim_speed.size):
        if state_of(states, i) != OPEN:
            begin_force(tables, bodies, mode, i, time, min(time, interval), here, recorder.pair[i])
    now = begin
    while now < end:
        sample, following = now >> level, (now >> level) + 1
        if now == sample << level and sample >= progress.next_sample:
            count = min(at_once, ((end - 1) >> level) + 1 - sample)
            take_samples(tables, mode, here[0], here[1], sample, count, interval, measured)
            following = progress.next_sample = sample + count
        stop, there = min(end, following << level), z
        if stop < end:
            there = spare
            move_ticks(tables, bodies, mode, stop - now, clock.tick, here, there)
        for i in range(bodies.rim_speed.size):
            if state_of(states, i) != OPEN:
                impulse = pass_part(
                    tables, bodies, clock, mode, i, begin, now, stop, end, here, there, measured
                )
                samples.force[i, sample] += impulse / interval
                accumulator.impulse[i] += impulse
        here, spare, now = there, here, stop


@linked_sum
def pass_part(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    mode: int,
    i: int,
    begin: int,
    now: int,
    stop: int,
    end: int,
    here: Floats,
    there: Floats,
    measured: Measured,
) -> float:
    """Add the force of closed pair i between two ticks, from `now` to `stop`, of a span; its impulse, N s."""
    recorder, accumulator = measured.recorder, measured.accumulator
    near = int(AVERAGING_TIME / clock.tick) + 1
    before, after, impulse, most = pass_force(
        tables,
        bodies,
        mode,
        i,
        (now - begin) * clock.tick,
        (stop - begin) * clock.tick,
        stop == end,
        there,
        recorder.pair[i],
    )
    time, peak = now * clock.tick, accumulator.peak_force[i]
    hit, hits = recent_impulse(i, time, accumulator), recorder.given[i] if stop == end else 0.0
    is_high = most > peak
    if is_high or (hit + hits > 0.0 and most + (hit + hits) / AVERAGING_TIME > peak):
        # A mean over an impact has its impulse too: the force is followed near that.
        calm_from = stop if is_high else now + near * (hit > 0.0)
        calm_to = stop - near * (hits > 0.0)
        follow_force(tables, bodies, clock, mode, i, begin, now, stop, calm_from, calm_to, here, measured)
    else:
        observe_force(i, time, (stop - now) * clock.tick, impulse, before, after, accumulator)
    return impulse


@linked_sum
def add_rubs(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    mode: int,
    n_tick: int,
    z: Floats,
    measured: Measured,
) -> None:
    """Add times of contact, slips and works of friction in the span of `n_tick` ticks that ends with `z`.

    Of drive and friction together the damping of the tables knows the work in closed form, and counts it as
    its own: what is added to them here is taken off there.
    """
    recorder, accumulator = measured.recorder, measured.accumulator
    time = n_tick * clock.tick
    for i in range(bodies.rim_speed.size):
        state, rubbed = state_of(tables.mask[mode], i), recorder.pair[i, RUBBED]
        if state == OPEN:
            continue
        accumulator.contact_time[i] += time
        if state == STUCK:
            accumulator.stick_time[i] += time
            accumulator.least_slip[i] = min(accumulator.least_slip[i], 0.0)
            drive, friction_work = bodies.rim_speed[i] * rubbed, 0.0
        else:
            sense = -1.0 if state == BACKWARD else 1.0
            work, least, most = rub_through(
                tables, bodies, clock, mode, i, n_tick, recorder.begun, z, recorder.path
            )
            slip = max(least, 0.0) if state == FORWARD else -most
            accumulator.least_slip[i] = min(accumulator.least_slip[i], slip)
            friction_work = bodies.sliding[i] * work
            drive = sense * bodies.sliding[i] * bodies.rim_speed[i] * rubbed
            accumulator.friction_work[i] += friction_work
        observe_rub(drive, friction_work, accumulator)
        accumulator.energy[DAMPING_LOSS] += drive - friction_work
