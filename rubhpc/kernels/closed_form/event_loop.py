"""The exact modal integrator: closed-form motion between events, whatever touches.

As long as the set of closed contacts does not change, rotor and stators are one linear system: with the
contacts of the set closed, their gaps are held and the contact forces follow. Its motion is a sum of
exponentials, here one complex coordinate z a mode, to which the steady unbalance response (exponent i spin)
and a constant (exponent 0) are appended. A step of any length is then one complex product a mode. What is
left is to find when a gap closes or a force vanishes, to the nanosecond, and to go over to the next set:
impact (inelastic, as the paper's scheme has it), then the set whose forces are all compressive.

Times are whole ticks; the exponentials of 1, 2, 4, ... ticks are tabulated, so no step evaluates one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
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
from rubhpc.kernels.closed_form.contact_event import begin_mode, take_event
from rubhpc.kernels.closed_form.event_steps import (
    choose_step,
    contact_age,
    end_record,
    longest_step,
    note_resolved,
    note_section,
    sample_step,
)
from rubhpc.kernels.closed_form.measuring import observe_step, resolved_contact
from rubhpc.kernels.closed_form.mode_change import GAP_TOLERANCE
from rubhpc.kernels.contact_modes import (
    BOUND_LEVEL,
    ModeTables,
    Reduced,
    dot,
    event_free_interval,
    propagate,
)
from rubhpc.kernels.sampling import Measured  # noqa: TC001 - part of a kernel's signature

if TYPE_CHECKING:
    from rubhpc.kernels.closed_form.mode_change import EventWork

Floats = NDArray[np.float64]

ROUNDING = 4.0 * np.finfo(np.float64).eps  # of a switch function, over the sizes of its terms


@jit_sum
def advance(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    last_tick: int,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    work: EventWork,
    measured: Measured,
    sections: Sections,
) -> int:
    """Advance a case from the tick reached to `last_tick`; sample 0 is tick 0.

    Every pass enters the contact mode wanted, chooses a step, and takes it, unless a switch function is found
    negative at its end: then the step is halved, down to the tick within which the event is taken. While the
    record finds no contact closed, a step may pass several samples: they are read from its beginning.

    What is known to be free of events stays so: it is not proved again while half a step more than the next
    one is left of it. A new proof would find that step free as well, since its bound is at most sqrt(2) times
    the one before, as turning coordinates fall on their axes.

    Parameters
    ----------
    is_recorded : bool
        Whether to fill what is `measured`.
    progress : Progress
        Where a contact mode is wanted that is not tabulated, MODE_WANTED is returned with the motion in
        `coordinates`; the caller adds the mode and calls again.
    sections : Sections
        If there are any, the case goes on without a record, revolution by revolution from `last_tick` on to
        tick 0, or to the end of one at which the motion is beyond a limit.

    Returns
    -------
    int
        FINISHED, DIVERGED (at an event), CONTACT_UNSOLVED, MODE_WANTED, or PAUSED after many steps.
    """
    z, z_next = coordinates.z, coordinates.z_next
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    mask, switch_re, switch_im = tables.mask, tables.switch_re, tables.switch_im
    rate_re, rate_im, bound = tables.rate_re, tables.rate_im, tables.bound
    power_re, power_im = tables.power_re, tables.power_im
    interval, overlap = clock.tick * (1 << clock.sample_level), reduced.overlap
    highest_level = power_re.shape[1] - 1
    every_pair = (1 << reduced.radius.size) - 1
    last_step = progress.n_step + MOST_STEPS
    progress.halving_level, progress.is_after_event = NONE, 0
    is_begun = False
    proved = progress.tick  # up to which no event can happen
    while True:
        if progress.wanted >= 0 or not is_begun:
            if not begin_mode(tables, reduced, clock, is_recorded, progress, coordinates, measured.recorder):
                return MODE_WANTED
            is_begun = True
        is_sample = is_recorded and progress.tick == progress.next_sample << clock.sample_level
        if progress.tick >= last_tick:
            if is_recorded:
                end_record(tables, clock, is_sample, z, progress, measured)
            elif note_section(tables, reduced, clock, progress, z, measured.accumulator, sections):
                last_tick += clock.samples_per_revolution << clock.sample_level
                last_step = progress.n_step + MOST_STEPS
                progress.halving_level, progress.is_after_event = NONE, 0
                proved = progress.tick
                continue
            return FINISHED
        is_at_event = progress.is_after_event == 1 or progress.halving_level >= 0
        if progress.n_step > last_step and not is_at_event:
            return PAUSED
        mode = progress.mode
        is_free = mask[mode] & every_pair == 0
        is_ahead = is_sample and is_free
        longest = longest_step(clock, last_tick, highest_level, is_recorded, is_ahead, progress.tick)
        if is_recorded and not is_free:
            age = contact_age(progress)
            if age != progress.contact_age:
                note_resolution(tables, clock, highest_level, age, progress, z)
            longest = min(longest, clock.contact_level, max(age, clock.search_level), progress.resolved_level)
        interval_free = 0.0
        if is_at_event:
            proved = progress.tick
        elif 2 * (proved - progress.tick) >= 3 << longest:
            interval_free = (proved - progress.tick) * clock.tick
        else:
            interval_free = event_free_interval(
                switch_re, switch_im, rate_re, rate_im, bound, mode, z_re, z_im
            )
            bounded_level = max(highest_level, clock.sample_level + BOUND_LEVEL)
            reach = min(interval_free / clock.tick, 1.0 * (1 << bounded_level))
            proved = progress.tick + int(reach)
        level, is_event_free = choose_step(clock, progress, longest, interval_free)
        propagate(power_re[mode, level], power_im[mode, level], z_re, z_im, next_re, next_im)
        progress.n_step += 1
        crossing = int(np.int64(0))  # no literal: the event would be compiled for it once more
        if not is_event_free:
            crossing = find_crossing(
                mask[mode], mode, switch_re, switch_im, rate_re, rate_im, next_re, next_im, overlap
            )
        if (
            crossing != 0
            and level > 0
            and not stand_still(crossing, switch_re[mode], switch_im[mode], z_re, z_im, next_re, next_im)
        ):
            progress.halving_level = level - 1
            continue
        if is_sample:
            sample_step(tables, clock, level, z_re, z_im, progress, measured)
        if crossing != 0:  # an event within the next tick, or before anything moves, is taken here
            outcome = take_event(
                tables, reduced, clock, crossing, is_recorded, progress, coordinates, work, measured
            )
            if outcome != UNDER_WAY:
                return outcome
            continue
        for k in range(z_re.size):
            z_re[k], z_im[k] = next_re[k], next_im[k]
        if is_recorded and not is_free:
            observe_step(
                tables,
                reduced,
                mode,
                clock.spin,
                progress.tick * clock.tick,
                (1 << level) * clock.tick,
                z_re,
                z_im,
                progress.tick >> clock.sample_level,
                1.0 / interval,
                measured,
            )
        progress.tick += 1 << level
        progress.halving_level = max(progress.halving_level - 1, NONE)


@linked_sum
def note_resolution(
    tables: ModeTables, clock: Clock, highest_level: int, age: int, progress: Progress, z: Floats
) -> None:
    """Note which steps resolve the contacts now, at the level `age` of the time that they have lasted."""
    resolved = resolved_contact(tables, progress.mode, z[0], z[1])
    note_resolved(resolved, clock, highest_level, age, progress)


@linked_sum
def find_crossing(
    closed: int,
    mode: int,
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    z_re: Floats,
    z_im: Floats,
    overlap: float,
) -> int:
    """Set of the pairs whose switch function is negative, of which those of `closed` are closed.

    An open pair that parts is none of them up to an `overlap` (m): modes that follow the speed leave one as
    they are entered.
    """
    crossing = int(np.int64(0))
    for i in range(switch_re.shape[1]):
        is_closed = (closed >> i) & 1 == 1
        value = dot(switch_re[mode, i], switch_im[mode, i], z_re, z_im)
        if value < (0.0 if is_closed else -GAP_TOLERANCE) and (
            is_closed or value < -overlap or dot(rate_re[mode, i], rate_im[mode, i], z_re, z_im) < 0.0
        ):
            crossing |= 1 << i
    return crossing


@linked_sum
def stand_still(
    crossing: int,
    switch_re: Floats,
    switch_im: Floats,
    z_re: Floats,
    z_im: Floats,
    next_re: Floats,
    next_im: Floats,
) -> bool:
    """Whether switch functions (s, m), those of `crossing`, change over a step by rounding alone.

    Shorter steps may not change them at all: where terms are much larger than their sum, as in a sag of
    metres, a gap that closes slowly would never do so in steps of a tick.
    """
    for i in range(switch_re.shape[0]):
        if (crossing >> i) & 1 == 1:
            change, size = 0.0, 0.0
            for k in range(z_re.size):
                after = switch_re[i, k] * next_re[k] - switch_im[i, k] * next_im[k]
                change += after - (switch_re[i, k] * z_re[k] - switch_im[i, k] * z_im[k])
                size += abs(after)
            if abs(change) > ROUNDING * size:
                return False
    return True
