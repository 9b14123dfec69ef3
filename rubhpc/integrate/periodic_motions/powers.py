"""Powers of the matrix that carries small changes of a periodic motion through its period."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class Powers:
    """A matrix (m, m), and its powers of 2, 4, 8, ..., each found once.

    Parameters
    ----------
    matrix : (m, m)
    """

    def __init__(self, matrix: Floats) -> None:
        self._found = [matrix]

    def of(self, k: int) -> Floats:
        """Return the matrix to the power 2^k."""
        while len(self._found) <= k:
            self._found.append(self._found[-1] @ self._found[-1])
        return self._found[k]

    def sequence(self, start: Floats, n: int) -> Floats:
        """Return what becomes of a vector (m,): itself, and each next one, (m, n); n a power of 2."""
        found = np.empty((start.size, n))
        found[:, 0] = start
        for k in range(n.bit_length() - 1):
            np.matmul(self.of(k), found[:, : 1 << k], out=found[:, 1 << k : 2 << k])
        return found
