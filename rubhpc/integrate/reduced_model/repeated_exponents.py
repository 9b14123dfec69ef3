"""Eigenvectors of a system with repeated exponents, such as many identical stators on one carrier.

A general eigensolver returns all eigenvectors of a repeated exponent, but rounding determines their
directions: two may nearly coincide. Here the eigenvectors of one exponent are replaced by an orthonormal
basis of their span, in coordinates in which displacements and rates have equal size.
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
LEAST_SPREAD = 1e-7  # of eigenvectors of one exponent, least singular value over the greatest
WORST_BALANCED = 1e7  # condition of all eigenvectors; for a defective system about 1e8
REAL = 1e-12  # imaginary part of a real exponent, over the greatest


def separate(system: Floats) -> tuple[Complexes, Complexes, Complexes] | None:
    """Exponents, shapes and inverse shapes of a first-order system with repeated exponents.

    Parameters
    ----------
    system : (n, n)

    Returns
    -------
    exponent : (n,)
        1/s; those that differ only by rounding are made equal.
    shape, inverse : (n, n)
        Shapes as columns, and the inverse of that matrix. The result is None where shapes coincide, as in
        critical damping.
    """
    with np.errstate(invalid="ignore"):  # in the permutation that it also makes of the scale
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
        if not real:  # the solver places a conjugate after its partner
            exponent[group + 1], shape[:, group + 1] = exponent[group].conj(), shape[:, group].conj()
    if not np.linalg.cond(shape) < WORST_BALANCED:
        return None
    return exponent, scale[:, None] * shape, np.linalg.inv(shape) / scale


def real_ones(exponent: Complexes) -> NDArray[np.bool_]:
    """Which exponents are real up to rounding."""
    is_real: NDArray[np.bool_] = np.abs(exponent.imag) <= REAL * np.abs(exponent).max()
    return is_real


def _equal(exponent: Complexes, tolerance: float) -> list[NDArray[np.int64]]:
    """Places of each group of repeated exponents."""
    near = np.abs(exponent[:, None] - exponent) <= tolerance
    _, group = connected_components(csr_array(near), directed=False)
    places = (np.flatnonzero(group == number) for number in np.unique(group))
    return [at for at in places if at.size > 1]
