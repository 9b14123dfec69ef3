"""Square matrices: checked when read from arrays or lists of rows, and encoded as text without loss."""

from __future__ import annotations

import base64
import binascii
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.messages import brief

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Matrix = NDArray[np.float64]

MOST_ROWS = 3000  # a matrix is dense: 72 MB
ROUNDING = 1e-9  # of the greatest entry: what a matrix may depart from symmetry by
_ENTRY = np.dtype([("row", "<i4"), ("column", "<i4"), ("value", "<f8")])


def parse_matrix(value: object, where: str) -> Matrix:
    """Return a matrix given as an array, sparse or not, as a list of rows, or as `encode_matrix` wrote it.

    Raises
    ------
    InputError
        When it is not a square matrix of finite real numbers.
    """
    if isinstance(value, dict):  # as a store holds it
        return _decoded(value, where)
    fix = "give the rows, [[1.0, 0.0], [0.0, 1.0]]"
    try:
        given = np.asarray(value.toarray() if hasattr(value, "toarray") else value)  # or a sparse one
        is_number = given.dtype.kind in "iuf"
    except ValueError:  # rows of unequal length
        is_number = False
    if not is_number:
        raise InputError(f"{where}: {brief(value)} is not a matrix of real numbers; {fix}")
    if given.ndim != 2 or given.shape[0] != given.shape[1] or not given.size:
        raise InputError(f"{where}: has the shape {given.shape}; give a square one, (n_dof, n_dof)")
    if len(given) > MOST_ROWS:
        problem = f"{len(given)} rows are too many; reduce the model to at most {MOST_ROWS}"
        raise InputError(f"{where}: {problem}")
    entries: Matrix = np.array(given, dtype=np.float64) + 0.0  # no negative zeros: they would not be equal
    if not np.isfinite(entries).all():
        row, column = np.argwhere(~np.isfinite(entries))[0]
        raise InputError(
            f"{where}: the entry in row {row + 1}, column {column + 1} is not finite; correct it"
        )
    entries.setflags(write=False)
    return entries


def encode_matrix(entries: Matrix) -> dict[str, Any]:
    """Return a matrix for JSON: its size, and the nonzero entries in base64."""
    row, column = np.nonzero(entries)
    packed = np.empty(row.size, dtype=_ENTRY)
    packed["row"], packed["column"], packed["value"] = row, column, entries[row, column]
    return {"size": len(entries), "nonzero": base64.b64encode(packed.tobytes()).decode()}


def symmetric_part(entries: Matrix) -> Matrix:
    """Half the sum of a matrix and its transpose; read-only."""
    half: Matrix = 0.5 * (entries + entries.T)
    half.setflags(write=False)
    return half


def is_symmetric(entries: Matrix, sign: float = 1.0) -> bool:
    """Whether a matrix is symmetric up to rounding; skew-symmetric for the sign -1."""
    return bool(np.abs(entries - sign * entries.T).max() <= ROUNDING * np.abs(entries).max())


def _decoded(table: dict[str, Any], where: str) -> Matrix:
    try:
        size = int(table["size"])
        if not 0 < size <= MOST_ROWS:
            raise ValueError
        packed = np.frombuffer(base64.b64decode(table["nonzero"], validate=True), dtype=_ENTRY)
        entries = np.zeros((size, size))
        entries[packed["row"], packed["column"]] = packed["value"]
    except (KeyError, TypeError, ValueError, IndexError, binascii.Error):
        raise InputError(f"{where}: cannot be decoded; give the rows of the matrix") from None
    return parse_matrix(entries, where)
