"""The modal integrator in steps: closed-form motion between short contact steps, for every law and normal.

It covers laws under which closed contacts have no modes. With the updated normal, for instance, the gap is
not a linear function of the motion. The contact force of a step acts as an impulse at its beginning, as in
the central difference. The motion is then free (exact, in the modes of the open system) up to the end of the
step, where the laws of contact hold. Far from contact, long steps are taken within bounds: the gap along the
stator's axis is a lower bound.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    STEP,
    TWIST_ACCELERATION,
    UNBALANCE_WORK,
    observe_contact,
    observe_solution,
)
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    FINISHED,
    MOST_STEPS,
    PAUSED,
    Clock,
    Coordinates,
    Progress,
)
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact_forces import solve_contact
from rubhpc.kernels.contact_modes import ModeTables, Reduced, dot, event_free_interval, propagate
from rubhpc.kernels.contact_pairs import N_DEGREE, Pairs, Workspace, fill_start, is_any_closed
from rubhpc.kernels.coordinate_steps import floor_log2
from rubhpc.kernels.laws import is_bouncing, is_penalty, is_plain
from rubhpc.kernels.measuring import begin_span, end_span
from rubhpc.kernels.sampling import Measured, take_samples

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class ContactImpulses(Struct):
    """Action of contact forces on the modes of the open system; q pairs of 5 degrees each, m modes."""

    level: int  # steps in contact last 2^level ticks
    degree_re: Floats  # (5 q, m), displacement of each degree
    degree_im: Floats
    rate_re: Floats  # (5 q, m), velocity of each degree
    rate_im: Floats
    drifted_re: Floats  # (5 q, m), modal coordinates one contact step after a unit impulse on each degree
    drifted_im: Floats
    shifted_re: Floats  # (5 q, m), those of the displacement by a unit impulse in one second
    shifted_im: Floats
    twist_response: Floats  # (5 q,), torsional acceleration of the output node for a unit force
    skew: Floats  # (n, n), skew part of the reduced stiffness; (0, n) where there is none
    probe_response: Floats  # (n_probe, 5 q), immediate reading of an acceleration probe for a unit force


@linked_sum
def book_step(
    reduced: Reduced,
    skew: Floats,
    step: float,
    cosine: float,
    sine: float,
    x: Floats,
    x_after: Floats,
    energy: Floats,
) -> None:
    """Add the work of damping and of the unbalance in a contact step (s), at its mean velocity.

    `x` and `x_after` (n,) are the reduced displacements at its ends, `cosine` and `sine` are those of the
    shaft in its middle (`shaft_turn`); `skew` is the skew part of the stiffness, without rows where it is
    zero. An impulse excites the fastest modes, which a force spread over the step would not: the mean
    velocity excludes this.
    """
    n = x.size
    loss, gain = 0.0, 0.0
    for k in range(n):
        moved = x_after[k] - x[k]
        row = reduced.damping[k]
        drawn = 0.0
        for j in range(n):
            drawn += row[j] * (x_after[j] - x[j])
        loss += moved * drawn / step
        gain += moved * (reduced.force_cosine[k] * cosine + reduced.force_sine[k] * sine)
    for k in range(len(skew)):
        row = skew[k]
        drawn = 0.0
        for j in range(n):
            drawn += row[j] * 0.5 * (x_after[j] + x[j])
        loss += (x_after[k] - x[k]) * drawn
    energy[DAMPING_LOSS] += loss
    energy[UNBALANCE_WORK] += gain


@linked_sum
def take_back(
    impulses: ContactImpulses,
    work: Workspace,
    step: float,
    z_re: Floats,
    z_im: Floats,
    before: Floats,
    now: Floats,
) -> None:
    """Subtract the displacement by a step's forces before the times of their impacts; velocities are kept.

    `z` are the coordinates at the end of the step (s); `before` and `now` (5 q,) are corrected likewise.
    """
    for i in range(work.force.size):
        for d in range(N_DEGREE):
            late = work.delay[i] * step * work.force[i] * work.force_direction[i, d]
            if late != 0.0:
                for k in range(z_re.size):
                    z_re[k] -= impulses.shifted_re[i * N_DEGREE + d, k] * late
                    z_im[k] -= impulses.shifted_im[i * N_DEGREE + d, k] * late
    for a in range(now.size):
        moved = dot(impulses.degree_re[a], impulses.degree_im[a], z_re, z_im) - now[a]
        before[a] += moved
        now[a] += moved


@jit_sum
def advance_by_steps(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    impulses: ContactImpulses,
    pairs: Pairs,
    work: Workspace,
    last_tick: int,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    ends: Floats,
    placed: Floats,
    measured: Measured,
) -> int:
    """Advance a case from the tick reached to `last_tick`, as `event_loop.advance` does.

    `tables` holds only the open mode; `pairs.row` numbers the 5 q degrees of `impulses`. `ends` (4, 5 q)
    keeps the degrees at the beginning and the end of the step before if that was equally short, else NaN. Its
    other two rows and `placed` (2, n) are work space.
    """
    q, z, z_next = pairs.radius.size, coordinates.z, coordinates.z_next
    samples, accumulator = measured.samples, measured.accumulator
    z_re, z_im, next_re, next_im = z[0], z[1], z_next[0], z_next[1]
    switch_re, switch_im = tables.switch_re, tables.switch_im
    gap_rate_re, gap_rate_im, bound = tables.rate_re, tables.rate_im, tables.bound
    power_re, power_im = tables.power_re, tables.power_im
    degree_re, degree_im, rate_re, rate_im = (
        impulses.degree_re,
        impulses.degree_im,
        impulses.rate_re,
        impulses.rate_im,
    )
    motion_re, motion_im = tables.motion_re, tables.motion_im
    n_degree = q * N_DEGREE
    before, now, after, rate = ends[0], ends[1], ends[2], ends[3]
    x, x_after = placed[0], placed[1]
    for a in range(n_degree):
        after[a] = 0.0
    is_placed = False  # whether x is the position at the beginning of the step
    step = clock.tick * (1 << impulses.level)
    interval = clock.tick * (1 << clock.sample_level)
    end_tick = clock.n_sample << clock.sample_level
    highest_level = tables.power_re.shape[1] - 1
    per_revolution = clock.samples_per_revolution << clock.sample_level
    is_direct, may_press_open = is_plain(pairs.law), is_penalty(pairs.law)
    bounces = is_bouncing(pairs.law)
    is_followed = is_recorded or not is_direct  # laws use the steps before and after a force
    last_step = progress.n_step + MOST_STEPS // (1 + q // 4)  # of 48 pairs a step takes 40 us
    was_touching = False
    for i in range(q):
        was_touching = was_touching or work.force[i] > 0.0
    while True:
        t = progress.tick
        if progress.n_step > last_step:
            return PAUSED
        is_sample = is_recorded and t == progress.next_sample << clock.sample_level
        is_end = t >= last_tick
        if is_sample and (not is_end or t == end_tick):
            i_sample = t >> clock.sample_level
            n_taken = i_sample + 1 - progress.next_sample  # 1; a literal would be another type
            take_samples(tables, progress.mode, z_re, z_im, i_sample, n_taken, interval, measured)
            progress.next_sample = i_sample + 1
        if is_end:
            if is_recorded and t == end_tick:
                end_span(tables, clock, z, progress, measured)
            return FINISHED
        limit = last_tick
        if is_recorded:
            limit = min(limit, ((t >> clock.sample_level) + 1) << clock.sample_level)
        level = min(highest_level, floor_log2(limit - t))
        proved = event_free_interval(switch_re, switch_im, gap_rate_re, gap_rate_im, bound, 0, z_re, z_im)
        while level > impulses.level and (1 << level) * clock.tick > proved:
            level -= 1
        progress.n_step += 1
        propagate(power_re[0, level], power_im[0, level], z_re, z_im, next_re, next_im)
        is_near, is_touching = level <= impulses.level, False
        # In the first step of a case the force that holds a gap closed is half of its later value.
        share = 2.0 if progress.n_step == 1 and was_touching and not may_press_open else 1.0
        if is_near:
            for a in range(n_degree):
                after[a] = dot(degree_re[a], degree_im[a], next_re, next_im)
            is_touching = is_any_closed(
                pairs.row,
                pairs.axis_y,
                pairs.axis_z,
                pairs.radius,
                pairs.clearance,
                pairs.aside,
                pairs.is_updated,
                after,
                work.at,
                work.gap,
            )
            if is_followed and np.isnan(before[0]):
                for a in range(n_degree):
                    now[a] = dot(degree_re[a], degree_im[a], z_re, z_im)
                    before[a] = now[a] - step * dot(rate_re[a], rate_im[a], z_re, z_im)
        if is_touching or (is_near and may_press_open and was_touching):
            if not is_direct:
                for a in range(n_degree):
                    rate[a] = (now[a] - before[a]) / step
                fill_start(pairs.row, now, rate, work.now, work.rate)
                for a in range(n_degree):
                    rate[a] = (after[a] - now[a]) / step - rate[a]  # its change over a step without forces
            n_touching = solve_contact(pairs, work, step, clock.spin)
            if n_touching == UNSOLVED:
                return CONTACT_UNSOLVED
            is_touching = n_touching > 0
            if is_recorded:
                observe_solution(STEP, int(work.solution[0]), work.solution[1], work.solution[2], accumulator)
            for i in range(q):
                for d in range(N_DEGREE):
                    b = i * N_DEGREE + d
                    impulse = step * work.force[i] * work.force_direction[i, d]
                    if impulse != 0.0:
                        if is_sample:
                            samples.rotor[TWIST_ACCELERATION, t >> clock.sample_level] += (
                                impulses.twist_response[b] * share * impulse / step
                            )
                            for p in range(samples.probe.shape[0]):
                                samples.probe[p, t >> clock.sample_level] += (
                                    impulses.probe_response[p, b] * share * impulse / step
                                )
                        for k in range(z_re.size):
                            next_re[k] += impulses.drifted_re[b, k] * impulse
                            next_im[k] += impulses.drifted_im[b, k] * impulse
            if is_followed:
                for a in range(n_degree):
                    after[a] = dot(degree_re[a], degree_im[a], next_re, next_im)
        elif was_touching:
            work.force[:] = 0.0
            work.traction[:] = 0.0
            work.is_sticking[:] = False
        if is_recorded and (is_touching or was_touching):
            for a in range(n_degree):
                late = work.delay[a // N_DEGREE] / step if bounces and is_touching else 0.0
                middle = 0.5 * (after[a] - before[a]) / step
                rate[a] = middle + late * rate[a] if late > 0.0 else middle
            observe_contact(pairs, work, clock.spin, t * clock.tick, step, rate, rate, accumulator)
            for i in range(q):
                samples.force[i, t >> clock.sample_level] += work.force[i] * step / interval
        was_touching = is_touching
        for a in range(n_degree):
            before[a], now[a] = now[a], after[a]
        if is_touching and bounces:
            take_back(impulses, work, step, next_re, next_im, before, now)
        if is_recorded and is_touching:
            if progress.energy_from >= 0:
                end_span(tables, clock, z, progress, measured)
            for k in range(x.size):
                if not is_placed:
                    x[k] = dot(motion_re[0, k], motion_im[0, k], z_re, z_im)
                x_after[k] = dot(motion_re[0, k], motion_im[0, k], next_re, next_im)
            angle = clock.spin * clock.tick * (t % per_revolution) + 0.5 * clock.spin * step
            size = np.exp(clock.growth * (t * clock.tick + 0.5 * step))
            cosine, sine = size * np.cos(angle), size * np.sin(angle)
            book_step(reduced, impulses.skew, step, cosine, sine, x, x_after, accumulator.energy)
            for k in range(x.size):
                x[k] = x_after[k]
        elif is_recorded and progress.energy_from < 0:
            begin_span(z, progress, measured.recorder)
        is_placed = is_touching
        if not (is_near and is_followed):
            before[0] = np.nan
        for k in range(z_re.size):
            z_re[k], z_im[k] = next_re[k], next_im[k]
        progress.tick += 1 << level
