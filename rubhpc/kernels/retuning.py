"""Tables of a contact mode at another spin speed, its matrices staying what they are or going with it.

Eigenmodes belong to the matrices. The spin speed changes the response to the unbalance, which follows from
them in closed form, and with the tick the exponentials.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit, linked, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.contact_modes import STILL, ModeTables
from rubhpc.kernels.retuning_exponentials import retune_bounds, retune_outputs, retune_powers
from rubhpc.kernels.retuning_laws import RimPart, Springs, follow_growth, move_rim, stretch_springs
from rubhpc.kernels.varying import Varying, vary, vary_rates

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

STEADY = 1e-13  # sum of two exponents over the greatest, below which it is zero but for rounding


class HeldMode(Struct):
    """What the spin speed leaves alone: m eigenmodes, m + 1 + q coordinates, padded to the tables' width.

    n reduced degrees, q pairs, o output rows.
    """

    n_coordinate: int  # m + 1 + q
    n_ahead: int  # samples that are read from one set of coordinates: one where a pair is closed
    exponent: Complexes  # (width,), 1/s; that of the response is filled in
    is_pair: NDArray[np.bool_]  # (m,), whether a mode stands for a conjugate pair, and is doubled
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


class Speeds(Struct):
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


@linked
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
    shares, moved = np.empty((4, m)), np.empty((2, 3 * n))
    for k in range(m):
        direct = held.drive[k] * factor / (turning - exponent[k])
        other, mirrored = np.conj(direct), direct
        if held.is_pair[k]:
            mirrored = held.mirrored_drive[k] * factor / (turning - np.conj(exponent[k]))
            other = np.conj(mirrored)
        cosine, sine = 0.5 * (direct + other), 0.5j * (direct - other)
        tables.enter_cosine[mode, 0, k], tables.enter_cosine[mode, 1, k] = cosine.real, cosine.imag
        tables.enter_sine[mode, 0, k], tables.enter_sine[mode, 1, k] = sine.real, sine.imag
        of_real, of_imaginary = direct, 1j * direct
        if held.is_pair[k]:
            of_real, of_imaginary = 0.5 * (direct + mirrored), 0.5j * (direct - mirrored)
        shares[0, k], shares[1, k] = of_real.real, of_real.imag
        shares[2, k], shares[3, k] = of_imaginary.real, of_imaginary.imag
    _respond(tables.motion_re[mode], tables.motion_im[mode], shares, moved)
    x = np.empty(2 * n, dtype=np.complex128)
    for a in range(2 * n):
        x[a] = complex(moved[0, a], moved[1, a])
        tables.motion_re[mode, a, m], tables.motion_im[mode, a, m] = moved[0, a], moved[1, a]
    for a in range(n):
        acceleration = x[n + a] * turning
        moved[0, 2 * n + a], moved[1, 2 * n + a] = acceleration.real, acceleration.imag
    seen = np.empty((2, max(held.switch.shape[0], held.slip.shape[0], held.output.shape[0])))
    _look(held.switch, moved[:, : 2 * n], seen)
    for i in range(held.switch.shape[0]):
        switch = complex(seen[0, i], seen[1, i]) - factor * held.reaction[i]
        tables.switch_re[mode, i, m], tables.switch_im[mode, i, m] = switch.real, switch.imag
        if i < tables.primitive_re.shape[1]:
            whole = switch / turning if abs(turning) > STILL else 0j
            tables.primitive_re[mode, i, m], tables.primitive_im[mode, i, m] = whole.real, whole.imag
        switch = switch * turning
        tables.rate_re[mode, i, m], tables.rate_im[mode, i, m] = switch.real, switch.imag
        if i < tables.bend_re.shape[1]:
            switch = switch * turning
            tables.bend_re[mode, i, m], tables.bend_im[mode, i, m] = switch.real, switch.imag
    _look(held.slip, moved[:, n : 2 * n], seen)
    for i in range(held.slip.shape[0]):
        slip = complex(seen[0, i], seen[1, i])
        tables.slip_re[mode, i, m], tables.slip_im[mode, i, m] = slip.real, slip.imag
        slip = slip * turning
        tables.slip_rate_re[mode, i, m], tables.slip_rate_im[mode, i, m] = slip.real, slip.imag
    retune_powers(tables, mode, exponent, end, tick)
    retune_bounds(tables, mode, exponent, end, tick, interval)
    _look(held.output, moved, seen)
    for o in range(held.output.shape[0]):
        held.row[o, m] = complex(seen[0, o], seen[1, o])
    retune_outputs(tables.output[mode], held.row, exponent, end, interval, held.n_ahead)
    if tables.loss.shape[1] == 0:  # no energies
        return
    _retune_energies(tables, mode, held, x, factor)
    if held.rim.one >= 0:
        follow_growth(tables, mode, held.rim, share, turning, m, x, held.resisting)
    if held.springs.gap.shape[0] > 0:
        stretch_springs(tables, mode, held.springs, m, held.rim.one)


@linked_sum
def _respond(re: Floats, im: Floats, shares: Floats, moved: Floats) -> None:
    """Response (2, 3 n), real and imaginary part, but for its last third.

    Eigenmodes are real and imaginary parts (2 n, width); `shares` (4, m) are what it has of the real ones,
    real and imaginary part, and of the imaginary ones.
    """
    for a in range(re.shape[0]):
        real, imaginary = 0.0, 0.0
        for k in range(shares.shape[1]):
            real += shares[0, k] * re[a, k] + shares[2, k] * im[a, k]
            imaginary += shares[1, k] * re[a, k] + shares[3, k] * im[a, k]
        moved[0, a], moved[1, a] = real, imaginary


@linked_sum
def _look(rows: Floats, moved: Floats, seen: Floats) -> None:
    """What r rows (r, c) see of a response (2, c), real and imaginary part."""
    for i in range(rows.shape[0]):
        real, imaginary = 0.0, 0.0
        for a in range(rows.shape[1]):
            real += rows[i, a] * moved[0, a]
            imaginary += rows[i, a] * moved[1, a]
        seen[0, i], seen[1, i] = real, imaginary


@linked
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


@linked
def _primitive(power: complex, exponent: complex, least: float) -> complex:
    """Power over its exponent, 1/s; zero where that is zero."""
    return power / exponent if abs(exponent) > least else 0j
