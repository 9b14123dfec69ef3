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
from rubhpc.kernels.events import change_contacts
from rubhpc.kernels.phases import (
    CONTACT_UNSOLVED,
    DIVERGED,
    FINISHED,
    N_STEP,
    PHASE,
    PHASE_WANTED,
    SAMPLED,
    TIME,
    WANTED,
    Clock,
    Phases,
    Reduced,
    dot,
    enter,
    find_phase,
    floor_log2,
    propagate,
    proved_time,
)
from rubhpc.kernels.sampling import observe_closed, take_sample

if TYPE_CHECKING:
    from rubhpc.kernels.observe import Samples, Tally

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FORCED_LEVEL = 6  # steps of up to 2^level ticks follow an event unquestioned, so that time goes on
MOST_EVENTS = 200_000  # in one call; more is chatter without end
GAP_TOLERANCE = 1e-13  # m


@jit_sum
def advance(
    phases: Phases,
    reduced: Reduced,
    clock: Clock,
    first_tick: int,
    last_tick: int,
    is_recorded: bool,
    displacement_limit: float,
    progress: Ints,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    outputs: Floats,
    before: Floats,
    samples: Samples,
    tally: Tally,
) -> int:
    """Advance a case from `first_tick` to `last_tick`; sample 0 is tick 0.

    While a gap is open or a force compressive, the switch function s obeys `s + s' t - b t^2 / 2 > 0` for a
    time that the bound b on its second derivative gives: steps up to it miss no event. Shorter steps than
    `2^blind_level` ticks are taken without that proof and checked at their end; where they fail, halving
    finds the event to the tick.

    Parameters
    ----------
    progress : (5,)
        Tick reached, phase, set of pairs wanted next (-1: none), steps taken, whether the sample at the tick
        reached is taken. Where a set is met that is not tabulated, PHASE_WANTED is returned with the motion
        in `motion` (2 n,); the caller adds the phase and calls again.
    z, z_next : (2, m)
        Modal coordinates, real and imaginary, and work space.
    outputs, before : (o,)
        Output rows at the last two samples.

    Returns
    -------
    int
        FINISHED, DIVERGED, CONTACT_UNSOLVED or PHASE_WANTED.
    """
    q, n = reduced.push.shape
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    mask, switch_re, switch_im = phases.mask, phases.switch_re, phases.switch_im
    power_re, power_im = phases.power_re, phases.power_im
    tick, ticks_per_sample = clock.tick, clock.ticks_per_sample
    ticks_per_revolution = ticks_per_sample * clock.samples_per_revolution
    sense = 1.0 if clock.spin >= 0.0 else -1.0
    interval = tick * ticks_per_sample
    highest_level = power_re.shape[1] - 1
    force, speed = np.zeros(q), np.zeros(q)
    active, elimination = np.zeros(q, dtype=np.bool_), np.zeros((q, q + 1))
    crossing_at = np.zeros(q, dtype=np.bool_)
    t, p = first_tick, progress[PHASE]
    ceiling = -1  # while halving: the longest level worth a try
    is_halving = False
    is_forced = False
    n_event = 0
    wanted = progress[WANTED]
    is_sampled = progress[SAMPLED] == 1
    progress[SAMPLED] = 0
    while True:
        if wanted >= 0:  # go over to another set of contacts
            angle = sense * 2.0 * np.pi * (t % ticks_per_revolution) / ticks_per_revolution
            found = find_phase(mask, wanted)
            progress[TIME], progress[WANTED] = t, wanted
            if found < 0:
                progress[SAMPLED] = 1 if is_sampled else 0
                return PHASE_WANTED
            p = found
            enter(phases, p, np.cos(angle), np.sin(angle), motion, z)
            progress[PHASE], progress[WANTED] = p, -1
            wanted = -1
            is_forced, is_halving = True, False
        if is_recorded and t % ticks_per_sample == 0 and not is_sampled:
            is_sampled = True
            if not take_sample(
                phases,
                reduced,
                clock,
                p,
                t,
                last_tick,
                displacement_limit,
                z,
                motion,
                outputs,
                before,
                samples,
                tally,
            ):
                progress[TIME] = t
                return DIVERGED
        if t >= last_tick:
            progress[TIME] = t
            return FINISHED
        limit = last_tick
        if is_recorded:
            limit = min(limit, (t // ticks_per_sample + 1) * ticks_per_sample)
        level = min(highest_level, floor_log2(limit - t))
        if is_recorded and mask[p] != 0:
            level = min(level, clock.contact_level)
        is_proved = False
        if is_forced:
            level, is_forced, is_proved = min(level, FORCED_LEVEL), False, True
        elif is_halving:
            level = min(level, ceiling)
        else:
            proved = proved_time(phases, p, z)
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
        if not is_crossed:
            if is_recorded and mask[p] != 0:
                observe_closed(
                    phases,
                    reduced,
                    p,
                    clock.spin,
                    (1 << level) * tick,
                    z,
                    z_next,
                    t // ticks_per_sample,
                    interval,
                    samples,
                    tally,
                )
            for k in range(z_re.size):
                z_re[k], z_im[k] = next_re[k], next_im[k]
            t += 1 << level
            is_sampled = False
            if is_halving:
                ceiling -= 1
                is_halving = ceiling >= 0
            continue
        # An event within the next tick: take it here.
        n_event += 1
        crossing = 0
        for i in range(q):
            if crossing_at[i]:
                crossing |= 1 << i
        for k in range(2 * n):
            motion[k] = dot(phases.motion_re[p, k], phases.motion_im[p, k], z_re, z_im)
            if not abs(motion[k]) < np.inf:
                progress[TIME] = t
                return DIVERGED
        angle = sense * 2.0 * np.pi * (t % ticks_per_revolution) / ticks_per_revolution
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
        if wanted < 0 or n_event > MOST_EVENTS:
            progress[TIME] = t
            return CONTACT_UNSOLVED
        if is_recorded:
            for i in range(q):
                is_new = (wanted >> i) & 1 and not tally.is_touching[i]
                tally.n_contact[i] += 1 if is_new else 0
                tally.is_touching[i] = (wanted >> i) & 1 == 1
