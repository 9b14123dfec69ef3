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

from rubhpc.kernels._jit import jit_sum
from rubhpc.kernels.contact_modes import (
    AGE,
    CONTACT_UNSOLVED,
    DIVERGED,
    ENTERED,
    FINE,
    FINISHED,
    FORCED_LEVEL,
    MOST_STEPS,
    N_EVENT,
    N_STEP,
    NEXT_SAMPLE,
    PAUSED,
    PHASE,
    PHASE_WANTED,
    SAMPLES_AT_ONCE,
    SLIP_TURNED,
    SPAN,
    TIME,
    WANTED,
    Clock,
    Phases,
    Reduced,
    dot,
    enter,
    find_phase,
    floor_log2,
    has_turned,
    is_beyond,
    propagate,
    proved_slip,
    proved_time,
)
from rubhpc.kernels.measuring import (
    Recorder,
    begin_contact,
    begin_span,
    end_span,
    observe_step,
    resolved_contact,
    take_samples,
)
from rubhpc.kernels.mode_change import change_contacts

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Samples, Tally

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_EVENTS = 200_000  # between two counts from 0; more is chatter without end
GAP_TOLERANCE = 1e-13  # m


@jit_sum
def advance(
    phases: Phases,
    reduced: Reduced,
    clock: Clock,
    first_tick: int,
    last_tick: int,
    is_recorded: bool,
    progress: Ints,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    recorder: Recorder,
    samples: Samples,
    tally: Tally,
) -> int:
    """Advance a case from `first_tick` to `last_tick`; sample 0 is tick 0.

    While a gap is open or a force compressive, the switch function s obeys `s + s' t - b t^2 / 2 > 0` for a
    time that the bound b on its second derivative gives: steps up to it miss no event. Shorter steps than
    `2^blind_level` ticks are taken without that proof and checked at their end; where they fail, halving
    finds the event to the tick. While the record finds no contact closed, a step may pass several samples:
    they are read from its beginning.

    Parameters
    ----------
    is_recorded : bool
        Whether to fill `samples` and `tally`.
    progress : (N_PROGRESS,)
        See `kernels.phases`. Where a set of contacts is met that is not tabulated, PHASE_WANTED is returned
        with the motion in `motion` (2 n,); the caller adds the phase and calls again.
    z, z_next : (2, m)
        Modal coordinates, real and imaginary, and work space.

    Returns
    -------
    int
        FINISHED, DIVERGED (at an event), CONTACT_UNSOLVED, PHASE_WANTED, PAUSED after many steps, or
        SLIP_TURNED: set-valued friction has no closed form from there on.
    """
    q, n = reduced.push.shape
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    mask, switch_re, switch_im = phases.mask, phases.switch_re, phases.switch_im
    rate_re, rate_im, bound = phases.rate_re, phases.rate_im, phases.bound
    power_re, power_im = phases.power_re, phases.power_im
    tick, sample_level = clock.tick, clock.sample_level
    interval = tick * (1 << sample_level)
    ticks_per_revolution = clock.samples_per_revolution << sample_level
    end_tick = clock.n_sample << sample_level
    sense = 1.0 if clock.spin >= 0.0 else -1.0
    highest_level = power_re.shape[1] - 1
    force, speed, impulse = np.zeros(q), np.zeros(q), np.zeros(q)
    active, elimination = np.zeros(q, dtype=np.bool_), np.zeros((q, q + 1))
    crossing_at = np.zeros(q, dtype=np.bool_)
    t, p = first_tick, progress[PHASE]
    ceiling = -1  # while halving: the longest level worth a try
    is_halving = False
    is_forced = False
    last_step = progress[N_STEP] + MOST_STEPS
    wanted = progress[WANTED]
    if is_recorded and wanted < 0:
        if progress[SPAN] < 0:
            begin_span(phases, p, t, z, progress, recorder)
        begin_contact(phases, reduced, p, clock.spin, z, z_next, recorder)
    while True:
        if wanted >= 0:  # go over to another set of contacts
            angle = sense * 2.0 * np.pi * (t % ticks_per_revolution) / ticks_per_revolution
            found = find_phase(mask, wanted)
            progress[TIME], progress[WANTED] = t, wanted
            if found < 0:
                return PHASE_WANTED
            p = found
            enter(phases, p, reduced.clearance, np.cos(angle), np.sin(angle), motion, z)
            progress[PHASE], progress[WANTED], progress[ENTERED] = p, -1, t
            wanted, progress[AGE] = -1, -1
            is_forced, is_halving = True, False
            if is_recorded:
                begin_span(phases, p, t, z, progress, recorder)
                begin_contact(phases, reduced, p, clock.spin, z, z_next, recorder)
        is_sample = is_recorded and t == progress[NEXT_SAMPLE] << sample_level
        if t >= last_tick:
            if is_recorded and t == end_tick:
                if is_sample:  # it closes the last interval
                    take_samples(phases, p, z_re, z_im, clock.n_sample, 1, interval, recorder, samples, tally)
                end_span(phases, p, clock, t, z, progress, recorder, tally)
            progress[TIME] = t
            return FINISHED
        if progress[N_STEP] > last_step and not (is_forced or is_halving):
            progress[TIME] = t
            return PAUSED
        is_free = mask[p] == 0
        limit = last_tick
        if is_recorded:
            reach = SAMPLES_AT_ONCE if is_sample and is_free else 1
            limit = min(limit, ((t >> sample_level) + reach) << sample_level)
        level = min(highest_level, floor_log2(limit - t))
        if is_recorded and not is_free:
            # What an impact sets off is fast at first: no step is longer than the contact has lasted.
            age = floor_log2(max(1, t - progress[ENTERED]))
            if age != progress[AGE]:
                resolved = min(resolved_contact(phases, p, z_re, z_im) / tick, 1.0 * (1 << highest_level))
                progress[AGE], progress[FINE] = age, floor_log2(int(max(1.0, resolved)))
            level = min(level, clock.contact_level, max(age, clock.blind_level), progress[FINE])
        is_proved = False
        if is_forced:
            level, is_forced, is_proved = min(level, FORCED_LEVEL), False, True
        elif is_halving:
            level = min(level, ceiling)
        else:
            proved = proved_time(switch_re, switch_im, rate_re, rate_im, bound, p, z_re, z_im)
            if reduced.is_set_valued and not is_free:
                for i in range(q):
                    if (mask[p] >> i) & 1:
                        proved = min(
                            proved,
                            proved_slip(
                                abs(clock.spin) * reduced.radius[i],
                                phases.slip_re[p, i],
                                phases.slip_im[p, i],
                                phases.slip_rate_re[p, i],
                                phases.slip_rate_im[p, i],
                                phases.slip_bound[p, i],
                                z_re,
                                z_im,
                            ),
                        )
                if proved < 0.0:
                    progress[TIME] = t
                    return SLIP_TURNED
            while level > clock.blind_level and (1 << level) * tick > proved:
                level -= 1
            is_proved = (1 << level) * tick <= proved
        propagate(power_re[p, level], power_im[p, level], z_re, z_im, next_re, next_im)
        progress[N_STEP] += 1
        is_crossed = False
        if not is_proved:
            for i in range(q):
                tolerance = 0.0 if (mask[p] >> i) & 1 else GAP_TOLERANCE
                crossing_at[i] = dot(switch_re[p, i], switch_im[p, i], next_re, next_im) < -tolerance
                is_crossed = is_crossed or crossing_at[i]
        if is_crossed and level > 0:
            is_halving, ceiling = True, level - 1
            continue
        if is_sample:
            count = 1 if is_crossed else max(1, (1 << level) >> sample_level)
            first = progress[NEXT_SAMPLE]
            take_samples(phases, p, z_re, z_im, first, count, interval, recorder, samples, tally)
            progress[NEXT_SAMPLE] = first + count
        if not is_crossed:
            for k in range(z_re.size):
                z_re[k], z_im[k] = next_re[k], next_im[k]
            if is_recorded and not is_free:
                observe_step(
                    phases,
                    reduced,
                    p,
                    clock.spin,
                    (1 << level) * tick,
                    z_re,
                    z_im,
                    t >> sample_level,
                    1.0 / interval,
                    recorder,
                    samples,
                    tally,
                )
            t += 1 << level
            if is_halving:
                ceiling -= 1
                is_halving = ceiling >= 0
            continue
        # An event within the next tick: take it here.
        progress[N_EVENT] += 1
        crossing = 0
        for i in range(q):
            if crossing_at[i]:
                crossing |= 1 << i
        for k in range(2 * n):
            motion[k] = dot(phases.motion_re[p, k], phases.motion_im[p, k], z_re, z_im)
        if is_beyond(reduced, motion):
            progress[TIME] = t
            return DIVERGED
        if is_recorded:
            end_span(phases, p, clock, t, z, progress, recorder, tally)
            impulse[:] = tally.impulse
        angle = sense * 2.0 * np.pi * (t % ticks_per_revolution) / ticks_per_revolution
        if reduced.is_set_valued:
            for i in range(q):
                if ((mask[p] | crossing) >> i) & 1 and has_turned(reduced, i, clock.spin, motion[n:]):
                    progress[TIME] = t
                    return SLIP_TURNED
        wanted = change_contacts(
            reduced,
            mask[p],
            crossing,
            clock.spin,
            (1 << FORCED_LEVEL) * tick,
            np.cos(angle),
            np.sin(angle),
            motion,
            is_recorded,
            force,
            speed,
            active,
            elimination,
            tally,
        )
        if reduced.is_set_valued:
            for i in range(q):
                if ((mask[p] | crossing) >> i) & 1 and has_turned(reduced, i, clock.spin, motion[n:]):
                    progress[TIME] = t
                    return SLIP_TURNED
        if wanted < 0 or progress[N_EVENT] > MOST_EVENTS:
            progress[TIME] = t
            return CONTACT_UNSOLVED
        if is_recorded:
            for i in range(q):
                samples.force[i, t >> sample_level] += (tally.impulse[i] - impulse[i]) / interval
                is_new = (wanted >> i) & 1 and not tally.is_touching[i]
                tally.n_contact[i] += 1 if is_new else 0
                tally.is_touching[i] = (wanted >> i) & 1 == 1
