"""Measurements while contacts with curved gaps are closed: samples, forces, slip and energies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    UNBALANCE_WORK,
    Accumulator,
    Samples,
    observe_force,
    observe_rub,
    observe_sense,
)
from rubhpc.kernels.case_progress import Clock, Progress, shaft_turn
from rubhpc.kernels.contact_modes import (
    DYING,
    ModeTables,
    Reduced,
    add_rows,
    dot,
)
from rubhpc.kernels.curved_contact import (
    LARGEST,
    LOBATTO,
    N_NODE,
    NODES,
    PARTS,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)
from rubhpc.kernels.curved_response import move_coordinates, respond
from rubhpc.kernels.mode_change import product
from rubhpc.kernels.sampling import Measured, store_samples, widen_extrema

Floats = NDArray[np.float64]
# 1e-4 of 5! / 0.0029: the error of the polynomial through the nodes by a fifth derivative within a step.
RESOLVED_FIFTH = 4.1


@linked_sum
def place(
    tables: ModeTables,
    curved: CurvedTables,
    mode: int,
    z_re: Floats,
    z_im: Floats,
    h: Floats,
    rate: Floats,
    motion: Floats,
) -> None:
    """Reduced displacements and velocities, into `motion` (2 n,), at coordinates with h (q,) and its rate."""
    n = curved.shift.shape[2]
    for k in range(2 * n):
        motion[k] = dot(tables.motion_re[mode, k], tables.motion_im[mode, k], z_re, z_im)
    for i in range(h.size):
        if is_closed(tables.mask[mode], i):
            for k in range(n):
                motion[k] -= curved.shift[mode, i, k] * h[i]
                motion[n + k] -= curved.shift[mode, i, k] * rate[i]


@linked_sum
def begin_curved_span(
    pairs: CurvedPairs,
    tables: ModeTables,
    curved: CurvedTables,
    clock: Clock,
    z: Floats,
    progress: Progress,
    work: CurvedWork,
) -> None:
    """Begin to add energies at the current tick, with contacts closed.

    The transient is separated: the coordinates without their quasi-static response to the loads. Steps must
    resolve this part alone.
    """
    mode, transient = progress.mode, work.transient
    respond(curved, mode, int(tables.mask[mode]), 0, 1, work)
    for k in range(z.shape[1]):
        a, b = curved.inverse_re[mode, k], curved.inverse_im[mode, k]
        re, im = work.response[0, 0, k], work.response[0, 1, k]
        transient[0, k], transient[1, k] = z[0, k] + a * re - b * im, z[1, k] + a * im + b * re
    turn = shaft_turn(clock, progress.tick)
    observe_power(pairs, tables, curved, mode, 0, turn, z, work)
    progress.energy_from = progress.tick


@linked_sum
def resolved_transient(tables: ModeTables, mode: int, work: CurvedWork) -> float:
    """Time, s, over which polynomials follow the transient of force and slip of the closed pairs.

    To 1e-4 of the whole force and slip (compare `contact_modes.resolved_time`).
    """
    time = np.inf
    for i in range(work.h.shape[1]):
        if is_closed(tables.mask[mode], i):
            force = max(work.span[LARGEST], abs(work.force[0, i]))
            time = min(
                time,
                resolved_part(
                    tables.switch_re[mode, i], tables.switch_im[mode, i], force, tables.pace[mode], work
                ),
            )
            slip = abs(work.slip[0, i])
            time = min(
                time,
                resolved_part(
                    tables.slip_re[mode, i], tables.slip_im[mode, i], slip, tables.pace[mode], work
                ),
            )
    return time


@linked_sum
def resolved_part(re: Floats, im: Floats, least: float, pace: Floats, work: CurvedWork) -> float:
    """The same for one signal, with a size of at least `least`."""
    size, bend, transient = 0.0, 0.0, work.transient
    for k in range(pace.size):
        if pace[k] > DYING:
            a, b = transient[0, k], transient[1, k]
            share = np.sqrt((re[k] * re[k] + im[k] * im[k]) * (a * a + b * b))
            square = pace[k] * pace[k]
            size += share
            bend += share * square * square * pace[k]
    return float((RESOLVED_FIFTH * max(size, least) / bend) ** 0.2) if bend > 0.0 else np.inf


@linked_sum
def observe_power(
    pairs: CurvedPairs,
    tables: ModeTables,
    curved: CurvedTables,
    mode: int,
    node: int,
    turn: tuple[float, float],
    z: Floats,
    work: CurvedWork,
) -> None:
    """Power (W) of damping and of the unbalance at a node; the turn is that of `shaft_turn`."""
    seen, n_loss = work.seen, curved.sign.shape[1]
    for r in range(n_loss + 2):
        seen[r] = 0.0
    used = curved.used[mode]
    add_rows(curved.drain[mode, 0, :used], z[0, :used], seen)
    add_rows(curved.drain[mode, 1, :used], z[1, :used], seen)
    for i in range(work.h.shape[1]):
        rate = work.rate[node, i]
        for r in range(n_loss + 2):
            seen[r] -= curved.drain_moved[mode, r, i] * rate
    loss, gain = 0.0, seen[n_loss] * turn[0] + seen[n_loss + 1] * turn[1]
    for r in range(n_loss):
        loss += curved.sign[mode, r] * seen[r] * seen[r]
    if pairs.skew.shape[0] > 0:
        n, state = pairs.skew.shape[0], work.state
        place(tables, curved, mode, z[0], z[1], work.h[node], work.rate[node], state)
        for k in range(n):
            loss += state[n + k] * product(pairs.skew[k], state[:n])
    work.power[node, 0], work.power[node, 1] = loss, gain


@linked_sum
def observe_energies(
    pairs: CurvedPairs,
    tables: ModeTables,
    curved: CurvedTables,
    clock: Clock,
    level: int,
    z: Floats,
    z_next: Floats,
    progress: Progress,
    work: CurvedWork,
    accumulator: Accumulator,
) -> None:
    """Add the work of damping and of the unbalance in a step of 2^level ticks from `z`."""
    mode = progress.mode
    step = (1 << level) * clock.tick
    loss, gain = LOBATTO[0] * work.power[0, 0], LOBATTO[0] * work.power[0, 1]
    for node in range(1, N_NODE):
        there = z_next
        if node < N_NODE - 1:
            there = work.middle
            move_coordinates(curved, mode, level, node, z, work, there)
        turn = shaft_turn(clock, progress.tick, NODES[node] * step)
        observe_power(pairs, tables, curved, mode, node, turn, there, work)
        loss += LOBATTO[node] * work.power[node, 0]
        gain += LOBATTO[node] * work.power[node, 1]
    accumulator.energy[DAMPING_LOSS] += loss * step
    accumulator.energy[UNBALANCE_WORK] += gain * step
    for a in range(2):
        work.power[0, a] = work.power[N_NODE - 1, a]
    p_re, p_im, transient = tables.power_re[mode, level], tables.power_im[mode, level], work.transient
    for k in range(z.shape[1]):
        re, im = transient[0, k], transient[1, k]
        transient[0, k], transient[1, k] = p_re[k] * re - p_im[k] * im, p_re[k] * im + p_im[k] * re


@linked_sum
def observe_curved_step(
    reduced: Reduced,
    mask: int,
    begin: float,
    step: float,
    i_sample: int,
    share: float,
    work: CurvedWork,
    samples: Samples,
    accumulator: Accumulator,
) -> None:
    """Add a step (s) of the closed pairs by Lobatto's rule; otherwise as `measuring.observe_step`."""
    for i in range(reduced.radius.size):
        if not is_closed(mask, i):
            continue
        impulse, friction_work = 0.0, 0.0
        for node in range(N_NODE):
            force, slip = work.force[node, i], work.slip[node, i]
            impulse += LOBATTO[node] * force
            friction_work += LOBATTO[node] * force * slip
            accumulator.least_slip[i] = min(accumulator.least_slip[i], slip)
            if slip != 0.0:
                observe_sense(i, 1 if slip > 0.0 else -1, accumulator)
        impulse, friction_work = impulse * step, friction_work * reduced.friction[i] * step
        samples.force[i, i_sample] += impulse * share
        accumulator.contact_time[i] += step
        accumulator.impulse[i] += impulse
        accumulator.friction_work[i] += friction_work
        for node in range(N_NODE - 1):
            part = 0.0
            for k in range(N_NODE):
                part += PARTS[node, k] * work.force[k, i]
            length = (NODES[node + 1] - NODES[node]) * step
            first, last = work.force[node, i], work.force[node + 1, i]
            observe_force(i, begin + NODES[node] * step, length, part * step, first, last, accumulator)
        observe_rub(reduced.friction[i] * reduced.rim_speed[i] * impulse, friction_work, accumulator)


