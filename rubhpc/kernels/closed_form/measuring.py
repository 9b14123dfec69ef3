"""Measurements of the exact integrator other than samples: contacts and energies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    UNBALANCE_WORK,
    observe_force,
    observe_rub,
    observe_sense,
)
from rubhpc.kernels.case_progress import NONE, Clock, Progress
from rubhpc.kernels.contact_modes import (
    DYING,
    LANES,
    ModeTables,
    Reduced,
    copy_coordinates,
    dot,
    resolved_time,
    used_width,
)
from rubhpc.kernels.sampling import Measured, Recorder  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FORCE, FORCE_RATE, SLIP, SLIP_RATE = range(4)  # rows of `Recorder.node`


@linked_sum
def read_contact(
    tables: ModeTables, reduced: Reduced, mode: int, i: int, z_re: Floats, z_im: Floats
) -> tuple[float, float, float, float]:
    """Force (N), its rate, slip speed (m/s) and its rate, of pair i, closed in contact mode `mode`."""
    return (
        dot(tables.switch_re[mode, i], tables.switch_im[mode, i], z_re, z_im),
        dot(tables.rate_re[mode, i], tables.rate_im[mode, i], z_re, z_im),
        reduced.rim_speed[i] + dot(tables.slip_re[mode, i], tables.slip_im[mode, i], z_re, z_im),
        dot(tables.slip_rate_re[mode, i], tables.slip_rate_im[mode, i], z_re, z_im),
    )


@linked_sum
def resolved_contact(tables: ModeTables, mode: int, z_re: Floats, z_im: Floats) -> float:
    """Time, s, over which cubics follow force and slip of the pairs closed in contact mode `mode`."""
    time = np.inf
    for i in range(tables.switch_re.shape[1]):
        if (tables.mask[mode] >> i) & 1:
            pace = tables.pace[mode]
            time = min(
                time,
                resolved_time(tables.switch_re[mode, i], tables.switch_im[mode, i], pace, DYING, z_re, z_im),
                resolved_time(tables.slip_re[mode, i], tables.slip_im[mode, i], pace, DYING, z_re, z_im),
            )
    return time


@linked_sum
def leave_out_dying(pace: Floats, z: Floats, calm: Floats) -> None:
    """Fill `calm` (2, m) with the coordinates that outlast the first step: no cubic follows the others."""
    for k in range(z.shape[1]):
        dies = pace[k] == DYING
        calm[0, k], calm[1, k] = (0.0, 0.0) if dies else (z[0, k], z[1, k])


@linked_sum
def force_in_step(
    before: float, rate_before: float, after: float, rate_after: float, step: float
) -> tuple[float, float]:
    """Impulse (N s) and middle value (N) of a force over a step (s), by Hermite's cubic."""
    bend = step * (rate_before - rate_after)
    impulse = step * (0.5 * (before + after) + bend / 12.0)
    return impulse, 0.5 * (before + after) + 0.125 * bend


@linked_sum
def begin_contact(
    tables: ModeTables, reduced: Reduced, mode: int, z: Floats, calm: Floats, recorder: Recorder
) -> None:
    """Read the pairs closed in contact mode `mode`, at its beginning or where a record begins.

    `calm` (2, m) is work space.
    """
    leave_out_dying(tables.pace[mode], z, calm)
    for i in range(reduced.radius.size):
        if (tables.mask[mode] >> i) & 1:
            force, rate, slip, slip_rate = read_contact(tables, reduced, mode, i, calm[0], calm[1])
            recorder.node[FORCE, i], recorder.node[FORCE_RATE, i] = force, rate
            recorder.node[SLIP, i], recorder.node[SLIP_RATE, i] = slip, slip_rate


@linked_sum
def observe_step(
    tables: ModeTables,
    reduced: Reduced,
    mode: int,
    spin: float,
    begin: float,
    step: float,
    z_re: Floats,
    z_im: Floats,
    i_sample: int,
    share: float,
    measured: Measured,
) -> None:
    """Add a step (s) of the closed pairs: force and slip as cubics, Simpson's rule for friction.

    It begins at the time `begin` (s), and `z` are the coordinates at its end; `share` (1/s) takes an impulse
    to the mean force of sample `i_sample`. `end_span` has the exact work of drive and friction together in
    closed form, as part of that of damping: it subtracts what is added here.
    """
    recorder, samples, accumulator = measured.recorder, measured.samples, measured.accumulator
    for i in range(reduced.radius.size):
        if not (tables.mask[mode] >> i) & 1:
            continue
        before, rate_before = recorder.node[FORCE, i], recorder.node[FORCE_RATE, i]
        slip_before, slip_rate_before = recorder.node[SLIP, i], recorder.node[SLIP_RATE, i]
        after, rate_after, slip_after, slip_rate_after = read_contact(tables, reduced, mode, i, z_re, z_im)
        recorder.node[FORCE, i], recorder.node[FORCE_RATE, i] = after, rate_after
        recorder.node[SLIP, i], recorder.node[SLIP_RATE, i] = slip_after, slip_rate_after
        impulse, middle = force_in_step(before, rate_before, after, rate_after, step)
        slip_middle = 0.5 * (slip_before + slip_after) + 0.125 * step * (slip_rate_before - slip_rate_after)
        work = before * slip_before + 4.0 * middle * slip_middle + after * slip_after
        friction_work = reduced.friction[i] * work * step / 6.0
        samples.force[i, i_sample] += impulse * share
        accumulator.contact_time[i] += step
        accumulator.least_slip[i] = min(accumulator.least_slip[i], slip_before, slip_after)
        if slip_after != 0.0:
            observe_sense(i, 1 if slip_after > 0.0 else -1, accumulator)
        observe_force(i, begin, step, impulse, before, after, accumulator)
        drive = reduced.friction[i] * reduced.radius[i] * abs(spin) * impulse
        observe_rub(i, impulse, drive, friction_work, accumulator)
        accumulator.energy[DAMPING_LOSS] += drive - friction_work


