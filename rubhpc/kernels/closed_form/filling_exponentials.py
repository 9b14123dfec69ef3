"""Exponentials of a contact mode at another spin speed, and the parts of its tables that follow from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels.contact_modes import DYING, FORCED_LEVEL, ModeTables

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

SQUARED = 4  # levels of exponentials, of which one is evaluated and the others follow by squaring
GONE = -40.0  # exponent of what has died away


@linked
def fill_powers(tables: ModeTables, mode: int, exponent: Complexes, end: int, tick: float) -> None:
    """Exponentials of the first `end` coordinates."""
    n_level = tables.power_re.shape[1]
    power_re, power_im = tables.power_re[mode], tables.power_im[mode]
    for level in range(n_level):
        re, im = power_re[level], power_im[level]
        if level % SQUARED == 0:
            time = tick * 2.0**level
            for k in range(end):
                power = exponential(exponent[k], time)
                re[k], im[k] = power.real, power.imag
        else:  # to square doubles the rounding
            re_before, im_before = power_re[level - 1], power_im[level - 1]
            for k in range(end):
                a, b = re_before[k], im_before[k]
                re[k], im[k] = a * a - b * b, 2.0 * (a * b)


@linked
def fill_bounds(tables: ModeTables, mode: int, exponent: Complexes, end: int, tick: float) -> None:
    """What bounds and paces have of the exponentials of the first `end` coordinates."""
    longest = tick * 2.0 ** (tables.power_re.shape[1] - 1)
    weight = np.empty(end)
    for k in range(end):
        size, real = abs(exponent[k]), exponent[k].real
        weight[k] = size * size * (np.exp(real * longest) if real > 0.0 else 1.0)
        tables.pace[mode, k] = DYING if real * tick * 2.0**FORCED_LEVEL < GONE else size
    for i in range(tables.bound.shape[1]):
        re, im, bound = tables.switch_re[mode, i], tables.switch_im[mode, i], tables.bound[mode, i]
        for k in range(end):
            bound[k] = np.sqrt(re[k] * re[k] + im[k] * im[k]) * weight[k]


@linked
def fill_outputs(
    output: Floats, row: Complexes, exponent: Complexes, end: int, interval: float, n_ahead: int
) -> None:
    """Outputs at `n_ahead` coming samples by the first `end` coordinates; zeros that stay are left.

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
        onward, ahead = exponential(exponent[k], interval), 1.0 + 0j
        for later in range(n_ahead):
            for i in range(count):
                o = seen[i]
                value = ahead * row[o, k]
                real[later * n_output + o] = value.real
                imaginary[later * n_output + o] = -value.imag
            ahead *= onward


@linked
def exponential(exponent: complex, time: float) -> complex:
    """Exponential over a time, s, in a quarter of the time of one that looks for infinite arguments."""
    size, turn = np.exp(exponent.real * time), exponent.imag * time
    return complex(size * np.cos(turn), size * np.sin(turn))
