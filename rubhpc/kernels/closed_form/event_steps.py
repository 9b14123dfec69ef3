"""Common parts of the event-driven loops: enter a contact mode, choose a step, record it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.accumulators import observe_force
from rubhpc.kernels.case_progress import NONE, Clock, Coordinates, Progress, Sections, shaft_turn
from rubhpc.kernels.closed_form.measuring import end_span
from rubhpc.kernels.closed_form.mode_change import GAP_TOLERANCE
from rubhpc.kernels.contact_modes import (
    FORCED_LEVEL,
    SAMPLES_AT_ONCE,
    ModeTables,
    Reduced,
    enter,
    enter_rest,
    find_mode,
    is_beyond,
    is_within,
    leave,
)
from rubhpc.kernels.coordinate_steps import floor_log2
from rubhpc.kernels.sampling import Measured, take_samples

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples

Floats = NDArray[np.float64]


@linked_sum
def enter_wanted(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    progress: Progress,
    motion: Floats,
    z: Floats,
) -> bool:
    """Enter the contact mode wanted with the reduced motion (2 n,); False where the mode is not tabulated."""
    found = find_mode(tables.mask, progress.wanted)
    if found < 0:
        return False
    cosine, sine = shaft_turn(clock, progress.tick)
    enter(tables, found, reduced.clearance, cosine, sine, motion, z)
    if reduced.overlap > GAP_TOLERANCE:
        enter_rest(
            tables.motion_re[found],
            tables.motion_im[found],
            tables.enter_re[found],
            tables.enter_im[found],
            motion,
            z,
        )
    progress.mode, progress.wanted, progress.entered = found, NONE, progress.tick
    progress.contact_age, progress.halving_level, progress.is_after_event = NONE, NONE, 1
    return True


@linked_sum
def longest_step(
    clock: Clock, last_tick: int, highest_level: int, is_recorded: bool, is_ahead: bool, tick: int
) -> int:
    """Level of the longest step from a tick, up to the end and to the next sample of a record.

    With `is_ahead`, samples are read from the beginning of the step, which may pass several of them.
    """
    reach = last_tick
    if is_recorded:
        n_ahead = SAMPLES_AT_ONCE if is_ahead else 1
        reach = min(reach, ((tick >> clock.sample_level) + n_ahead) << clock.sample_level)
    return min(highest_level, floor_log2(reach - tick))


@linked_sum
def contact_age(progress: Progress) -> int:
    """Level of the time since the last change of contacts.

    Vibration after an event is fast at first: no recorded step is longer than the age of the contact.
    """
    return floor_log2(max(1, progress.tick - progress.entered))


@linked_sum
def note_resolved(resolved: float, clock: Clock, highest_level: int, age: int, progress: Progress) -> None:
    """Store the time (s) that resolves the contacts, at the level `age` of their duration."""
    ticks = min(resolved / clock.tick, 1.0 * (1 << highest_level))
    progress.contact_age, progress.resolved_level = age, floor_log2(int(max(1.0, ticks)))


@linked_sum
def choose_step(clock: Clock, progress: Progress, longest: int, interval: float) -> tuple[int, bool]:
    """Level of the next step, at most `longest`, and whether it is certainly free of events.

    While a gap is open or a force compressive, the switch function s satisfies `s + s' t - b t^2 / 2 > 0` for
    an `interval` (s), with the bound b on its second derivative: steps within it miss no event. Event-search
    steps of up to `2^search_level` ticks need no bound; they are checked at their end.
    """
    level, is_event_free = longest, False
    if progress.is_after_event == 1:
        progress.is_after_event = 0
        level, is_event_free = min(longest, FORCED_LEVEL), True
    elif progress.halving_level >= 0:
        level = min(longest, progress.halving_level)
    else:
        while level > clock.search_level and (1 << level) * clock.tick > interval:
            level -= 1
        is_event_free = (1 << level) * clock.tick <= interval
    return level, is_event_free


@linked_sum
def sample_step(
    tables: ModeTables,
    clock: Clock,
    level: int,
    z_re: Floats,
    z_im: Floats,
    progress: Progress,
    measured: Measured,
) -> None:
    """Record the samples within a step, from the coordinates at its beginning, the first sample."""
    count = max(1, (1 << level) >> clock.sample_level)
    interval = clock.tick * (1 << clock.sample_level)
    first = progress.next_sample
    take_samples(tables, progress.mode, z_re, z_im, first, count, interval, measured)
    progress.next_sample = first + count


@linked_sum
def end_record(
    tables: ModeTables,
    clock: Clock,
    is_sample: bool,
    z: Floats,
    progress: Progress,
    measured: Measured,
) -> None:
    """Close the record at its end: the last interval between samples, and the energies."""
    if end_samples(tables, clock, is_sample, z, progress, measured):
        end_span(tables, clock, z, progress, measured)


@linked_sum
def end_samples(
    tables: ModeTables,
    clock: Clock,
    is_sample: bool,
    z: Floats,
    progress: Progress,
    measured: Measured,
) -> bool:
    """Close the last interval between samples; returns whether the record ends at the current tick."""
    is_end = progress.tick == clock.n_sample << clock.sample_level
    if is_end and is_sample:
        count = clock.n_sample + 1 - progress.next_sample
        interval = clock.tick * (1 << clock.sample_level)
        take_samples(tables, progress.mode, z[0], z[1], clock.n_sample, count, interval, measured)
    return bool(is_end)


@linked_sum
def note_section(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    progress: Progress,
    z: Floats,
    accumulator: Accumulator,
    sections: Sections,
) -> bool:
    """Keep the motion at the end of a revolution, if motions are kept; returns whether another one follows.

    None does after tick 0, nor where the motion is beyond the limits.
    """
    if sections.motion.shape[0] == 0:
        return False
    k = sections.motion.shape[0] - 1 + progress.tick // (clock.samples_per_revolution << clock.sample_level)
    leave(tables, progress.mode, z, sections.motion[k])
    return progress.tick < 0 and is_within(
        sections.motion[k],
        reduced.translations,
        reduced.stiffness,
        accumulator.highest,
        accumulator.lowest,
        reduced.displacement_limit,
        sections.energy_limit,
    )


@linked_sum
def leave_mode(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    impulse: Floats,
    measured: Measured,
) -> bool:
    """Leave the contact mode at an event: fill the reduced motion and the `impulse` (q,), N s, so far.

    Returns False where the motion diverges.
    """
    leave(tables, progress.mode, coordinates.z, coordinates.motion)
    return end_mode(tables, reduced, clock, is_recorded, progress, coordinates, impulse, measured)


@linked_sum
def end_mode(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    impulse: Floats,
    measured: Measured,
) -> bool:
    """Continue after `leave_mode` has filled the motion, with the coordinates at the end of the span."""
    count_event(clock, progress)
    if is_beyond(reduced, coordinates.motion):
        return False
    if is_recorded:
        end_span(tables, clock, coordinates.z, progress, measured)
        for i in range(impulse.size):
            impulse[i] = measured.accumulator.impulse[i]
    return True


@linked_sum
def count_event(clock: Clock, progress: Progress) -> None:
    """Count an event of a revolution; the count restarts with the first event after it."""
    if progress.tick - progress.counted_from > clock.samples_per_revolution << clock.sample_level:
        progress.counted_from, progress.n_event = progress.tick, 0
    progress.n_event += 1


@linked_sum
def record_event(
    clock: Clock, progress: Progress, before: Floats, i: int, samples: Samples, accumulator: Accumulator
) -> None:
    """Add the impulse of pair i at an event to the means of its force; `before` (q,) are impulses, N s."""
    interval = clock.tick * (1 << clock.sample_level)
    gained = accumulator.impulse[i] - before[i]
    samples.force[i, progress.tick >> clock.sample_level] += gained / interval
    if gained != 0.0:
        observe_force(i, progress.tick * clock.tick, 0.0, gained, 0.0, 0.0, accumulator)


@linked_sum
def record_touch(i: int, is_closed: bool, accumulator: Accumulator) -> None:
    """Count a contact of pair i where an event closes it."""
    accumulator.n_contact[i] += 1 if is_closed and not accumulator.is_touching[i] else 0
    accumulator.is_touching[i] = is_closed
