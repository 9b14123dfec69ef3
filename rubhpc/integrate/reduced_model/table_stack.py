"""Tables of contact modes of one width, stacked in memory that grows, and arrays for kernels."""

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

MOST_MODES = 1024  # sets of closed contacts of one speed and friction
FIRST_ROOM = 2  # for a contact-free case and one that enters a contact
NEXT_ROOM = 16  # for a case that keeps rubbing; then for all, because growing copies
MOST_BYTES = 3 * 2**30  # of their tables
_KEPT = 2**24  # bytes of an array up to which the C library keeps freed memory

# It takes arrays smaller than the largest freed one from its heap, which keeps twice as much (mallopt(3)).
# Without such tables the memory of spectra would be returned and allocated again in every case.
np.empty(_KEPT, dtype=np.uint8)


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


class TableStack:
    """Stacked tables of contact modes of one width.

    Attributes
    ----------
    n_most : int
        Most modes: those of each pair closed alone, and as many further sets as MOST_MODES and MOST_BYTES
        allow.
    """

    def __init__(self, n_least: int) -> None:
        self.n_most = max(n_least, MOST_MODES)
        self._n_least, self._n_filled, self._n_written = n_least, 0, 0
        self._room: list[Any] = []
        self._view: Any = None

    def add(self, row: Any) -> None:
        """Add the tables of a mode, a named tuple of (1, ...) each."""
        rows: list[Any] = list(row)
        first, end = self._n_filled, self._n_filled + 1
        if not self._room:
            n_bytes = sum(field.nbytes for field in rows)
            self.n_most = max(self._n_least, min(self.n_most, MOST_BYTES // n_bytes))
            n_room = min(self._n_least, FIRST_ROOM)
            self._room = [room_for((n_room, *field.shape[1:]), field.dtype) for field in rows]
            self._kind = type(row)
        elif end > len(self._room[0]):  # unwritten memory is not allocated by the system
            n_room = max(end, min(NEXT_ROOM, self.n_most) if end <= NEXT_ROOM else self.n_most)
            for i, field in enumerate(self._room):  # one by one: all together would need twice the memory
                self._room[i] = room_for((n_room, *field.shape[1:]), field.dtype)
                self._room[i][:first] = field[:first]
        for field, new in zip(self._room, rows, strict=True):
            field[first:end] = new
        self._n_filled, self._n_written = end, max(self._n_written, end)
        self._view = None

    def clear(self) -> None:
        """Free all places for new contact modes."""
        self._n_filled, self._view = 0, None

    @property
    def n_byte(self) -> int:
        """Allocated memory, bytes."""
        return sum(field[: self._n_written].nbytes for field in self._room)

    def view(self) -> Any:
        """The tables of all contact modes."""
        if self._view is None:
            self._view = self._kind(*(field[: self._n_filled] for field in self._room))
        return self._view
