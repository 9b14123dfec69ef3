"""Eigenvectors of a system in which exponents repeat, as those of many identical stators on one carrier do.

A general eigensolver returns as many eigenvectors as an exponent has, but in a direction each that rounding
chooses: two may all but coincide. Here those of one exponent are replaced by an orthonormal basis of what
they span, in coordinates in which displacements and rates are of one size.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import matrix_balance
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

ROUNDING = 100 * np.finfo(np.float64).eps  # difference of two equal exponents, over the norm of the system
LEAST_SPREAD = 1e-7  # of eigenvectors of one exponent, between their least and their greatest direction
WORST_BALANCED = 1e7  # condition of all eigenvectors; where two exponents merge for good, it is some 1e8
REAL = 1e-12  # imaginary part of a real exponent, over the greatest


def separate(system: Floats) -> tuple[Complexes, Complexes, Complexes] | None:
    """Exponents, shapes and inverse shapes of a first-order system with repeated exponents.

    Parameters
    ----------
    system : (n, n)

    Returns
    -------
    exponent : (n,)
        1/s; those that differ by rounding alone are made equal.
    shape, inverse : (n, n)
        Shapes as columns, and the inverse of that matrix. None of all where shapes truly coincide, as in
        critical damping.
    """
    balanced, (scale, _) = matrix_balance(system, permute=False, separate=True)
    exponent, shape = (values.astype(np.complex128) for values in np.linalg.eig(balanced))
    is_real = real_ones(exponent)
    for group in _equal(exponent, ROUNDING * float(np.linalg.norm(balanced, 2))):
        if not (is_real[group].all() or np.all(exponent[group].imag > 0.0)):
            continue  # the lower half of conjugate pairs follows the upper
        real = bool(is_real[group].all())
        vectors = np.hstack([shape[:, group].real, shape[:, group].imag]) if real else shape[:, group]
        directions, size, _ = np.linalg.svd(vectors, full_matrices=False)
        if size[group.size - 1] < LEAST_SPREAD * size[0]:
            return None
        middle = exponent[group].mean()
        exponent[group] = middle.real if real else middle
        shape[:, group] = directions[:, : group.size]
        if not real:  # the solver puts a conjugate behind its partner
            exponent[group + 1], shape[:, group + 1] = exponent[group].conj(), shape[:, group].conj()
    if not np.linalg.cond(shape) < WORST_BALANCED:
        return None
    return exponent, scale[:, None] * shape, np.linalg.inv(shape) / scale


def real_ones(exponent: Complexes) -> NDArray[np.bool_]:
    """Which exponents are real, but for rounding."""
    is_real: NDArray[np.bool_] = np.abs(exponent.imag) <= REAL * np.abs(exponent).max()
    return is_real


def _equal(exponent: Complexes, tolerance: float) -> list[NDArray[np.int64]]:
    """Places of the exponents that repeat, of each apart."""
    near = np.abs(exponent[:, None] - exponent) <= tolerance
    _, group = connected_components(csr_array(near), directed=False)
    places = (np.flatnonzero(group == number) for number in np.unique(group))
    return [at for at in places if at.size > 1]
