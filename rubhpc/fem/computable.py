"""Refuse bodies whose values are so far apart that their matrices cannot be computed with."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rubhpc.fem.model import Body

FAR_APART = "lengths, stiffnesses or densities are too far apart to compute with; correct them"
ROUNDING = 1e-13  # least eigenvalue, with a unit diagonal, at which a mass matrix counts as definite
MOST_DEGREES = 3000  # of freedom of a rig: its matrices are dense, 72 MB each


@contextmanager
def computable(part: str) -> Iterator[None]:
    """Report a number that overflows while a part of a rig is assembled.

    Raises
    ------
    InputError
        Names the part.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is found in the matrices
            yield
    except ArithmeticError:  # an overflow, or a division by what has become zero
        raise InputError(_problem(part)) from None


def check_computable(part: str, body: Body) -> None:
    """Refuse a body with entries that are not finite, or a mass matrix that rounding has made indefinite."""
    matrices = (body.mass, body.damping, body.gyroscopic, body.stiffness)
    if not all(np.isfinite(matrix).all() for matrix in matrices):
        raise InputError(_problem(part))
    diagonal = np.diag(body.mass)
    try:
        if not (diagonal > 0.0).all():
            raise np.linalg.LinAlgError
        size = np.sqrt(diagonal)
        np.linalg.cholesky(body.mass / size / size[:, np.newaxis] - ROUNDING * np.eye(body.n_dof))
    except np.linalg.LinAlgError:
        raise InputError(_problem(part)) from None


def _problem(part: str) -> str:
    return f"{part}: {FAR_APART}"
