"""Packed arrays: status and measures of all cases, chunk by chunk as zarr stores them.

To open and write forty small arrays through zarr took a quarter of the time of a short run.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.storage.disk import read_regular, remove, write_whole
from rubhpc.storage.journal import journals
from rubhpc.storage.layout import decode, encode, most_bytes, packed_chunk

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.schema import Variable
    from rubhpc.storage.manifest import Manifest


def write_packed(path: Path, manifest: Manifest, variable: Variable, values: NDArray[Any]) -> None:
    """Write a packed array of a store, (*grid, *extent); each of its files appears whole."""
    chunk = _chunk(manifest, variable)
    for file, window in _chunks(path, manifest, variable):
        part = values[window]
        beyond = [(0, c - n) for c, n in zip(chunk, part.shape, strict=True)]
        if any(after for _, after in beyond):
            part = np.pad(part, beyond, constant_values=variable.fill_value)
        write_whole(file, encode(part.astype(variable.dtype, copy=False)), is_synced=False)


def read_packed(path: Path, manifest: Manifest, variable: Variable) -> NDArray[Any] | None:
    """Read a packed array of a store; None where a chunk is missing or damaged."""
    chunk = _chunk(manifest, variable)
    values = np.empty((*manifest.shape, *manifest.extent(variable)), variable.dtype)
    for file, window in _chunks(path, manifest, variable):
        try:
            data = read_regular(file, most_bytes(variable.dtype, chunk))
        except OSError:
            return None
        part = decode(data, variable.dtype, chunk)
        if part is None:
            return None
        inside = values[window]
        inside[...] = part[tuple(slice(n) for n in inside.shape)]
    return values


def _chunk(manifest: Manifest, variable: Variable) -> tuple[int, ...]:
    return (*packed_chunk(manifest.shape), *(max(n, 1) for n in manifest.extent(variable)))


def _chunks(path: Path, manifest: Manifest, variable: Variable) -> Iterator[tuple[Path, tuple[slice, ...]]]:
    """The file of each chunk and its window of the array."""
    shape, chunk = (*manifest.shape, *manifest.extent(variable)), _chunk(manifest, variable)
    for place in np.ndindex(*(math.ceil(n / c) for n, c in zip(shape, chunk, strict=True))):
        window = tuple(slice(i * c, min((i + 1) * c, n)) for i, c, n in zip(place, chunk, shape, strict=True))
        yield path / variable.name / "c" / "/".join(map(str, place)), window


@dataclass(frozen=True)
class PackingNote:
    """Note of what the packed arrays hold: names and sizes of the journals when they were packed."""

    file: Path
    journal_directory: Path

    def read(self) -> bytes | None:
        """State of the journals when they were packed; None where that is unknown."""
        try:
            return read_regular(self.file)
        except OSError:
            return None

    def write(self, state: str) -> None:
        """Note that the arrays are packed."""
        write_whole(self.file, state.encode())

    def remove(self) -> None:
        """Have the next run pack again."""
        remove(self.file)

    def is_current(self) -> bool:
        """Whether nothing has been journalled since."""
        return self.read() == state_of_journals(self.journal_directory).encode()

    def is_garbled(self) -> bool:
        """Whether this is no earlier state of the journals: names and their sizes."""
        noted = self.read()
        if noted is None:
            return False
        sizes = {path.name: path.stat().st_size for path in journals(self.journal_directory)}
        try:
            return not all(0 <= size <= sizes[name] for name, size in json.loads(noted))
        except (ValueError, TypeError, KeyError, RecursionError):
            return True


def state_of_journals(directory: Path) -> str:
    """Names and sizes of all journals."""
    return json.dumps([[path.name, path.stat().st_size] for path in journals(directory)])
