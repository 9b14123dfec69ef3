"""What is measured of spans between events under set-valued friction, contact mode by contact mode.

A span is one linear piece of a motion, so that nothing is measured step by step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.kernels._jit import jit_inline_sum, jit_part_sum
from rubhpc.kernels.accumulators import DAMPING_LOSS, observe_force, observe_rub
from rubhpc.kernels.case_progress import Clock, Progress  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE, ModeTables
from rubhpc.kernels.event_search import move_ticks
from rubhpc.kernels.force_average import AVERAGING_TIME
from rubhpc.kernels.friction_coordinates import add_energies
from rubhpc.kernels.friction_spans import (
    AFTER,
    BEFORE,
    FRICTION,
    IMPULSE,
    MOST,
    copy_coordinates,
    forget_spans,
)
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies, state_of
from rubhpc.kernels.friction_work import rub_through
from rubhpc.kernels.peak_search import follow_force, recent_impulse
from rubhpc.kernels.sampling import Recorder, read_samples, widen_extrema
from rubhpc.kernels.span_forces import begin_force, pass_force
from rubhpc.kernels.transitions import Transitions  # noqa: TC001 - part of a kernel's signature

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples


@jit_part_sum
def observe_spans(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    progress: Progress,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
    transitions: Transitions,
) -> None:
    """Measure the spans that are kept: samples, energies, forces and friction, and make room for others."""
    spans, near = recorder.spans, int(AVERAGING_TIME / clock.tick) + 1
    n_span, level, n_part, first_sample = spans.noted[0], clock.sample_level, 0, progress.next_sample
    for s in range(n_span):
        spans.first[s] = n_part
        begin, end = spans.tick[s, 0], spans.tick[s, 1]
        n_part += ((end - 1) >> level) - (begin >> level) + 1 if end > begin else 0
    spans.first[n_span] = n_part
    for first in range(n_span):
        mode = spans.mode[first]
        if mode < 0:
            continue
        for s in range(first, n_span):
            if spans.mode[s] == mode:
                observe_span(
                    tables, bodies, clock, s, first_sample, recorder, samples, accumulator, transitions
                )
                spans.mode[s] = -1 - mode
    if n_span > 0:
        last = spans.tick[n_span - 1, 1]
        progress.next_sample = max(first_sample, ((last - 1) >> level) + 1)
    watch_samples(clock, progress.next_sample - first_sample, recorder, accumulator)
    for s in range(n_span):
        mode = -1 - spans.mode[s]
        now, end, states = spans.tick[s, 0], spans.tick[s, 1], tables.mask[mode]
        for part in range(spans.first[s], spans.first[s + 1]):
            stop = min(end, ((now >> level) + 1) << level)
            for i in range(bodies.rim_speed.size):
                if state_of(states, i) == OPEN:
                    continue
                force, begin, time = spans.force[part, i], now * clock.tick, (stop - now) * clock.tick
                peak, hit = accumulator.peak_force[i], recent_impulse(i, begin, accumulator)
                hits = spans.given[s, i] if stop == end else 0.0
                is_high = force[MOST] > peak
                if is_high or (hit + hits > 0.0 and force[MOST] + (hit + hits) / AVERAGING_TIME > peak):
                    # A mean over an impact has its impulse too: the force is followed near that.
                    calm_from = stop if is_high else now + near * (hit > 0.0)
                    calm_to = stop - near * (hits > 0.0)
                    follow_force(
                        tables,
                        bodies,
                        clock,
                        mode,
                        s,
                        i,
                        now,
                        stop,
                        calm_from,
                        calm_to,
                        recorder,
                        accumulator,
                    )
                else:
                    observe_force(i, begin, time, force[IMPULSE], force[BEFORE], force[AFTER], accumulator)
            now = stop
        for i in range(bodies.rim_speed.size):
            if spans.given[s, i] != 0.0:
                observe_force(i, end * clock.tick, 0.0, spans.given[s, i], 0.0, 0.0, accumulator)
    forget_spans(spans)


@jit_inline_sum
def watch_samples(clock: Clock, n_sample: int, recorder: Recorder, accumulator: Accumulator) -> None:
    """Widen the extrema by the samples of the spans."""
    n_row, interval = recorder.value.size // SAMPLES_AT_ONCE, clock.tick * (1 << clock.sample_level)
    for first in range(0, n_sample, SAMPLES_AT_ONCE):
        widen_extrema(
            recorder.spans.value[first * n_row : (first + SAMPLES_AT_ONCE) * n_row],
            min(SAMPLES_AT_ONCE, n_sample - first),
            interval,
            recorder.last,
            accumulator.lowest,
            accumulator.highest,
            accumulator.peak_lateral,
        )


@jit_inline_sum
def observe_span(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    s: int,
    first_sample: int,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
    transitions: Transitions,
) -> None:
    """Measure span s, in one contact mode all along; `first_sample` is the first one of all spans.

    Of drive and friction together `add_energies` knows the work in closed form, and counts it with the
    damping: what is added to them here is taken off there.
    """
    spans, level = recorder.spans, clock.sample_level
    mode, begin, end = spans.mode[s], spans.tick[s, 0], spans.tick[s, 1]
    states, n_row = tables.mask[mode], recorder.value.size // SAMPLES_AT_ONCE
    time, interval = (end - begin) * clock.tick, clock.tick * (1 << level)
    add_energies(tables, mode, time, spans.begun[s], spans.ended[s], recorder, accumulator, transitions)
    here, spare, at_once = spans.path[0], spans.path[1], 1
    copy_coordinates(spans.begun[s], here)
    copy_coordinates(here, spare)
    if states == 0:
        at_once = min(SAMPLES_AT_ONCE, max(1, (1 << (tables.power_re.shape[1] - 1)) >> level))
    else:
        for i in range(bodies.rim_speed.size):
            if state_of(states, i) != OPEN:
                begin_force(tables, bodies, mode, i, time, min(time, interval), here, spans.pair[i])
    now, part = begin, spans.first[s]
    while now < end:
        following = (now >> level) + 1
        if now == (now >> level) << level and now >> level >= first_sample:
            sample = now >> level
            count = min(at_once, ((end - 1) >> level) + 1 - sample)
            read_samples(
                tables.output,
                mode,
                here[0],
                here[1],
                sample,
                count,
                recorder.value,
                samples.rotor,
                samples.axial,
                samples.lateral,
                samples.probe,
            )
            place, following = (sample - first_sample) * n_row, sample + count
            for k in range(count * n_row):
                spans.value[place + k] = recorder.value[k]
        stop = min(end, following << level)
        there = spare
        if stop == end:
            there = spans.ended[s]
        else:
            move_ticks(tables, bodies, mode, stop - now, clock.tick, here, spare)
        if states != 0:
            since, until = (now - begin) * clock.tick, (stop - begin) * clock.tick
            for i in range(bodies.rim_speed.size):
                state = state_of(states, i)
                if state == OPEN:
                    continue
                pair, force, is_last = spans.pair[i], spans.force[part, i], stop == end
                pass_force(tables, bodies, mode, i, since, until, is_last, there, pair, force)
                samples.force[i, now >> level] += force[IMPULSE] / interval
                accumulator.impulse[i] += force[IMPULSE]
        here, spare, now, part = there, here, stop, part + 1
    if states == 0 or time == 0.0:
        return
    for i in range(bodies.rim_speed.size):
        state = state_of(states, i)
        if state == OPEN:
            continue
        accumulator.contact_time[i] += time
        if state == STUCK:
            accumulator.stick_time[i] += time
            accumulator.least_slip[i] = min(accumulator.least_slip[i], 0.0)
            drive, friction_work = bodies.rim_speed[i] * spans.pair[i, FRICTION], 0.0
        else:
            sense = -1.0 if state == BACKWARD else 1.0
            impulse, work, least, most = rub_through(
                tables, bodies, clock, mode, i, end - begin, spans.begun[s], spans.ended[s], spans.path
            )
            friction_work = bodies.sliding[i] * work
            drive = sense * bodies.sliding[i] * bodies.rim_speed[i] * impulse
            slip = max(least, 0.0) if state == FORWARD else -most
            accumulator.least_slip[i] = min(accumulator.least_slip[i], slip)
            accumulator.friction_work[i] += friction_work
        observe_rub(drive, friction_work, accumulator)
        accumulator.energy[DAMPING_LOSS] += drive - friction_work
