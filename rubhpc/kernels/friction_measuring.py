"""What is measured of spans between events under set-valued friction, contact mode by contact mode.

A span is one linear piece of a motion, so that nothing is measured step by step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.accumulators import observe_force
from rubhpc.kernels.case_progress import Clock, Progress  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE, ModeTables
from rubhpc.kernels.event_search import move_ticks
from rubhpc.kernels.force_average import AVERAGING_TIME
from rubhpc.kernels.friction_coordinates import used_width
from rubhpc.kernels.friction_spans import (
    AFTER,
    BEFORE,
    IMPULSE,
    MOST,
    copy_coordinates,
    forget_spans,
)
from rubhpc.kernels.friction_states import OPEN, FrictionBodies, state_of
from rubhpc.kernels.peak_search import follow_force, recent_impulse
from rubhpc.kernels.sampling import Recorder, read_samples, widen_extrema
from rubhpc.kernels.span_energies import add_losses, add_rubs
from rubhpc.kernels.span_forces import begin_force, pass_force
from rubhpc.kernels.span_samples import read_noted
from rubhpc.kernels.transitions import Transitions  # noqa: TC001 - part of a kernel's signature

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples

Floats = NDArray[np.float64]


@linked_sum
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
        mode, n_alike = spans.mode[first], 0
        if mode < 0:
            continue
        for s in range(first, n_span):
            if spans.mode[s] == mode:
                spans.alike[n_alike] = s
                n_alike += 1
                spans.mode[s] = -1 - mode
        add_losses(tables, clock, mode, n_alike, recorder, accumulator, transitions)
        observe_parts(
            tables, bodies, clock, mode, n_alike, first_sample, recorder, samples, accumulator, transitions
        )
        add_rubs(tables, bodies, clock, mode, n_alike, spans, accumulator, transitions)
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


@linked_sum
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


@linked_sum
def observe_parts(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    mode: int,
    n_alike: int,
    first_sample: int,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
    transitions: Transitions,
) -> None:
    """Read the samples of the spans `alike` in a contact mode, and the forces in the parts between them.

    `first_sample` is the first one of all spans. Outputs that are tabulated by rows are read for several
    samples at once, others one by one, or ahead while no pair is closed.
    """
    spans, level, is_tabulated = recorder.spans, clock.sample_level, False
    if transitions.mode.size > 0:
        is_tabulated = transitions.output[mode] >= 0
    states, n_row = tables.mask[mode], recorder.value.size // SAMPLES_AT_ONCE
    used, interval, n_noted = used_width(tables, mode), clock.tick * (1 << level), 0
    at_once = 1
    if states == 0 and not is_tabulated:
        at_once = min(SAMPLES_AT_ONCE, max(1, (1 << (tables.power_re.shape[1] - 1)) >> level))
    for place in range(n_alike):
        s = spans.alike[place]
        begin, end = spans.tick[s, 0], spans.tick[s, 1]
        time = (end - begin) * clock.tick
        here, spare = spans.path[0], spans.path[1]
        copy_coordinates(spans.begun[s], here)
        if not is_tabulated:
            copy_coordinates(here, spare)
        for i in range(bodies.rim_speed.size):
            if state_of(states, i) != OPEN:
                begin_force(tables, bodies, mode, i, time, min(time, interval), here, spans.pair[s, i])
        now, part = begin, spans.first[s]
        while now < end:
            following = (now >> level) + 1
            if now == (now >> level) << level and now >> level >= first_sample:
                sample = now >> level
                if is_tabulated:
                    if n_noted == SAMPLES_AT_ONCE:
                        read_noted(transitions, mode, n_noted, used, n_row, first_sample, spans, samples)
                        n_noted = 0
                    spans.sample[n_noted] = sample
                    copy_used(used, here, spans.point[n_noted])
                    n_noted += 1
                else:
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
                    at, following = (sample - first_sample) * n_row, sample + count
                    for k in range(count * n_row):
                        spans.value[at + k] = recorder.value[k]
            stop = min(end, following << level)
            there = spare
            if stop == end:
                there = spans.ended[s]
            else:
                move_ticks(tables, bodies, mode, stop - now, clock.tick, here, spare)
            if states != 0:
                since, until = (now - begin) * clock.tick, (stop - begin) * clock.tick
                for i in range(bodies.rim_speed.size):
                    if state_of(states, i) == OPEN:
                        continue
                    pair, force, is_last = spans.pair[s, i], spans.force[part, i], stop == end
                    pass_force(tables, bodies, mode, i, since, until, is_last, there, pair, force)
                    samples.force[i, now >> level] += force[IMPULSE] / interval
                    accumulator.impulse[i] += force[IMPULSE]
            here, spare, now, part = there, here, stop, part + 1
    if n_noted > 0:
        read_noted(transitions, mode, n_noted, used, n_row, first_sample, spans, samples)


@linked_sum
def copy_used(used: int, z: Floats, target: Floats) -> None:
    """Copy the coordinates (2, m) that are used."""
    for part in range(2):
        for k in range(used):
            target[part, k] = z[part, k]
