"""Uncoupled parts of a matrix: groups of rows that no entries connect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def coupled_rows(linked: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Rows of each part of a matrix (n, n) that nothing couples to the rest, by their first rows.

    `linked` states which entries couple; one of (i, j) and (j, i) is enough. For small
    matrices this is faster than a sparse graph.
    """
    either = linked | linked.T
    left, parts = np.ones(len(either), dtype=bool), []
    while left.any():
        inside = np.zeros(len(either), dtype=bool)
        inside[left.argmax()] = True
        while True:
            grown = inside | either[inside].any(axis=0)
            if np.array_equal(grown, inside):
                break
            inside = grown
        parts.append(np.flatnonzero(inside))
        left &= ~inside
    return parts
