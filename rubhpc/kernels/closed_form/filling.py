"""Tables of a contact mode at a spin speed.

Eigenmodes belong to the matrices, which may go with the speed over a range. The response to the unbalance
follows from them in closed form, and so do exponentials.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit, linked, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.closed_form.courses import Courses, follow, follow_rates
from rubhpc.kernels.closed_form.filling_energies import Losses, fill_energies
from rubhpc.kernels.closed_form.filling_exponentials import fill_bounds, fill_outputs, fill_powers
from rubhpc.kernels.contact_modes import ModeTables  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class ModeCourse(Struct):
    """A contact mode over a range of speeds: m eigenmodes, its coordinates padded to the tables' width.

    n reduced degrees, r switch functions, o output rows.
    """

    n_coordinate: int
    n_ahead: int  # samples that are read from one set of coordinates: one where a pair is closed
    exponent: Complexes  # (width,), 1/s; that of the response is filled in
    is_pair: NDArray[np.bool_]  # (m,), whether a mode stands for a conjugate pair, and is doubled
    drive: Complexes  # (m,), share of the unbalance at unit speed
    mirrored_drive: Complexes  # (m,), that of the conjugate modes
    reaction: Complexes  # (r,), what the unbalance at unit speed takes from switch functions directly
    phasor: Complexes  # (n,), unbalance at unit speed, kg m
    output: Floats  # (o, 3 n), what output rows see of displacements, rates and accelerations
    row: Complexes  # (o, width), output rows; that of the response is filled in
    losses: Losses
    courses: Courses


class Speeds(Struct):
    """Speeds to which tables are filled, k of them, one after the other."""

    spin: Floats  # (k,), rad/s
    within: Floats  # (k,), place in the range of the matrices, from -1 to 1
    factor: Complexes  # (k,), by which the unbalance at unit speed acts: spin^2 exp(i angle) if steady, 1/s^2
    growth: Floats  # (k,), 1/s, of the unbalance force; the factor is that at the beginning
    tick: Floats  # (k,), s, resolution of events
    interval: Floats  # (k,), s, of samples


@jit
def fill(tables: ModeTables, place: int, course: ModeCourse, speeds: Speeds, j: int) -> None:
    """Bring the tables of a mode, `place` being their index, to the speed `j`, in place."""
    turning = complex(speeds.growth[j], speeds.spin[j])
    if course.courses.kept.size > 0:
        follow(tables, place, course.courses, speeds.within[j])
        follow_rates(tables, place, course.exponent, course.is_pair.size)
    fill_at(tables, place, course, turning, speeds.factor[j], speeds.tick[j], speeds.interval[j])


@linked
def fill_at(
    tables: ModeTables,
    mode: int,
    course: ModeCourse,
    turning: complex,
    factor: complex,
    tick: float,
    interval: float,
) -> None:
    """Fill what follows from eigenmodes and the unbalance force into tables, `mode` being their index.

    `turning` (1/s) is the exponent of the unbalance force, its growth and i times the spin; the rest are as
    in `Speeds`.
    """
    m, n, end = course.is_pair.size, course.phasor.size, course.n_coordinate
    exponent = course.exponent
    exponent[m] = turning
    n_row = max(3 * n, tables.switch_re.shape[1], tables.slip_re.shape[1], course.output.shape[0])
    shares, moved, seen = np.empty((4, m)), np.empty((2, 3 * n)), np.empty((2, n_row))
    for k in range(m):
        direct = course.drive[k] * factor / (turning - exponent[k])
        other, mirrored = np.conj(direct), direct
        if course.is_pair[k]:
            mirrored = course.mirrored_drive[k] * factor / (turning - np.conj(exponent[k]))
            other = np.conj(mirrored)
        cosine, sine = 0.5 * (direct + other), 0.5j * (direct - other)
        tables.enter_cosine[mode, 0, k], tables.enter_cosine[mode, 1, k] = cosine.real, cosine.imag
        tables.enter_sine[mode, 0, k], tables.enter_sine[mode, 1, k] = sine.real, sine.imag
        of_real, of_imaginary = direct, 1j * direct
        if course.is_pair[k]:
            of_real, of_imaginary = 0.5 * (direct + mirrored), 0.5j * (direct - mirrored)
        shares[0, k], shares[1, k] = of_real.real, of_real.imag
        shares[2, k], shares[3, k] = of_imaginary.real, of_imaginary.imag
    respond(tables.motion_re[mode], tables.motion_im[mode], shares, moved)
    for a in range(2 * n):
        tables.motion_re[mode, a, m], tables.motion_im[mode, a, m] = moved[0, a], moved[1, a]
    for a in range(n):
        acceleration = complex(moved[0, n + a], moved[1, n + a]) * turning
        moved[0, 2 * n + a], moved[1, 2 * n + a] = acceleration.real, acceleration.imag
    respond(tables.switch_re[mode], tables.switch_im[mode], shares, seen)
    for i in range(tables.switch_re.shape[1]):
        switch = complex(seen[0, i], seen[1, i]) - factor * course.reaction[i]
        tables.switch_re[mode, i, m], tables.switch_im[mode, i, m] = switch.real, switch.imag
        switch = switch * turning
        tables.rate_re[mode, i, m], tables.rate_im[mode, i, m] = switch.real, switch.imag
    respond(tables.slip_re[mode], tables.slip_im[mode], shares, seen)
    for i in range(tables.slip_re.shape[1]):
        slip = complex(seen[0, i], seen[1, i])
        tables.slip_re[mode, i, m], tables.slip_im[mode, i, m] = slip.real, slip.imag
        slip = slip * turning
        tables.slip_rate_re[mode, i, m], tables.slip_rate_im[mode, i, m] = slip.real, slip.imag
    fill_powers(tables, mode, exponent, end, tick)
    fill_bounds(tables, mode, exponent, end, tick)
    _look(course.output, moved, seen)
    for o in range(course.output.shape[0]):
        course.row[o, m] = complex(seen[0, o], seen[1, o])
    fill_outputs(tables.output[mode], course.row, exponent, end, interval, course.n_ahead)
    losses = course.losses
    if tables.loss.shape[1] > 0:
        respond(losses.resisting_re, losses.resisting_im, shares, seen)
        fill_energies(tables, mode, losses, course.phasor, exponent, m, end, factor, seen)


@linked_sum
def respond(re: Floats, im: Floats, shares: Floats, seen: Floats) -> None:
    """What rows (r, width), real and imaginary part, see of the response (2, r or more) by eigenmodes.

    `shares` (4, m) are what it has of the real parts of eigenmodes, real and imaginary part, and of the
    imaginary ones.
    """
    for a in range(re.shape[0]):
        real, imaginary = 0.0, 0.0
        for k in range(shares.shape[1]):
            real += shares[0, k] * re[a, k] + shares[2, k] * im[a, k]
            imaginary += shares[1, k] * re[a, k] + shares[3, k] * im[a, k]
        seen[0, a], seen[1, a] = real, imaginary


@linked_sum
def _look(rows: Floats, moved: Floats, seen: Floats) -> None:
    """What r rows (r, c) see of a response (2, c), real and imaginary part."""
    for i in range(rows.shape[0]):
        real, imaginary = 0.0, 0.0
        for a in range(rows.shape[1]):
            real += rows[i, a] * moved[0, a]
            imaginary += rows[i, a] * moved[1, a]
        seen[0, i], seen[1, i] = real, imaginary
