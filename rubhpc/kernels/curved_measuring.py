"""What is measured while contacts with curved gaps are closed: samples, forces, slip and energies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    DRIVE_WORK,
    FRICTION_LOSS,
    HORIZONTAL,
    TWIST,
    TWIST_ACCELERATION,
    UNBALANCE_WORK,
    VERTICAL,
    Accumulator,
    Samples,
    observe_force,
    observe_sense,
)
from rubhpc.kernels.case_progress import Clock, Progress, shaft_angle
from rubhpc.kernels.contact_modes import (
    LATERAL_ROW,
    N_ROTOR_ROW,
    TWIST_ACCELERATION_ROW,
    ModeTables,
    Reduced,
    dot,
    propagate,
)
from rubhpc.kernels.curved_contact import N_NODE, CurvedPairs, CurvedTables, CurvedWork, is_closed
from rubhpc.kernels.curved_response import respond
from rubhpc.kernels.measuring import Recorder, begin_span, widen_extrema
from rubhpc.kernels.mode_change import product

Floats = NDArray[np.float64]


@jit_lean_sum
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


@jit_lean_sum
def begin_curved_span(
    reduced: Reduced,
    pairs: CurvedPairs,
    tables: ModeTables,
    curved: CurvedTables,
    angle: float,
    z: Floats,
    progress: Progress,
    work: CurvedWork,
    recorder: Recorder,
) -> None:
    """Begin to add up energies amid closed contacts, the shaft at an angle (rad).

    The motion is taken apart. Its transient goes on by itself from here, fast or not, so that its losses have
    a closed form; the rest, which the loads drive, begins where the loads hold it still, and is slow.
    """
    mode = progress.mode
    respond(curved, mode, int(tables.mask[mode]), 0, work)
    for k in range(z.shape[1]):
        a, b = curved.inverse_re[mode, k], curved.inverse_im[mode, k]
        re, im = work.response[0, 0, k], work.response[0, 1, k]
        work.transient[0, k], work.transient[1, k] = z[0, k] + a * re - b * im, z[1, k] + a * im + b * re
    begin_span(tables, work.transient, progress, recorder)
    observe_power(reduced, pairs, tables, curved, mode, 0, angle, z, work.transient, work)


@jit_lean_sum
def observe_power(
    reduced: Reduced,
    pairs: CurvedPairs,
    tables: ModeTables,
    curved: CurvedTables,
    mode: int,
    node: int,
    angle: float,
    z: Floats,
    transient: Floats,
    work: CurvedWork,
) -> None:
    """Power (W) that damping takes and the unbalance gives at a node of a step, the shaft at an angle (rad).

    That of the transient alone is left out; what damping takes of it in the driven motion is filled into
    `work.crossed`.
    """
    n, m = reduced.damping.shape[0], z.shape[1]
    driven, state, crossed = work.driven, work.state, work.crossed[node]
    for part in range(2):
        for k in range(m):
            driven[part, k] = z[part, k] - transient[part, k]
            crossed[part, k] = 0.0
    place(tables, curved, mode, driven[0], driven[1], work.h[node], work.rate[node], state)
    cosine, sine = np.cos(angle), np.sin(angle)
    loss, gain = 0.0, 0.0
    has_skew = pairs.skew.shape[0] > 0
    for k in range(n):
        drawn = product(pairs.resisting[k], state[n:])
        leaning, along = 0.0, 0.0
        if has_skew:
            leaning, along = product(pairs.skew[k], state[:n]), -product(pairs.skew[k], state[n:])
        loss += state[n + k] * (drawn + leaning)
        gain += state[n + k] * (reduced.force_cosine[k] * cosine + reduced.force_sine[k] * sine)
        rate_re, rate_im = tables.motion_re[mode, n + k], tables.motion_im[mode, n + k]
        taken = 2.0 * drawn + leaning
        for j in range(m):
            crossed[0, j] += taken * rate_re[j]
            crossed[1, j] += taken * rate_im[j]
        if has_skew:
            shape_re, shape_im = tables.motion_re[mode, k], tables.motion_im[mode, k]
            for j in range(m):
                crossed[0, j] += along * shape_re[j]
                crossed[1, j] += along * shape_im[j]
    work.power[node, 0], work.power[node, 1] = loss, gain


@jit_lean_sum
def observe_energies(
    reduced: Reduced,
    pairs: CurvedPairs,
    tables: ModeTables,
    curved: CurvedTables,
    clock: Clock,
    level: int,
    z_next: Floats,
    progress: Progress,
    work: CurvedWork,
    accumulator: Accumulator,
) -> None:
    """Add what damping takes and the unbalance gives in a step of 2^level ticks from the tick reached on.

    The driven motion alone is integrated by Simpson's rule. What it and the transient do together is that of
    a parabola times exponentials, of which `CurvedTables.weight` has the integrals.
    """
    mode = progress.mode
    step = (1 << level) * clock.tick
    w_re, w_im, later = work.transient[0], work.transient[1], work.later
    half_re, half_im = curved.half_re[mode], curved.half_im[mode]
    if level > 0:
        half_re, half_im = tables.power_re[mode, level - 1], tables.power_im[mode, level - 1]
    angle = shaft_angle(clock, progress.tick) + 0.5 * clock.spin * step
    propagate(half_re, half_im, w_re, w_im, later[0], later[1])
    observe_power(reduced, pairs, tables, curved, mode, 1, angle, work.middle, later, work)
    angle += 0.5 * clock.spin * step
    propagate(tables.power_re[mode, level], tables.power_im[mode, level], w_re, w_im, later[0], later[1])
    observe_power(reduced, pairs, tables, curved, mode, 2, angle, z_next, later, work)
    for a, kind in ((0, DAMPING_LOSS), (1, UNBALANCE_WORK)):
        whole = work.power[0, a] + 4.0 * work.power[1, a] + work.power[2, a]
        accumulator.energy[kind] += whole * step / 6.0
    taken = 0.0
    for node in range(N_NODE):  # the weights count time from the end of a step
        g_re = curved.weight_re[mode, level, 1, N_NODE - 1 - node]
        g_im = curved.weight_im[mode, level, 1, N_NODE - 1 - node]
        y_re, y_im = work.crossed[node, 0], work.crossed[node, 1]
        for k in range(w_re.size):
            re, im = w_re[k] * g_re[k] - w_im[k] * g_im[k], w_re[k] * g_im[k] + w_im[k] * g_re[k]
            taken += re * y_re[k] - im * y_im[k]
    accumulator.energy[DAMPING_LOSS] += taken
    for part in range(2):
        for k in range(w_re.size):
            work.transient[part, k] = later[part, k]
            work.crossed[0, part, k] = work.crossed[2, part, k]
        work.power[0, part] = work.power[2, part]


@jit_lean_sum
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
    """Add a step (s) of the closed pairs by Simpson's rule; the rest as in `measuring.observe_step`."""
    for i in range(reduced.radius.size):
        if not is_closed(mask, i):
            continue
        first, middle, last = work.force[0, i], work.force[1, i], work.force[2, i]
        impulse = (first + 4.0 * middle + last) * step / 6.0
        friction_work = (
            first * work.slip[0, i] + 4.0 * middle * work.slip[1, i] + last * work.slip[2, i]
        ) * (reduced.friction[i] * step / 6.0)
        samples.force[i, i_sample] += impulse * share
        accumulator.contact_time[i] += step
        accumulator.impulse[i] += impulse
        accumulator.friction_work[i] += friction_work
        observe_force(i, begin, step, impulse, first, last, accumulator)
        for node in range(N_NODE):
            slip = work.slip[node, i]
            accumulator.least_slip[i] = min(accumulator.least_slip[i], slip)
            if slip != 0.0:
                observe_sense(i, 1 if slip > 0.0 else -1, accumulator)
        accumulator.energy[FRICTION_LOSS] += friction_work
        accumulator.energy[DRIVE_WORK] += reduced.friction[i] * reduced.rim_speed[i] * impulse


