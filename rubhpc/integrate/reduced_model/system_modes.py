"""Eigenmodes of a first-order system; uncoupled parts are solved separately."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import matrix_balance
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rubhpc.errors import InputError
from rubhpc.integrate.reduced_model.coupling import coupled_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


ROUNDING = 100 * np.finfo(np.float64).eps  # difference of two equal exponents, over the norm of the system
LEAST_SPREAD = 1e-7  # of eigenvectors of one exponent, least singular value over the greatest
WORST_BALANCED = 1e7  # condition of all eigenvectors; for a defective system about 1e8
REAL = 1e-12  # imaginary part of a real exponent, over the greatest

WORST_CONDITION = 1e11  # of the eigenvectors; above it their sums lose digits, and they are separated


def separate(system: Floats) -> tuple[Complexes, Complexes, Complexes] | None:
    """Exponents, shapes and inverse shapes of a first-order system with repeated exponents.

    Many identical stators on one carrier have such. A general eigensolver returns all eigenvectors of a
    repeated exponent, but rounding determines their directions: two may nearly coincide. They are replaced by
    an orthonormal basis of their span, in coordinates in which displacements and rates have equal size.

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


def modes_of(system: Floats) -> tuple[Complexes, Complexes, Complexes]:
    """Exponents, shapes and inverse shapes of a first-order system; one of each conjugate pair, doubled.

    Uncoupled parts are solved separately: in a ring only the stators that touch move with the rotor.
    """
    n_state = len(system)
    exponents: list[Complexes] = [np.zeros(0, dtype=np.complex128)]  # a mass on a rigid wall has no modes
    shapes: list[Complexes] = [np.zeros((n_state, 0), dtype=np.complex128)]
    inverses: list[Complexes] = [np.zeros((0, n_state), dtype=np.complex128)]
    for rows in coupled_rows(system != 0.0):
        exponent, shape, inverse = solve_part(system[np.ix_(rows, rows)])
        wide, tall = np.zeros((2, n_state, exponent.size), dtype=np.complex128)
        wide[rows], tall[rows] = shape, inverse.T
        exponents.append(exponent)
        shapes.append(wide)
        inverses.append(tall.T)
    return np.concatenate(exponents), np.hstack(shapes), np.vstack(inverses)


def solve_part(part: Floats) -> tuple[Complexes, Complexes, Complexes]:
    """Exponents, shapes and inverse shapes of an uncoupled part of a system."""
    exponent, shape = np.linalg.eig(part)
    inverse = _inverse(shape)
    if inverse is None and (separated := separate(part)) is not None:
        exponent, shape, inverse = separated
    if inverse is None:
        raise InputError(
            "[integrator] method: modal cannot separate the modes of this rig, some of which coincide (a "
            'free body, critical damping); set method = "central-difference"'
        )
    is_real, keep = _kept(exponent)
    weight = np.where(is_real, 1.0, 2.0)
    return (
        exponent[keep].astype(np.complex128),
        (shape * weight)[:, keep].astype(np.complex128),
        inverse[keep].astype(np.complex128),
    )


def _inverse(shape: Complexes) -> Complexes | None:
    """Inverse of eigenvectors, or None if their condition is too bad; Frobenius norms are tried first."""
    try:
        inverse = np.linalg.inv(shape)
    except np.linalg.LinAlgError:
        return None
    bound = np.linalg.norm(shape) * np.linalg.norm(inverse)
    is_well = bound <= WORST_CONDITION or np.linalg.cond(shape) <= WORST_CONDITION
    return np.asarray(inverse) if is_well else None


def parts_of(system: Floats, q: int) -> list[NDArray[np.int64]]:
    """Rows of each uncoupled part; all rows for one pair, where separation saves little."""
    return coupled_rows(system != 0.0) if q > 1 else [np.arange(len(system))]


def _kept(exponent: Complexes) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which exponents of an uncoupled part are real, and which are kept: one of each conjugate pair."""
    is_real = real_ones(exponent)
    return is_real, is_real | (exponent.imag > 0.0)
