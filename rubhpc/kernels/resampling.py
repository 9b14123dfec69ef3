"""Signals at other instants than those of their samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NODES = 4  # of the cubic through the samples around an instant


@jit
def resample(rows: Floats, late: Floats, cuts: Ints) -> None:
    """Bring signals (r, n) to instants that are later by `late` (n,) intervals of sampling, in place.

    Samples are evenly spaced between any of `cuts` (k + 1,) and the next, from 0 to n. By Lagrange's cubic
    through the four samples between them that are nearest, the cuts included; it is exact for cubics.
    """
    n = rows.shape[1]
    if n < NODES:
        return
    before = np.empty(n)
    for row in range(rows.shape[0]):
        for i in range(n):
            before[i] = rows[row, i]
        for piece in range(cuts.size - 1):
            highest = max(min(cuts[piece + 1], n - 1) - NODES + 1, 0)
            lowest = min(cuts[piece], highest)
            for i in range(cuts[piece], cuts[piece + 1]):
                if late[i] == 0.0:
                    continue
                at = i + late[i]
                first = min(max(int(np.floor(at)) - 1, lowest), highest)
                a = at - first
                b, c, d = a - 1.0, a - 2.0, a - 3.0
                rows[row, i] = (
                    before[first + 1] * (a * c * d)
                    - before[first + 2] * (a * b * d)
                    + (before[first + 3] * (a * b * c) - before[first] * (b * c * d)) / 3.0
                ) / 2.0