@jit_lean_sum
def take_curved_sample(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    reduced: Reduced,
    mode: int,
    angle: float,
    z_re: Floats,
    z_im: Floats,
    i_sample: int,
    interval: float,
    work: CurvedWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
) -> None:
    """Record a sample at the beginning of a step; the one past the record counts for extrema alone.

    The angle (rad) is that of the shaft, the interval (s) that between samples.
    """
    n, value = reduced.stiffness.shape[0], recorder.value
    place(tables, curved, mode, z_re, z_im, work.h[0], work.rate[0], work.state)
    cosine, sine = np.cos(angle), np.sin(angle)
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
    if i_sample < samples.rotor.shape[1]:
        samples.rotor[VERTICAL, i_sample] = value[VERTICAL]
        samples.rotor[HORIZONTAL, i_sample] = value[HORIZONTAL]
        samples.rotor[TWIST, i_sample] = value[TWIST]
        samples.rotor[TWIST_ACCELERATION, i_sample] = value[TWIST_ACCELERATION_ROW]
        n_place = samples.axial.shape[0]
        for i in range(n_place):
            tip = N_ROTOR_ROW + 3 * i
            samples.axial[i, i_sample] = value[tip]
            samples.lateral[i, i_sample] = value[tip + LATERAL_ROW]
        for i in range(samples.probe.shape[0]):
            samples.probe[i, i_sample] = value[N_ROTOR_ROW + 3 * n_place + i]
    widen_extrema(
        value, 1, interval, recorder.last, accumulator.lowest, accumulator.highest, accumulator.peak_lateral
    )
