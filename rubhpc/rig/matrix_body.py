"""Checks of user-supplied matrices: sizes, names of the rows, mass and stiffness of a physical body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError
from rubhpc.input.matrix import is_symmetric, parse_matrix, symmetric_part

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

NEGATIVE = 1e-8  # of a matrix scaled to a unit diagonal: eigenvalues above minus this count as zero


def checked_matrices(owner: Any, keys: Sequence[str], rows: Sequence[str]) -> None:
    """Convert fields of a frozen dataclass to matrices of one size; missing ones become zero.

    Parameters
    ----------
    keys : sequence of str
        Fields; the first one is present and gives the size.
    rows : sequence of str
        Name of each row.
    """
    for key in keys:
        value = getattr(owner, key)
        if value is None:
            size = len(getattr(owner, keys[0]))
            value = np.zeros((size, size))
        try:
            entries = parse_matrix(value, key)
        except InputError as error:
            raise FieldError(key, str(error).removeprefix(f"{key}: ")) from None
        if len(entries) != len(rows):
            shape = f"({len(entries)}, {len(entries)})"
            problem = f"of shape {shape}, but there are {len(rows)} degrees"
            raise FieldError(key, f"{problem}; give one degree per row")
        object.__setattr__(owner, key, entries)


def check_body(owner: Any, rows: Sequence[object]) -> None:
    """Refuse duplicate names and an unphysical mass or stiffness; remove asymmetry that is rounding.

    M must be symmetric and positive definite. K may have a skew part, that of a bearing with cross-coupling,
    but its symmetric part must have no negative stiffness.
    """
    named = [name if isinstance(name, str) else f"{name[0]}.{name[1]}" for name in rows]  # type: ignore[index]
    for name in named:
        if named.count(name) > 1:
            raise FieldError("degrees", f"{name} is duplicated; give every row its own name")
    mass, stiffness = owner.mass, owner.stiffness
    if not is_symmetric(mass):
        raise FieldError("mass", f"is not symmetric{_worst(mass, named)}; make it symmetric")
    object.__setattr__(owner, "mass", symmetric_part(mass))
    diagonal = np.diag(mass)
    if not diagonal.min() > 0.0:
        name = named[int(diagonal.argmin())]
        problem = f"degree {name} has no mass (its diagonal entry is {diagonal.min():g})"
        raise FieldError("mass", f"{problem}; add some, or condense the degree out of the matrices")
    if not _least_eigenvalue(mass) > 0.0:
        raise FieldError("mass", "is not positive definite; correct the matrix")
    if is_symmetric(stiffness):
        object.__setattr__(owner, "stiffness", symmetric_part(stiffness))
    if np.diag(stiffness).min() < 0.0:
        name = named[int(np.diag(stiffness).argmin())]
        raise FieldError("stiffness", f"degree {name} has a negative stiffness; correct the matrix")
    if _least_eigenvalue(symmetric_part(stiffness)) < -NEGATIVE:
        raise FieldError("stiffness", "is not positive semidefinite; correct the matrix")


def _least_eigenvalue(entries: NDArray[np.float64]) -> float:
    """Least eigenvalue of a symmetric matrix scaled to a unit diagonal."""
    diagonal = np.abs(np.diag(entries))
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, max(diagonal.max(), 1.0)))
    return float(np.linalg.eigvalsh(entries / np.outer(scale, scale))[0])


def _worst(entries: NDArray[np.float64], named: Sequence[str]) -> str:
    row, column = divmod(int(np.abs(entries - entries.T).argmax()), len(entries))
    return f" ({named[row]} with {named[column]}: {entries[row, column]:g} and {entries[column, row]:g})"
