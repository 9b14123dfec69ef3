"""Undamped modes of a symmetric body, accurate for the lowest even where a shaft is nearly rigid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import LinAlgError, eigh, null_space

from rubhpc.errors import InputError
from rubhpc.fem.computable import FAR_APART

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Matrix = NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)


def undamped_modes(mass: Matrix, stiffness: Matrix) -> tuple[Matrix, Matrix]:
    """Solve `K x = w^2 M x`.

    Parameters
    ----------
    mass, stiffness : (n_dof, n_dof)
        Symmetric, the mass positive definite.

    Returns
    -------
    square : (n_dof,)
        w^2, rad^2/s^2: exactly 0 for a rigid body's modes, which come first, then rising.
    basis : (n_dof, n_dof)
        Shapes as columns, `basis^T M basis = 1`.

    Raises
    ------
    InputError
        When the matrices are too ill-conditioned.

    Notes
    -----
    The eigenvalues of `(K, M)` carry the rounding of the highest, that of a short stiff element. Those of
    `(M, K)` are 1/w^2, exact for the lowest, and inexact only for frequencies some 1e7 times as high.
    """
    try:
        return _undamped_modes(mass, stiffness)
    except (LinAlgError, ValueError):  # which scipy raises for what is not finite
        raise InputError(f"modes: {FAR_APART}") from None


def _undamped_modes(mass: Matrix, stiffness: Matrix) -> tuple[Matrix, Matrix]:
    rigid = _rigid_shapes(mass, stiffness)
    if rigid.shape[1] == len(mass):
        return np.zeros(len(mass)), rigid
    complement = null_space((mass @ rigid).T) if rigid.size else np.eye(len(mass))
    M, K = (complement.T @ matrix @ complement for matrix in (mass, stiffness))
    try:
        flexibility, shapes = eigh(M, K)
    except LinAlgError:  # not positive definite: a negative stiffness
        square, shapes = eigh(K, M)
    else:
        flexibility = np.maximum(flexibility, EPS * flexibility.max())[::-1]
        square, shapes = 1 / flexibility, shapes[:, ::-1] / np.sqrt(flexibility)
    return np.append(np.zeros(rigid.shape[1]), square), np.hstack([rigid, complement @ shapes])


def _rigid_shapes(mass: Matrix, stiffness: Matrix) -> Matrix:
    """Motions that meet no stiffness, (n_dof, n_rigid), of unit modal mass.

    They are the null space of K scaled to a unit diagonal, whose smallest other value falls only with the
    number of elements, not with the frequencies of the mesh.
    """
    scale = np.sqrt(np.abs(np.diag(stiffness)))
    scale[scale == 0.0] = 1.0
    values, vectors = eigh(stiffness / np.outer(scale, scale))
    shapes = vectors[:, np.abs(values) < 4 * len(values) * EPS] / scale[:, np.newaxis]
    to_unit_mass = np.linalg.inv(np.linalg.cholesky(shapes.T @ mass @ shapes)).T
    rigid: Matrix = shapes @ to_unit_mass
    return rigid