@linked_sum
def energies_gained(tables: ModeTables, mode: int, begun: Floats, z: Floats, gained: Floats) -> None:
    """Fill `gained` (2,), J, with damping loss and unbalance work between coordinates (2, m) of a mode.

    The form of the loss is read once for both, and what is beside its diagonal, which is symmetric, once.
    """
    m, used = z.shape[1], used_width(tables, mode)
    form, z_re, z_im = tables.loss[mode], z[0, :used], z[1, :used]
    y_re, y_im = begun[0, :used], begun[1, :used]
    if form.shape[0] == 0:  # tables without energies
        gained[0], gained[1] = 0.0, 0.0
        return
    gained[1] = work_form(tables, mode, z_re, z_im) - work_form(tables, mode, y_re, y_im)
    loss = 0.0
    for k in range(0, used, 4):  # four rows at a time: one would wait for its sum
        block = k - k % LANES  # where the block on the diagonal begins
        one, two, three, four = form[k], form[k + 1], form[k + 2], form[k + 3]
        a, b, c, d = z_re[k], z_re[k + 1], z_re[k + 2], z_re[k + 3]
        e, f, g, h = y_re[k], y_re[k + 1], y_re[k + 2], y_re[k + 3]
        aside, within = 0.0, 0.0
        for j in range(block):
            aside += (a * one[j] + b * two[j] + c * three[j] + d * four[j]) * z_re[j]
            aside -= (e * one[j] + f * two[j] + g * three[j] + h * four[j]) * y_re[j]
        for j in range(block, block + LANES):
            within += (a * one[j] + b * two[j] + c * three[j] + d * four[j]) * z_re[j]
            within -= (e * one[j] + f * two[j] + g * three[j] + h * four[j]) * y_re[j]
        one, two, three, four = form[m + k], form[m + k + 1], form[m + k + 2], form[m + k + 3]
        a, b, c, d = z_im[k], z_im[k + 1], z_im[k + 2], z_im[k + 3]
        e, f, g, h = y_im[k], y_im[k + 1], y_im[k + 2], y_im[k + 3]
        if abs(a) + abs(b) + abs(c) + abs(d) + abs(e) + abs(f) + abs(g) + abs(h) != 0.0:
            for j in range(used):
                aside += (a * one[j] + b * two[j] + c * three[j] + d * four[j]) * z_re[j]
                aside -= (e * one[j] + f * two[j] + g * three[j] + h * four[j]) * y_re[j]
            for j in range(block):
                aside += (a * one[m + j] + b * two[m + j] + c * three[m + j] + d * four[m + j]) * z_im[j]
                aside -= (e * one[m + j] + f * two[m + j] + g * three[m + j] + h * four[m + j]) * y_im[j]
            for j in range(block, block + LANES):
                within += (a * one[m + j] + b * two[m + j] + c * three[m + j] + d * four[m + j]) * z_im[j]
                within -= (e * one[m + j] + f * two[m + j] + g * three[m + j] + h * four[m + j]) * y_im[j]
        loss += 2.0 * aside + within
    gained[0] = loss


@linked_sum
def work_form(tables: ModeTables, mode: int, z_re: Floats, z_im: Floats) -> float:
    """What grows by the work of the unbalance, J."""
    first = tables.n_eigenmode[mode]
    cosine, sine = z_re[first], z_im[first]
    work = 0.0
    for part in range(2):  # exp(i angle), then its conjugate
        re, im = tables.work_re[mode, part], tables.work_im[mode, part]
        real, imaginary = 0.0, 0.0
        for k in range(z_re.size):
            real += re[k] * z_re[k] - im[k] * z_im[k]
            imaginary += re[k] * z_im[k] + im[k] * z_re[k]
        work += cosine * real - (sine if part == 0 else -sine) * imaginary
    return work


@linked_sum
def begin_span(z: Floats, progress: Progress, recorder: Recorder) -> None:
    """Begin to add energies at the current tick, where the coordinates are `z` (2, m)."""
    copy_coordinates(z, recorder.begun)
    progress.energy_from = progress.tick


@jit_sum
def end_span(
    tables: ModeTables,
    clock: Clock,
    z: Floats,
    progress: Progress,
    measured: Measured,
) -> None:
    """Add damping loss and unbalance work since the span began, in one contact mode throughout.

    In the tables the damping loss includes that of friction, less the work of the drive against it.
    """
    if progress.energy_from < 0:
        return
    recorder, accumulator = measured.recorder, measured.accumulator
    mode, gained = progress.mode, recorder.gained
    time = (progress.tick - progress.energy_from) * clock.tick
    energies_gained(tables, mode, recorder.begun, z, gained)
    accumulator.energy[DAMPING_LOSS] += gained[0] + tables.steady_power[mode, 0] * time
    accumulator.energy[UNBALANCE_WORK] += gained[1] + tables.steady_power[mode, 1] * time
    progress.energy_from = NONE
