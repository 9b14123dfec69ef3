"""Uncoupled parts of a matrix: groups of rows without entries between them."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


def coupled_rows(linked: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Rows of each uncoupled part of a matrix (n, n), in the order of their first rows.

    `linked` states which entries couple; one of (i, j) and (j, i) is enough.
    """
    number = coupled_parts(linked)
    order = np.argsort(number, kind="stable")
    begins = np.searchsorted(number[order], np.arange(number.max(initial=-1) + 1))
    return [rows for rows in np.split(order, begins) if rows.size]


def coupled_parts(linked: NDArray[np.bool_]) -> Ints:
    """Number of the part that each row belongs to, (n,), in the order of their first rows."""
    return _numbers(np.packbits(linked).tobytes(), len(linked))


@lru_cache(maxsize=32)
def _numbers(linked: bytes, n: int) -> Ints:
    """The same, cached: rigs that differ only in values couple the same entries."""
    bits = np.unpackbits(np.frombuffer(linked, dtype=np.uint8), count=n * n)
    number: Ints = connected_components(csr_array(bits.reshape(n, n)), directed=False)[1].astype(np.int64)
    number.flags.writeable = False
    return number


class Grouped:
    """Columns of motion over uncoupled groups of degrees, such as the bodies of a ring: (n_all, n).

    Parameters
    ----------
    groups : list of (r,) int
        Rows of each group; one group of all rows gives products of whole matrices.
    columns : (n_all, n)
        Each moves in one group only.
    """

    def __init__(self, groups: list[Ints], columns: Floats) -> None:
        self._columns = columns
        alike: dict[tuple[int, int], list[tuple[Ints, Ints]]] = {}
        if len(groups) > 1:
            moves = columns != 0.0
            for rows in groups:
                these = np.flatnonzero(moves[rows].any(axis=0))
                alike.setdefault((rows.size, these.size), []).append((rows, these))
        # Groups of one size are taken together, (group, r) and (group, c).
        self._groups = [tuple(map(np.array, zip(*of, strict=True))) for of in alike.values()]

    def under(self, matrix: Floats) -> Floats:
        """`matrix @ columns` (n_all, n), of a matrix that couples no groups."""
        if not self._groups:
            return np.asarray(matrix @ self._columns)
        product = np.zeros_like(self._columns)
        for rows, these in self._groups:
            at = rows[:, :, np.newaxis], these[:, np.newaxis]
            product[at] = matrix[rows[:, :, np.newaxis], rows[:, np.newaxis]] @ self._columns[at]
        return product

    def form(self, matrix: Floats) -> Floats:
        """`columns.T @ matrix @ columns` (n, n), of a matrix that couples no groups."""
        if not self._groups:
            return np.asarray(self._columns.T @ matrix @ self._columns)
        form = np.zeros((self._columns.shape[1],) * 2)
        for rows, these in self._groups:
            own = self._columns[rows[:, :, np.newaxis], these[:, np.newaxis]]
            inside = matrix[rows[:, :, np.newaxis], rows[:, np.newaxis]]
            form[these[:, :, np.newaxis], these[:, np.newaxis]] = own.transpose(0, 2, 1) @ inside @ own
        return form
