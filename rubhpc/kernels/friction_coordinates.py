"""Coordinates that a contact mode uses under set-valued friction, and their energies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_lean_sum
from rubhpc.kernels.accumulators import DAMPING_LOSS, UNBALANCE_WORK, Accumulator
from rubhpc.kernels.contact_modes import ModeTables  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.sampling import Recorder  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]

LANES = 8  # coordinates are used in whole vectors


@jit_inline_sum
def used_width(tables: ModeTables, mode: int) -> int:
    """How many coordinates of a contact mode are used, in whole vectors; those behind them are zero.

    Beside the eigenmodes: the unbalance response and a 1, and a clearance and a displacement of each pair.
    """
    used = tables.n_eigenmode[mode] + 2 + tables.switch_re.shape[1]
    return int(min((used + LANES - 1) // LANES * LANES, tables.switch_re.shape[2]))


@jit_lean_sum
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


@jit_inline_sum
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


@jit_inline_sum
def add_energies(
    tables: ModeTables,
    mode: int,
    time: float,
    begun: Floats,
    z: Floats,
    recorder: Recorder,
    accumulator: Accumulator,
) -> None:
    """Add what damping took and the unbalance gave over a time (s) in a contact mode."""
    energies_gained(tables, mode, begun, z, recorder.entry)
    accumulator.energy[DAMPING_LOSS] += recorder.entry[0] + tables.steady_power[mode, 0] * time
    accumulator.energy[UNBALANCE_WORK] += recorder.entry[1] + tables.steady_power[mode, 1] * time
