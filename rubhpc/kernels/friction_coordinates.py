"""Coordinates of a contact mode under set-valued friction: entered, left, and their energies.

As `contact_modes.enter` and `measuring.end_span`, of the coordinates that a set of states uses alone:
pairs that stick leave a quarter of the tables' width empty, and events cost what is read of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.accumulators import DAMPING_LOSS, UNBALANCE_WORK, Accumulator
from rubhpc.kernels.case_progress import NONE, Clock, Progress, shaft_turn
from rubhpc.kernels.contact_modes import ModeTables, Reduced, add_rows, dot, enter_rest, find_mode
from rubhpc.kernels.mode_change import GAP_TOLERANCE
from rubhpc.kernels.sampling import Recorder  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]

LANES = 8  # coordinates are used in whole vectors


@linked_sum
def used_width(tables: ModeTables, mode: int) -> int:
    """How many coordinates of a contact mode are used, in whole vectors; those behind them are zero.

    Beside the eigenmodes: the unbalance response and a 1, and a clearance and a displacement of each pair.
    """
    used = tables.n_eigenmode[mode] + 2 + tables.switch_re.shape[1]
    return int(min((used + LANES - 1) // LANES * LANES, tables.switch_re.shape[2]))


@linked_sum
def enter_states(
    tables: ModeTables, reduced: Reduced, clock: Clock, progress: Progress, motion: Floats, z: Floats
) -> bool:
    """Enter the contact mode wanted with the reduced motion (2 n,); False where the mode is not tabulated."""
    mode = find_mode(tables.mask, progress.wanted)
    if mode < 0:
        return False
    clearance = reduced.clearance
    cosine, sine = shaft_turn(clock, progress.tick)
    used = used_width(tables, mode)
    for part in range(2):
        rows = tables.enter_re[mode] if part == 0 else tables.enter_im[mode]
        target = z[part, :used]
        from_cosine, from_sine = tables.enter_cosine[mode, part], tables.enter_sine[mode, part]
        n_whole = clearance.size - clearance.size % 2
        for k in range(used):
            target[k] = -from_cosine[k] * cosine - from_sine[k] * sine
        for i in range(0, n_whole, 2):  # two at a time: the target would be read and written for each
            source, other = tables.enter_constant[mode, i, part], tables.enter_constant[mode, i + 1, part]
            constant, next_constant = clearance[i], clearance[i + 1]
            for k in range(used):
                target[k] -= source[k] * constant + other[k] * next_constant
        for i in range(n_whole, clearance.size):
            source, constant = tables.enter_constant[mode, i, part], clearance[i]
            for k in range(used):
                target[k] -= source[k] * constant
        add_rows(rows, motion, target)
        z[part, used:] = 0.0
    begin_states(tables, mode, clearance, cosine, sine, progress, z)
    if reduced.overlap > GAP_TOLERANCE:
        enter_rest(
            tables.motion_re[mode],
            tables.motion_im[mode],
            tables.enter_re[mode],
            tables.enter_im[mode],
            motion,
            z,
        )
    return True


@linked_sum
def begin_states(
    tables: ModeTables,
    mode: int,
    clearance: Floats,
    cosine: float,
    sine: float,
    progress: Progress,
    z: Floats,
) -> None:
    """Begin in a contact mode: fill in the coordinates (2, m) that do not move."""
    first = tables.n_eigenmode[mode]
    z[0, first], z[1, first] = cosine, sine
    for i in range(clearance.size):
        z[0, first + 1 + i], z[1, first + 1 + i] = clearance[i], 0.0
    progress.mode, progress.wanted, progress.entered = mode, NONE, progress.tick
    progress.contact_age, progress.halving_level, progress.is_after_event = NONE, NONE, 1


@linked_sum
def leave_states(tables: ModeTables, mode: int, z: Floats, motion: Floats) -> None:
    """Fill the reduced motion (2 n,) from the coordinates (2, m) of a contact mode."""
    used = used_width(tables, mode)
    z_re, z_im = z[0, :used], z[1, :used]
    re, im, n_whole = tables.motion_re[mode], tables.motion_im[mode], motion.size - motion.size % 4
    for row in range(0, n_whole, 4):  # four at a time: one would wait for its sum
        first_re, second_re, third_re, fourth_re = re[row], re[row + 1], re[row + 2], re[row + 3]
        first_im, second_im, third_im, fourth_im = im[row], im[row + 1], im[row + 2], im[row + 3]
        first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
        for k in range(used):
            a, b = z_re[k], z_im[k]
            first += first_re[k] * a - first_im[k] * b
            second += second_re[k] * a - second_im[k] * b
            third += third_re[k] * a - third_im[k] * b
            fourth += fourth_re[k] * a - fourth_im[k] * b
        motion[row], motion[row + 1], motion[row + 2], motion[row + 3] = first, second, third, fourth
    for row in range(n_whole, motion.size):
        motion[row] = dot(re[row], im[row], z_re, z_im)


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
