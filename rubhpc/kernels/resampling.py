"""Resampling of signals from even times to even angles of a shaft whose speed changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NODES = 4  # of the cubic through the samples around an instant


@jit
def resample(rows: Floats, swing: Floats, cuts: Ints) -> None:
    """Resample signals (r, n) to even angles between consecutive `cuts` (k + 1,), from 0 to n, in place.

    There they are sampled at even times, and the speed changes linearly by `swing` (k,) times the sum of the
    first and the last one. With the swing e, the shaft reaches the share x of the angle at the share y of the
    time with `x = (1 - e) y + e y^2`. The interpolation is Lagrange's cubic through the four nearest samples,
    including the cuts; it is exact for cubics of the time.
    """
    n = rows.shape[1]
    if n < NODES:
        return
    before, late = np.empty(n), np.empty(n)
    for piece in range(cuts.size - 1):
        size, e = cuts[piece + 1] - cuts[piece], swing[piece]
        for i in range(size):
            x = i / size
            late[cuts[piece] + i] = 2.0 * i / (1.0 - e + np.sqrt((1.0 - e) ** 2 + 4.0 * e * x)) - i
    for row in range(rows.shape[0]):
        for i in range(n):
            before[i] = rows[row, i]
        for piece in range(cuts.size - 1):
            if swing[piece] == 0.0:
                continue
            highest = max(min(cuts[piece + 1], n - 1) - NODES + 1, 0)
            lowest = min(cuts[piece], highest)
            for i in range(cuts[piece], cuts[piece + 1]):
                at = i + late[i]
                first = min(max(int(np.floor(at)) - 1, lowest), highest)
                a = at - first
                b, c, d = a - 1.0, a - 2.0, a - 3.0
                rows[row, i] = (
                    before[first + 1] * (a * c * d)
                    - before[first + 2] * (a * b * d)
                    + (before[first + 3] * (a * b * c) - before[first] * (b * c * d)) / 3.0
                ) / 2.0
