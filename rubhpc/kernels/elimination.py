"""Linear equations of some dozen unknowns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum

Floats = NDArray[np.float64]


@linked_sum
def eliminate(rows: Floats, n: int) -> bool:
    """Turn the first n rows (A | B) into (. | A^-1 B), A (n, n); False where A is singular.

    By Gauss and Jordan's method; it pivots by rows. What is left of A is of no meaning.
    """
    width = rows.shape[1]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(rows[i, k]) > abs(rows[pivot, k]):
                pivot = i
        if not abs(rows[pivot, k]) > 0.0:
            return False
        chosen, other, scale = rows[pivot], rows[k], 1.0 / rows[pivot, k]
        for j in range(k, width):
            held = scale * chosen[j]
            chosen[j] = other[j]
            other[j] = held
        for i in range(n):
            target = rows[i]
            factor = target[k]
            if i != k and factor != 0.0:
                for j in range(k, width):
                    target[j] -= factor * other[j]
    return True