@linked_sum
def take_curved_sample(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    reduced: Reduced,
    mode: int,
    turn: tuple[float, float],
    z_re: Floats,
    z_im: Floats,
    i_sample: int,
    interval: float,
    work: CurvedWork,
    measured: Measured,
) -> None:
    """Record a sample at the beginning of a step; the one past the record counts for extrema alone.

    The turn is that of the shaft (`shaft_turn`), the interval (s) that between samples.
    """
    recorder, samples, accumulator = measured.recorder, measured.samples, measured.accumulator
    n, value = reduced.stiffness.shape[0], recorder.value
    place(tables, curved, mode, z_re, z_im, work.h[0], work.rate[0], work.state)
    cosine, sine = turn
    for k in range(n):
        total = reduced.force_cosine[k] * cosine + reduced.force_sine[k] * sine
        stiffness, damping = reduced.stiffness[k], reduced.damping[k]
        for j in range(n):
            total -= stiffness[j] * work.state[j] + damping[j] * work.state[n + j]
        work.acceleration[k] = total
    for i in range(work.h.shape[1]):
        if is_closed(tables.mask[mode], i):
            for a in range(pairs.row.shape[1]):
                load = work.force[0, i] * work.direction[i, a]
                row = pairs.row[i, a]
                for k in range(n):
                    work.acceleration[k] += load * row[k]
    for r in range(pairs.output.shape[1]):
        total = 0.0
        at, moving, driven = pairs.output[0, r], pairs.output[1, r], pairs.output[2, r]
        for k in range(n):
            total += at[k] * work.state[k] + moving[k] * work.state[n + k]
            total += driven[k] * work.acceleration[k]
        value[r] = total
    store_samples(value, 0, i_sample, 1, samples.rotor, samples.axial, samples.lateral, samples.probe)
    widen_extrema(
        value, 1, interval, recorder.last, accumulator.lowest, accumulator.highest, accumulator.peak_lateral
    )
