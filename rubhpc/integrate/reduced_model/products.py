"""Products of real matrices with complex ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


def real_times(matrix: Floats, values: Complexes) -> Complexes:
    """Product of a real matrix (n, m) with complex values (m, k), as one product with both parts.

    NumPy would convert the matrix to complex numbers, which takes four times the operations.
    """
    halves = np.ascontiguousarray(values).view(np.float64)
    product: Complexes = np.ascontiguousarray(matrix @ halves).view(np.complex128)
    return product


def times_real(values: Complexes, matrix: Floats) -> Complexes:
    """Product of complex values (k, m) with a real matrix or vector, (m, n) or (m,)."""
    product: Complexes = (values.real @ matrix) + 1j * (values.imag @ matrix)
    return product


def expanded(tangent: Floats, values: Complexes) -> Complexes:
    """Displacements, then velocities, (2 n, k), of coordinates and their rates (2 m, k) by a basis (n, m)."""
    m = tangent.shape[1]
    return np.vstack([real_times(tangent, values[:m]), real_times(tangent, values[m:])])
