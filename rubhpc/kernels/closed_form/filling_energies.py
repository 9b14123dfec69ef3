"""Energies of a contact mode at a spin speed: what the response to the unbalance has of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels._struct import Struct

if TYPE_CHECKING:
    from rubhpc.kernels.contact_modes import ModeTables

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

STEADY = 1e-13  # sum of two exponents over the greatest, below which it is zero but for rounding


class Losses(Struct):
    """Forces of a mode that energies follow from; empty where none are asked for."""

    resisting_re: Floats  # (n, width), resisting forces by coordinates; those of the response are filled in
    resisting_im: Floats
    rubbed: Complexes  # (n,), what the unbalance at unit speed gives of them directly


@linked
def fill_energies(
    tables: ModeTables,
    mode: int,
    losses: Losses,
    phasor: Complexes,
    exponent: Complexes,
    m: int,
    end: int,
    factor: complex,
    resisted: Floats,
) -> None:
    """Fill in forms of the energies with the response, the coordinate `m` of `end`.

    `resisted` (2, n or more) are resisting forces on it by those on eigenmodes; the rest are as in `filling`.
    """
    n, width, turning = phasor.size, exponent.size, exponent[m]
    motion_re, motion_im, loss = tables.motion_re[mode], tables.motion_im[mode], tables.loss[mode]
    x, own = np.empty(n, dtype=np.complex128), np.empty(n, dtype=np.complex128)
    greatest = 0.0
    for k in range(width):
        greatest = max(greatest, abs(exponent[k]))
    least = 2.0 * STEADY * greatest
    steady, driven = 0.0, 0.0
    for a in range(n):
        x[a] = complex(motion_re[n + a, m], motion_im[n + a, m])
        own[a] = complex(resisted[0, a], resisted[1, a]) + factor * losses.rubbed[a]
        losses.resisting_re[a, m], losses.resisting_im[a, m] = own[a].real, own[a].imag
        steady += (x[a] * np.conj(own[a])).real
        driven += (x[a] * np.conj(factor * phasor[a])).real
    if 2.0 * abs(turning.real) > least:  # no power of the response is steady; the forms hold it
        steady, driven = 0.0, 0.0
    tables.steady_power[mode, 0], tables.steady_power[mode, 1] = 0.5 * steady, 0.5 * driven
    for k in range(end):
        across, across_conjugate, down, down_conjugate, work, work_conjugate = 0j, 0j, 0j, 0j, 0j, 0j
        for a in range(n):
            resisting = complex(losses.resisting_re[a, k], losses.resisting_im[a, k])
            rate = complex(motion_re[n + a, k], motion_im[n + a, k])
            across += x[a] * resisting
            across_conjugate += x[a] * np.conj(resisting)
            down += own[a] * rate
            down_conjugate += np.conj(own[a]) * rate
            work += phasor[a] * rate
            work_conjugate += np.conj(phasor[a]) * rate
        across = _primitive(across, turning + exponent[k], least)
        across_conjugate = _primitive(across_conjugate, turning + np.conj(exponent[k]), least)
        down = _primitive(down, exponent[k] + turning, least)
        down_conjugate = _primitive(down_conjugate, exponent[k] + np.conj(turning), least)
        both = across_conjugate + down_conjugate
        re_re = 0.25 * (across + down + both).real
        re_im = 0.25 * (across_conjugate - across - down - down_conjugate).imag
        im_re = 0.25 * (down_conjugate - down - across - across_conjugate).imag
        im_im = 0.25 * (both - across - down).real
        loss[m, k] = loss[k, m] = re_re
        loss[m, width + k] = loss[width + k, m] = re_im
        loss[width + m, k] = loss[k, width + m] = im_re
        loss[width + m, width + k] = loss[width + k, width + m] = im_im
        first = 0.5 * _primitive(factor * work, exponent[k] + turning, least)
        second = 0.5 * _primitive(np.conj(factor) * work_conjugate, exponent[k] + np.conj(turning), least)
        tables.work_re[mode, 0, k], tables.work_im[mode, 0, k] = first.real, first.imag
        tables.work_re[mode, 1, k], tables.work_im[mode, 1, k] = second.real, second.imag


@linked
def _primitive(power: complex, exponent: complex, least: float) -> complex:
    """Power over its exponent, 1/s; zero where that is zero."""
    return power / exponent if abs(exponent) > least else 0j
