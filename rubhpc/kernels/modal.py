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
    ENTERED,
    FINISHED,
    N_NODE,
    N_STEP,
    NODES_FULL,
    PHASE,
    PHASE_WANTED,
    SAMPLED,
    TIME,
    WANTED,
    Clock,
    Nodes,
    Phases,
    Reduced,
    dot,
    enter,
    find_phase,
    floor_log2,
    keep_node,
    propagate,
    proved_time,
)

if TYPE_CHECKING:
    from rubhpc.kernels.observe import Tally

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
    progress: Ints,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    nodes: Nodes,
    tally: Tally,
) -> int:
    """Advance a case from `first_tick` to `last_tick`; sample 0 is tick 0.

    While a gap is open or a force compressive, the switch function s obeys `s + s' t - b t^2 / 2 > 0` for a
    time that the bound b on its second derivative gives: steps up to it miss no event. Shorter steps than
    `2^blind_level` ticks are taken without that proof and checked at their end; where they fail, halving
    finds the event to the tick.

    Parameters
    ----------
    is_recorded : bool
        Whether to keep `nodes` and impacts.
    progress : (7,)
        Tick reached, phase, set of pairs wanted next (-1: none), steps taken, whether the sample at the tick
        reached is kept, nodes kept, tick at which the phase began. Where a set is met that is not tabulated,
        PHASE_WANTED is returned with the motion in `motion` (2 n,); the caller adds the phase and calls
        again.
    z, z_next : (2, m)
        Modal coordinates, real and imaginary, and work space.

    Returns
    -------
    int
        FINISHED, DIVERGED (not finite), CONTACT_UNSOLVED, PHASE_WANTED or NODES_FULL.
    """
    q, n = reduced.push.shape
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    mask, switch_re, switch_im = phases.mask, phases.switch_re, phases.switch_im
    rate_re, rate_im, bound = phases.rate_re, phases.rate_im, phases.bound
    power_re, power_im = phases.power_re, phases.power_im
    tick, ticks_per_sample = clock.tick, clock.ticks_per_sample
    ticks_per_revolution = ticks_per_sample * clock.samples_per_revolution
    sense = 1.0 if clock.spin >= 0.0 else -1.0
    node_tick, node_phase, node_z = nodes.tick, nodes.phase, nodes.z
    node_sample, node_entry, n_room = nodes.is_sample, nodes.is_entry, nodes.tick.size - 3
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
            progress[PHASE], progress[WANTED], progress[ENTERED] = p, -1, t
            wanted = -1
            is_forced, is_halving = True, False
            if is_recorded and mask[p] != 0:
                keep_node(
                    node_tick,
                    node_phase,
                    node_sample,
                    node_entry,
                    node_z,
                    progress,
                    t,
                    p,
                    False,
                    True,
                    z,
                )
        if is_recorded:
            if progress[N_NODE] > n_room:
                progress[TIME], progress[SAMPLED] = t, 1 if is_sampled else 0
                return NODES_FULL
            is_due = t % ticks_per_sample == 0 and (t < last_tick or t == clock.end_tick)
            if is_due and not is_sampled:
                is_sampled = True
                keep_node(
                    node_tick,
                    node_phase,
                    node_sample,
                    node_entry,
                    node_z,
                    progress,
                    t,
                    p,
                    True,
                    False,
                    z,
                )
        if t >= last_tick:
            progress[TIME] = t
            return FINISHED
        limit = last_tick
        if is_recorded:
            limit = min(limit, (t // ticks_per_sample + 1) * ticks_per_sample)
        level = min(highest_level, floor_log2(limit - t))
        if is_recorded and mask[p] != 0:
            # What an impact sets off is fast at first: no step is longer than the contact has lasted.
            age = floor_log2(max(1, t - progress[ENTERED]))
            level = min(level, clock.contact_level, max(age, clock.blind_level))
        is_proved = False
        if is_forced:
            level, is_forced, is_proved = min(level, FORCED_LEVEL), False, True
        elif is_halving:
            level = min(level, ceiling)
        else:
            proved = proved_time(switch_re, switch_im, rate_re, rate_im, bound, p, z_re, z_im)
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
            for k in range(z_re.size):
                z_re[k], z_im[k] = next_re[k], next_im[k]
            t += 1 << level
            is_sampled = False
            if is_recorded and mask[p] != 0 and t % ticks_per_sample != 0:
                keep_node(
                    node_tick,
                    node_phase,
                    node_sample,
                    node_entry,
                    node_z,
                    progress,
                    t,
                    p,
                    False,
                    False,
                    z,
                )
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
