"""Room for arrays that kernels read in whole vectors."""

from __future__ import annotations

import math
import mmap
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_PAGES = 2**16  # bytes from which an array has pages of its own
_LINE = 64  # bytes of a line of the processor's cache
_FLOATS = np.dtype(np.float64)


def room_for(shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
    """An array with pages of its own, which go back to the system with it.

    Those of the C library would not: once a few megabytes have been given back it takes arrays up to 32 MB
    from its heap, which smaller ones behind them keep from shrinking (M_MMAP_THRESHOLD in mallopt(3)): 24
    set-ups of a ring of eight, of which four are held at a time, took 840 MB so, and take 430.
    """
    n_byte = math.prod(shape) * dtype.itemsize
    if n_byte < _PAGES:
        return aligned(shape, dtype)
    pages = mmap.mmap(-1, n_byte, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return np.ndarray(shape, dtype, buffer=pages)


def aligned(shape: tuple[int, ...], dtype: np.dtype[Any] = _FLOATS) -> NDArray[Any]:
    """An array of zeros that begins with a line of the processor's cache.

    A vector of eight numbers is such a line, and takes twice as long to read or write from two of them.
    """
    n_byte = math.prod(shape) * dtype.itemsize
    room = np.zeros(n_byte + _LINE, dtype=np.uint8)
    first = -room.ctypes.data % _LINE
    return np.ndarray(shape, dtype, buffer=room, offset=first)
