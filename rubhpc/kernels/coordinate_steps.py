"""Modal coordinates some ticks later: products of exponentials over powers of two of ticks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum

Floats = NDArray[np.float64]

MANTISSA, BIAS = 52, 1023  # bits, and offset of the exponent of a double


@linked_sum
def lowest_level(count: int) -> int:
    """Level of the shortest of the powers of two that make up a count of at least one."""
    return floor_log2(count & -count)


@linked_sum
def floor_log2(count: int) -> int:
    """Largest level with 2^level <= count, from 1 to 2^53: the exponent of the count as a float."""
    return int((np.float64(count).view(np.int64) >> MANTISSA) - BIAS)


@linked_sum
def turn_on(count: int, power_re: Floats, power_im: Floats, z_re: Floats, z_im: Floats) -> None:
    """Advance modal coordinates (m,) by `count` ticks in place.

    `power` (n_level, m) are the exponentials of a contact mode. The shortest steps come first, two at a time.
    """
    level, rest = 0, count
    while rest != 0:
        shift = lowest_level(rest)
        level, rest = level + shift, rest >> (shift + 1)
        a_re, a_im = power_re[level], power_im[level]
        level += 1
        if rest == 0:
            for k in range(z_re.size):
                x, y = z_re[k], z_im[k]
                z_re[k] = a_re[k] * x - a_im[k] * y
                z_im[k] = a_re[k] * y + a_im[k] * x
            return
        shift = lowest_level(rest)
        level, rest = level + shift, rest >> (shift + 1)
        b_re, b_im = power_re[level], power_im[level]
        level += 1
        for k in range(z_re.size):
            x, y = z_re[k], z_im[k]
            u, v = a_re[k] * x - a_im[k] * y, a_re[k] * y + a_im[k] * x
            z_re[k] = b_re[k] * u - b_im[k] * v
            z_im[k] = b_re[k] * v + b_im[k] * u
