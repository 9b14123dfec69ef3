"""What belongs to a speed in the tables of a contact mode with curved gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels.contact_modes import add_rows
from rubhpc.kernels.curved_contact import CurvedTables  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.mode_change import product

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@jit_sum
def tune_curved(
    tables: CurvedTables,
    mode: int,
    first: int,
    is_open: bool,
    longest: float,
    exponent: Complexes,
    motion_re: Floats,
    motion_im: Floats,
    row: Floats,
    dampers: Floats,
    stiffness: Floats,
    damping: Floats,
    force: Floats,
    work: Floats,
) -> None:
    """Bring the tables of a mode to the speed and the unbalance force of the matrices.

    Parameters
    ----------
    first : int
        Coordinate of the response to the unbalance.
    is_open : bool
        Whether no pair is closed; nothing else than readings is needed then.
    longest : float
        The longest step, s.
    exponent : (m,)
        Of the coordinates.
    motion_re, motion_im : (2 n, m)
        Displacements, then velocities, by the coordinates.
    row : (q, 3 + b, n)
        `curved_library.motion_rows`.
    dampers : (n, r)
        `curved_library.StillParts`.
    stiffness, damping, force : (n, n), (n, n), (2, n)
        As in `reduction.ReducedModel`.
    work : (2, n)
        Work space.
    """
    q, d, n = row.shape[0], row.shape[1] - 1, stiffness.shape[0]
    for k in range(exponent.size):
        re, im = exponent[k].real, exponent[k].imag
        size = re * re + im * im
        tables.exponent_re[mode, k], tables.exponent_im[mode, k] = re, im
        tables.inverse_re[mode, k] = re / size if size > 0.0 else 0.0
        tables.inverse_im[mode, k] = -im / size if size > 0.0 else 0.0
    for i in range(q):
        re, im = tables.read_re[mode, i], tables.read_im[mode, i]
        re[:], im[:] = 0.0, 0.0
        for j in range(d + 1):
            if j < d:
                elastic, damped = work[0], work[1]
                elastic[:], damped[:] = 0.0, 0.0
                for a in range(n):
                    for b in range(n):
                        elastic[b] -= row[i, j, a] * stiffness[a, b]
                        damped[b] -= row[i, j, a] * damping[a, b]
                free = 2 * d + 1 + j
                add_rows(motion_re[:n], row[i, j], re[j])
                add_rows(motion_im[:n], row[i, j], im[j])
                add_rows(motion_re[:n], elastic, re[free])
                add_rows(motion_im[:n], elastic, im[free])
                add_rows(motion_re[n:], damped, re[free])
                add_rows(motion_im[n:], damped, im[free])
                for a in range(n):
                    re[free, first] += row[i, j, a] * force[0, a]
                    im[free, first] -= row[i, j, a] * force[1, a]
            add_rows(motion_re[n:], row[i, j], re[d + j])
            add_rows(motion_im[n:], row[i, j], im[d + j])
        for j in range(d):
            for k in range(exponent.size):
                size = exponent[k].real ** 2 + exponent[k].imag ** 2
                size *= np.exp(max(exponent[k].real, 0.0) * longest)
                tables.bound[mode, i, j, k] = np.sqrt(re[j, k] * re[j, k] + im[j, k] * im[j, k]) * size
    if is_open:
        return
    tables.is_filled[mode, :] = False
    tables.used[mode] = first + 1
    for a in range(2 * n):
        for k in range(tables.used[mode], exponent.size):
            if motion_re[a, k] != 0.0 or motion_im[a, k] != 0.0:
                tables.used[mode] = k + 1
    if tables.seen_re.shape[2] > 0:
        _see_loads(tables, mode)
    n_loss = dampers.shape[1]
    for k in range(exponent.size):
        for part in range(2):
            drain, sign = tables.drain[mode, part, k], 1.0 - 2.0 * part
            rate = motion_re if part == 0 else motion_im
            drain[:] = 0.0
            for a in range(n):
                moved = sign * rate[n + a, k]
                for r in range(n_loss):
                    drain[r] += moved * dampers[a, r]
                drain[n_loss] += moved * force[0, a]
                drain[n_loss + 1] += moved * force[1, a]
    for i in range(q):
        for r in range(2):
            tables.drain_moved[mode, n_loss + r, i] = product(force[r], tables.shift[mode, i])


@linked_sum
def _see_loads(tables: CurvedTables, mode: int) -> None:
    """Fill what unit loads give of each coordinate's readings, of a single pair."""
    for j in range(tables.seen_re.shape[1]):
        load_re, load_im = tables.load_re[mode, 0, j], tables.load_im[mode, 0, j]
        for r in range(tables.seen_re.shape[2]):
            read_re, read_im = tables.read_re[mode, 0, r], tables.read_im[mode, 0, r]
            re, im = tables.seen_re[mode, j, r], tables.seen_im[mode, j, r]
            for k in range(re.size):
                re[k] = read_re[k] * load_re[k] - read_im[k] * load_im[k]
                im[k] = read_re[k] * load_im[k] + read_im[k] * load_re[k]
