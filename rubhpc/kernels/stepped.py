"""The modal integrator where the contact normal turns: closed-form motion between short contact steps.

With the updated normal the gap is no linear function of the motion, so that closed contacts have no modes.
The contact force of a step acts as a kick at its beginning, as in the central difference, and the motion
drifts freely (exactly, in the modes of the open system) to its end, where the gap must not be negative. Far
from contact, bounded long steps are taken: the gap along the stator's axis is never the larger one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_sum
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact import N_DEGREE, Pairs, Workspace, is_any_closed, solve_contact
from rubhpc.kernels.observe import (
    DAMPING_LOSS,
    TWIST_ACCELERATION,
    UNBALANCE_WORK,
    Samples,
    Tally,
    observe_contact,
)
from rubhpc.kernels.phases import (
    CONTACT_UNSOLVED,
    FINISHED,
    N_STEP,
    NEXT_SAMPLE,
    SPAN,
    TIME,
    Clock,
    Phases,
    dot,
    floor_log2,
    propagate,
    proved_time,
)
from rubhpc.kernels.sampling import Recorder, begin_span, end_span, take_samples

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Kicks(NamedTuple):
    """How contact forces act on the modes of the open system; q pairs of 5 degrees each, m modes."""

    level: int  # steps in contact last 2^level ticks
    degree_re: Floats  # (5 q, m), displacement of each degree
    degree_im: Floats
    drifted_re: Floats  # (5 q, m), modal coordinates a contact step after a unit impulse on each degree
    drifted_im: Floats
    twist_answer: Floats  # (5 q,), torsional acceleration of the output node for a unit force
    loss: Floats  # (5 q, 2 m), growth of `Phases.loss` with a unit impulse, for unit coordinates
    loss_of_pair: Floats  # (5 q, 5 q), and with two of them, whatever the coordinates
    work: Floats  # (5 q, 2), growth of the form of the unbalance's work, times cosine and sine


@jit_inline_sum
def take_off_kick(
    kicks: Kicks, impulses: Floats, z_re: Floats, z_im: Floats, turning: int, energy: Floats
) -> None:
    """Take from the sums of energy what the forms of `sampling` grow by a kick's impulses (5 q,), N s.

    `z` are the coordinates before it, and `turning` the place of exp(i angle) among them.
    """
    for b in range(impulses.size):
        if impulses[b] == 0.0:
            continue
        growth = 0.0
        for k in range(z_re.size):
            growth += kicks.loss[b, k] * z_re[k] + kicks.loss[b, z_re.size + k] * z_im[k]
        for a in range(impulses.size):
            growth += kicks.loss_of_pair[b, a] * impulses[a]
        energy[DAMPING_LOSS] -= impulses[b] * growth
        energy[UNBALANCE_WORK] -= impulses[b] * (
            kicks.work[b, 0] * z_re[turning] + kicks.work[b, 1] * z_im[turning]
        )


@jit_sum
def advance_stepped(
    phases: Phases,
    clock: Clock,
    kicks: Kicks,
    pairs: Pairs,
    work: Workspace,
    first_tick: int,
    last_tick: int,
    is_recorded: bool,
    progress: Ints,
    z: Floats,
    z_next: Floats,
    recorder: Recorder,
    samples: Samples,
    tally: Tally,
) -> int:
    """Advance a case from `first_tick` to `last_tick`, as `modal.advance` does with the fixed normal.

    `phases` holds the open phase alone; `pairs.row` numbers the 5 q degrees of `kicks`.
    """
    q = pairs.radius.size
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    switch_re, switch_im = phases.switch_re, phases.switch_im
    rate_re, rate_im, bound = phases.rate_re, phases.rate_im, phases.bound
    power_re, power_im = phases.power_re, phases.power_im
    degree_re, degree_im = kicks.degree_re, kicks.degree_im
    n_degree = q * N_DEGREE
    position, rate, impulses = np.zeros(n_degree), np.zeros(n_degree), np.zeros(n_degree)
    step = clock.tick * (1 << kicks.level)
    interval = clock.tick * (1 << clock.sample_level)
    end_tick = clock.n_sample << clock.sample_level
    highest_level = phases.power_re.shape[1] - 1
    t = first_tick
    was_touching = bool(np.any(work.force > 0.0))
    if is_recorded and progress[SPAN] < 0:
        begin_span(phases, 0, t, z, progress, recorder)
    while True:
        is_sample = is_recorded and t == progress[NEXT_SAMPLE] << clock.sample_level
        is_end = t >= last_tick
        if is_sample and (not is_end or t == end_tick):
            i_sample = t >> clock.sample_level
            take_samples(phases, 0, z_re, z_im, i_sample, 1, interval, recorder, samples, tally)
            progress[NEXT_SAMPLE] = i_sample + 1
        if is_end:
            if is_recorded and t == end_tick:
                end_span(phases, 0, clock, t, z, progress, recorder, tally)
            progress[TIME] = t
            return FINISHED
        limit = last_tick
        if is_recorded:
            limit = min(limit, ((t >> clock.sample_level) + 1) << clock.sample_level)
        level = min(highest_level, floor_log2(limit - t))
        proved = proved_time(switch_re, switch_im, rate_re, rate_im, bound, 0, z_re, z_im)
        while level > kicks.level and (1 << level) * clock.tick > proved:
            level -= 1
        progress[N_STEP] += 1
        propagate(power_re[0, level], power_im[0, level], z_re, z_im, next_re, next_im)
        is_touching = False
        twist_acceleration = 0.0
        if level <= kicks.level:
            for a in range(n_degree):
                position[a] = dot(degree_re[a], degree_im[a], next_re, next_im)
            is_touching = is_any_closed(
                pairs.row,
                pairs.axis_y,
                pairs.axis_z,
                pairs.radius,
                pairs.clearance,
                pairs.is_updated,
                position,
                work.at,
                work.gap,
            )
        if is_touching:
            if solve_contact(pairs, work) == UNSOLVED:
                progress[TIME] = t
                return CONTACT_UNSOLVED
            for i in range(q):
                for d in range(N_DEGREE):
                    b = i * N_DEGREE + d
                    impulse = step * work.force[i] * work.pull[i, d]
                    impulses[b] = impulse
                    if impulse != 0.0:
                        if is_sample:
                            twist_acceleration += kicks.twist_answer[b] * impulse / step
                        for k in range(z_re.size):
                            next_re[k] += kicks.drifted_re[b, k] * impulse
                            next_im[k] += kicks.drifted_im[b, k] * impulse
        elif was_touching:
            work.force[:] = 0.0
        if is_sample:
            samples.rotor[TWIST_ACCELERATION, t >> clock.sample_level] += twist_acceleration
        if is_recorded and is_touching:
            take_off_kick(kicks, impulses, z_re, z_im, phases.n_mode[0], tally.energy)
        if is_recorded and (is_touching or was_touching):
            # The force works on the mean velocity of the step; a kick's own burst dies out within it.
            for a in range(n_degree):
                rate[a] = (
                    dot(degree_re[a], degree_im[a], next_re, next_im)
                    - dot(degree_re[a], degree_im[a], z_re, z_im)
                ) / step
            observe_contact(pairs, work, clock.spin, step, rate, rate, tally)
            for i in range(q):
                samples.force[i, t >> clock.sample_level] += work.force[i] * step / interval
        was_touching = is_touching
        for k in range(z_re.size):
            z_re[k], z_im[k] = next_re[k], next_im[k]
        t += 1 << level
