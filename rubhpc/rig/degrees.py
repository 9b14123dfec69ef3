"""What the rows of a linear body's matrices are, and whether the matrices can be those of a body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError
from rubhpc.input.matrix import is_symmetric, parse_matrix, symmetric_part

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

NEGATIVE = 1e-8  # of a matrix scaled to a unit diagonal: the least eigenvalue that is taken for zero


def checked_matrices(owner: Any, keys: Sequence[str], rows: Sequence[str]) -> None:
    """Make the fields of a frozen dataclass matrices of one size, zeros where there is none.

    Parameters
    ----------
    keys : sequence of str
        Fields; the first one is there and gives the size.
    rows : sequence of str
        What an error calls each row.
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
            problem = f"of shape {shape} for {len(rows)} degrees; every row has one degree"
            raise FieldError(key, f"{problem}: mend the matrix or degrees")
        object.__setattr__(owner, key, entries)


def check_body(owner: Any, rows: Sequence[object]) -> None:
    """Refuse mass and stiffness that no body has, and names that stand twice; make symmetric what is so.

    M has to be symmetric and positive definite. Rounding of K is taken out; its skew part, that of a bearing
    with cross-coupling, stays, but its symmetric part may not have a negative stiffness.
    """
    named = [name if isinstance(name, str) else f"{name[0]}.{name[1]}" for name in rows]  # type: ignore[index]
    for name in named:
        if named.count(name) > 1:
            raise FieldError("degrees", f"{name} stands twice; every row has a name of its own")
    mass, stiffness = owner.mass, owner.stiffness
    if not is_symmetric(mass):
        raise FieldError("mass", f"is not symmetric{_worst(mass, named)}; mend it")
    object.__setattr__(owner, "mass", symmetric_part(mass))
    diagonal = np.diag(mass)
    if not diagonal.min() > 0.0:
        name = named[int(diagonal.argmin())]
        problem = f"degree {name} has none (its entry on the diagonal is {diagonal.min():g})"
        raise FieldError("mass", f"{problem}; give it some, or condense the degree out of the matrices")
    if not _least_eigenvalue(mass) > 0.0:
        raise FieldError("mass", "is not positive definite: a motion would have no inertia; mend it")
    if is_symmetric(stiffness):
        object.__setattr__(owner, "stiffness", symmetric_part(stiffness))
    if np.diag(stiffness).min() < 0.0:
        name = named[int(np.diag(stiffness).argmin())]
        raise FieldError("stiffness", f"degree {name} has a negative one; mend the matrix")
    if _least_eigenvalue(symmetric_part(stiffness)) < -NEGATIVE:
        raise FieldError("stiffness", "is not positive semidefinite: a motion has a negative one; mend it")


def _least_eigenvalue(entries: NDArray[np.float64]) -> float:
    """Of a symmetric matrix scaled to a unit diagonal."""
    diagonal = np.abs(np.diag(entries))
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, max(diagonal.max(), 1.0)))
    return float(np.linalg.eigvalsh(entries / np.outer(scale, scale))[0])


def _worst(entries: NDArray[np.float64], named: Sequence[str]) -> str:
    row, column = divmod(int(np.abs(entries - entries.T).argmax()), len(entries))
    return f" ({named[row]} with {named[column]}: {entries[row, column]:g} and {entries[column, row]:g})"
