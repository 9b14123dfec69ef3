"""Tables of a contact mode at another spin speed, its matrices staying what they are or going with it.

Eigenmodes belong to the matrices. The spin speed changes the response to the unbalance, which follows from
them in closed form, and with the tick the exponentials.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit
from rubhpc.kernels.contact_modes import (
    DYING,
    FORCED_LEVEL,
    SAMPLES_AT_ONCE,
    STILL,
    ModeTables,
)
from rubhpc.kernels.retuning_laws import RimPart, Springs, follow_growth, move_rim, stretch_springs
from rubhpc.kernels.varying import Varying, vary, vary_rates

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

SQUARED = 4  # levels of exponentials, of which one is evaluated and the others follow by squaring
GONE = -40.0  # exponent of what has died away
STEADY = 1e-13  # sum of two exponents over the greatest, below which it is zero but for rounding


class HeldMode(NamedTuple):
    """What the spin speed leaves alone: m eigenmodes, m + 1 + q coordinates, padded to the tables' width.

    n reduced degrees, q pairs, o output rows.
    """

    n_coordinate: int  # m + 1 + q
    exponent: Complexes  # (width,), 1/s; that of the response is filled in
    is_pair: NDArray[np.bool_]  # (m,), whether a mode stands for a conjugate pair, and is doubled
    motion: Complexes  # (m, 2 n), displacements, then velocities
    drive: Complexes  # (m,), share of the unbalance at unit speed
    mirrored_drive: Complexes  # (m,), that of the conjugate modes
    switch: Floats  # (q, 2 n), gap or force with the motion
    reaction: Complexes  # (q,), force of closed pairs by the unbalance at unit speed
    slip: Floats  # (q, n)
    resistance: Floats  # (n, 2 n), [skew part of the stiffness, damping], less the friction of closed pairs
    rubbed: Complexes  # (n,), what the unbalance at unit speed gives of that friction
    rate: Complexes  # (width, n), velocities
    resisting: Complexes  # (width, n), resisting forces
    phasor: Complexes  # (n,), unbalance at unit speed, kg m
    work: Complexes  # (2, width), power of the unbalance and of its conjugate at unit speed
    output: Floats  # (o, 3 n), what output rows see of displacements, rates and accelerations
    row: Complexes  # (o, width), output rows; that of the response is filled in
    rim: RimPart
    springs: Springs
    varying: Varying


class Speeds(NamedTuple):
    """Speeds to which tables are tuned, k of them, one after the other."""

    spin: Floats  # (k,), rad/s
    share: Floats  # (k,), of the speed at which the matrices are
    within: Floats  # (k,), place in the range of the matrices, from -1 to 1
    rise: Floats  # (k,), place of the acceleration, 0 for that of the matrices
    factor: Complexes  # (k,), by which the unbalance at unit speed acts: spin^2 exp(i angle) if steady, 1/s^2
    growth: Floats  # (k,), 1/s, of the unbalance force; the factor is that at the beginning
    tick: Floats  # (k,), s, resolution of events
    interval: Floats  # (k,), s, of samples


@jit
def retune(tables: ModeTables, place: int, held: HeldMode, speeds: Speeds, first: int, last: int) -> None:
    """Bring tables of a mode to the speeds from `first` up to `last`, in place.

    Those of the mode at speed `j` are the tables `place + j`.
    """
    for j in range(first, last):
        retune_to(
            tables,
            place + j,
            held,
            complex(speeds.growth[j], speeds.spin[j]),
            speeds.share[j],
            speeds.within[j],
            speeds.rise[j],
            speeds.factor[j],
            speeds.tick[j],
            speeds.interval[j],
        )


@jit
def retune_to(
    tables: ModeTables,
    mode: int,
    held: HeldMode,
    turning: complex,
    share: float,
    within: float,
    rise: float,
    factor: complex,
    tick: float,
    interval: float,
) -> None:
    """Bring tables of a mode to one speed, `mode` being their index.

    `turning` (1/s) is the exponent of the unbalance force, its growth and i times the spin; the rest are as
    in `Speeds`.
    """
    m, n, end = held.is_pair.size, held.slip.shape[1], held.n_coordinate
    if held.varying.kept.size > 0:
        vary(tables, mode, held.varying, within, rise)
        vary_rates(tables, mode, held.exponent, m)
    if held.rim.one >= 0:
        move_rim(tables, mode, held.rim, share, held.rate, held.resisting, held.row, held.work)
    exponent = held.exponent
    exponent[m] = turning
    x = np.zeros(2 * n, dtype=np.complex128)
    for k in range(m):
        direct = held.drive[k] * factor / (turning - exponent[k])
        other = np.conj(direct)
        if held.is_pair[k]:
            mirrored = held.mirrored_drive[k] * factor / (turning - np.conj(exponent[k]))
            other = np.conj(mirrored)
            for a in range(2 * n):
                x[a] += 0.5 * (held.motion[k, a] * direct + np.conj(held.motion[k, a]) * mirrored)
        else:
            for a in range(2 * n):
                x[a] += held.motion[k, a] * direct
        cosine, sine = 0.5 * (direct + other), 0.5j * (direct - other)
        tables.enter_cosine[mode, 0, k], tables.enter_cosine[mode, 1, k] = cosine.real, cosine.imag
        tables.enter_sine[mode, 0, k], tables.enter_sine[mode, 1, k] = sine.real, sine.imag
    for a in range(2 * n):
        tables.motion_re[mode, a, m], tables.motion_im[mode, a, m] = x[a].real, x[a].imag
    for i in range(held.switch.shape[0]):
        switch = -factor * held.reaction[i]
        for a in range(2 * n):
            switch += held.switch[i, a] * x[a]
        tables.switch_re[mode, i, m], tables.switch_im[mode, i, m] = switch.real, switch.imag
        if i < tables.primitive_re.shape[1]:
            whole = switch / turning if abs(turning) > STILL else 0j
            tables.primitive_re[mode, i, m], tables.primitive_im[mode, i, m] = whole.real, whole.imag
        switch = switch * turning
        tables.rate_re[mode, i, m], tables.rate_im[mode, i, m] = switch.real, switch.imag
        if i < tables.bend_re.shape[1]:
            switch = switch * turning
            tables.bend_re[mode, i, m], tables.bend_im[mode, i, m] = switch.real, switch.imag
    for i in range(held.slip.shape[0]):
        slip = 0j
        for a in range(n):
            slip += held.slip[i, a] * x[n + a]
        tables.slip_re[mode, i, m], tables.slip_im[mode, i, m] = slip.real, slip.imag
        slip = slip * turning
        tables.slip_rate_re[mode, i, m], tables.slip_rate_im[mode, i, m] = slip.real, slip.imag
    _retune_powers(tables, mode, exponent, end, tick, interval)
    for o in range(held.output.shape[0]):
        total = 0j
        for a in range(n):
            total += (
                held.output[o, a] * x[a]
                + (held.output[o, n + a] + held.output[o, 2 * n + a] * turning) * x[n + a]
            )
        held.row[o, m] = total
    _retune_outputs(tables.output[mode], held.row, exponent, end, interval)
    if tables.loss.shape[1] == 0:  # no energies
        return
    _retune_energies(tables, mode, held, x, factor)
    if held.rim.one >= 0:
        follow_growth(tables, mode, held.rim, share, turning, m, x, held.resisting)
    if held.springs.gap.shape[0] > 0:
        stretch_springs(tables, mode, held.springs, m, held.rim.one)


@jit
def _retune_powers(
    tables: ModeTables, mode: int, exponent: Complexes, end: int, tick: float, interval: float
) -> None:
    """Exponentials of the first `end` coordinates, and what bounds and paces have of them."""
    n_level = tables.power_re.shape[1]
    power_re, power_im = tables.power_re[mode], tables.power_im[mode]
    for level in range(n_level):
        re, im = power_re[level], power_im[level]
        if level % SQUARED == 0:
            time = tick * 2.0**level
            for k in range(end):
                power = _exponential(exponent[k], time)
                re[k], im[k] = power.real, power.imag
        else:  # to square doubles the rounding
            re_before, im_before = power_re[level - 1], power_im[level - 1]
            for k in range(end):
                a, b = re_before[k], im_before[k]
                re[k], im[k] = a * a - b * b, 2.0 * (a * b)
    for k in range(end):
        size = abs(exponent[k])
        growth = np.exp(exponent[k].real * tick * 2.0 ** (n_level - 1)) if exponent[k].real > 0.0 else 1.0
        for i in range(tables.bound.shape[1]):
            re_of, im_of = tables.switch_re[mode, i, k], tables.switch_im[mode, i, k]
            bound = np.sqrt(re_of * re_of + im_of * im_of) * size * size * growth
            tables.bound[mode, i, k] = bound
            if i < tables.turn.shape[1]:
                is_fast = exponent[k].imag == 0.0 and exponent[k].real * interval < -1.0
                tables.turn[mode, i, k] = -bound * size if is_fast else bound * size
        is_gone = exponent[k].real * tick * 2.0**FORCED_LEVEL < GONE
        tables.pace[mode, k] = DYING if is_gone else size


@jit
def _retune_outputs(output: Floats, row: Complexes, exponent: Complexes, end: int, interval: float) -> None:
    """Outputs at coming samples by the first `end` coordinates; zeros that stay are left.

    Most are: a coordinate of an open stator is seen by the outputs of this stator alone.
    """
    n_output, width = row.shape
    seen = np.empty(n_output, dtype=np.int64)
    for k in range(end):
        real, imaginary = output[k], output[width + k]
        count = 0
        for o in range(n_output):
            if row[o, k] != 0.0 or real[o] != 0.0 or imaginary[o] != 0.0:
                seen[count] = o
                count += 1
        onward, ahead = _exponential(exponent[k], interval), 1.0 + 0j
        for later in range(SAMPLES_AT_ONCE):
            for i in range(count):
                o = seen[i]
                value = ahead * row[o, k]
                real[later * n_output + o] = value.real
                imaginary[later * n_output + o] = -value.imag
            ahead *= onward


@jit
def _exponential(exponent: complex, time: float) -> complex:
    """Exponential over a time, s, in a quarter of the time of one that looks for infinite arguments."""
    size, turn = np.exp(exponent.real * time), exponent.imag * time
    return complex(size * np.cos(turn), size * np.sin(turn))


@jit
def _retune_energies(tables: ModeTables, mode: int, held: HeldMode, x: Complexes, factor: complex) -> None:
    """Forms of the energies with the response `x` (2 n,)."""
    m, n, width = held.is_pair.size, held.slip.shape[1], held.exponent.size
    exponent = held.exponent
    turning = exponent[m]
    own = np.zeros(n, dtype=np.complex128)
    greatest = 0.0
    for k in range(width):
        greatest = max(greatest, abs(exponent[k]))
    least = 2.0 * STEADY * greatest
    for a in range(n):
        own[a] = factor * held.rubbed[a]
        for b in range(2 * n):
            own[a] += held.resistance[a, b] * x[b]
        held.rate[m, a], held.resisting[m, a] = x[n + a], own[a]
    work, work_conjugate, steady, driven = 0j, 0j, 0.0, 0.0
    for a in range(n):
        work += held.phasor[a] * x[n + a]
        work_conjugate += np.conj(held.phasor[a]) * x[n + a]
        steady += (x[n + a] * np.conj(own[a])).real
        driven += (x[n + a] * np.conj(factor * held.phasor[a])).real
    held.work[0, m], held.work[1, m] = work, work_conjugate
    if 2.0 * abs(turning.real) > least:  # no power of the response is steady; the forms hold it
        steady, driven = 0.0, 0.0
    tables.steady_power[mode, 0], tables.steady_power[mode, 1] = 0.5 * steady, 0.5 * driven
    for k in range(held.n_coordinate):
        across, across_conjugate, down, down_conjugate = 0j, 0j, 0j, 0j
        for a in range(n):
            across += x[n + a] * held.resisting[k, a]
            across_conjugate += x[n + a] * np.conj(held.resisting[k, a])
            down += own[a] * held.rate[k, a]
            down_conjugate += np.conj(own[a]) * held.rate[k, a]
        across = _primitive(across, turning + exponent[k], least)
        across_conjugate = _primitive(across_conjugate, turning + np.conj(exponent[k]), least)
        down = _primitive(down, exponent[k] + turning, least)
        down_conjugate = _primitive(down_conjugate, exponent[k] + np.conj(turning), least)
        both = across_conjugate + down_conjugate
        re_re = 0.25 * (across + down + both).real
        re_im = 0.25 * (across_conjugate - across - down - down_conjugate).imag
        im_re = 0.25 * (down_conjugate - down - across - across_conjugate).imag
        im_im = 0.25 * (both - across - down).real
        loss = tables.loss[mode]
        loss[m, k] = loss[k, m] = re_re
        loss[m, width + k] = loss[width + k, m] = re_im
        loss[width + m, k] = loss[k, width + m] = im_re
        loss[width + m, width + k] = loss[width + k, width + m] = im_im
        first = 0.5 * _primitive(factor * held.work[0, k], exponent[k] + turning, least)
        second = 0.5 * _primitive(np.conj(factor) * held.work[1, k], exponent[k] + np.conj(turning), least)
        tables.work_re[mode, 0, k], tables.work_im[mode, 0, k] = first.real, first.imag
        tables.work_re[mode, 1, k], tables.work_im[mode, 1, k] = second.real, second.imag


@jit
def _primitive(power: complex, exponent: complex, least: float) -> complex:
    """Power over its exponent, 1/s; zero where that is zero."""
    return power / exponent if abs(exponent) > least else 0j
