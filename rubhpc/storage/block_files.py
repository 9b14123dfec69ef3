"""Where the encoded chunks of a block are: each in a file of its own, or packed into shards.

A small store has one file for each block and array, a chunk of the zarr array. In a large one the arrays are
sharded: a file holds the chunks of many blocks, with an index at its end. Blocks are still written to files
of their own, in the private directory, so that a file has one writer; `pack` moves them into their shards.
A block's own file is newer than its chunk in the shard.
"""

from __future__ import annotations

import math
import os
import re
import struct
import uuid
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from google_crc32c import value as crc32c

from rubhpc.storage.disk import is_filled, open_regular, read_regular, remove
from rubhpc.storage.manifest import BLOCKS, PRIVATE

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.schema import Variable
    from rubhpc.storage.manifest import Manifest

    Place = tuple[int, ...]  # of a chunk or shard among all, along each axis of the study

ABSENT = 2**64 - 1  # offset and length of a chunk that a shard does not hold


class BlockFiles:
    """The files of the arrays that are stored block by block."""

    def __init__(self, path: Path, manifest: Manifest) -> None:
        self._path, self._manifest = path, manifest
        self._ratio = tuple(s // c for s, c in zip(manifest.shard, manifest.chunk, strict=False))
        self.n_inner = math.prod(self._ratio)  # chunks of a shard

    @property
    def is_sharded(self) -> bool:
        """Whether blocks are packed into shards."""
        return bool(self._ratio)

    @property
    def folder(self) -> Path:
        """Where the blocks lie that are to be packed."""
        return self._path / PRIVATE / BLOCKS

    def own_file(self, variable: Variable, place: Place) -> Path:
        """The file to which the chunk of an array is written."""
        if self.is_sharded:
            return self.folder / variable.name / ".".join(map(str, place))
        return self._path.joinpath(variable.name, "c", *map(str, (*place, *[0] * len(variable.dims))))

    def shard_file(self, variable: Variable, place: Place) -> Path:
        """The shard at a place among the shards."""
        return self._path / variable.name / ".".join(["c", *map(str, (*place, *[0] * len(variable.dims)))])

    def in_shard(self, place: Place) -> tuple[Place, int]:
        """Place of the shard that holds a chunk, and the chunk's position in it."""
        inner = [p % r for p, r in zip(place, self._ratio, strict=True)]
        shard = tuple(p // r for p, r in zip(place, self._ratio, strict=True))
        return shard, int(np.ravel_multi_index(inner, self._ratio))

    def chunk_at(self, shard: Place, position: int) -> Place:
        """Place of the chunk at a position in a shard."""
        inner = np.unravel_index(position, self._ratio)
        return tuple(s * r + int(i) for s, r, i in zip(shard, self._ratio, inner, strict=True))

    def size(self, variable: Variable, place: Place) -> int:
        """Bytes of an encoded chunk; 0 where it is absent or cannot be read."""
        own = self.own_file(variable, place)
        if is_filled(own):
            return own.stat().st_size
        if not self.is_sharded:
            return 0
        shard, position = self.in_shard(place)
        index = _index_of(self.shard_file(variable, shard), self.n_inner)
        return 0 if index is None or index[position, 0] == ABSENT else int(index[position, 1])

    def read(self, variable: Variable, place: Place, most: int) -> bytes | None:
        """An encoded chunk of at most `most` bytes; None where it is absent or cannot be read."""
        own = self.own_file(variable, place)
        if not self.is_sharded or is_filled(own):
            try:
                return read_regular(own, most)
            except FileNotFoundError:  # it has just been packed
                pass
            except OSError:
                return None
        if not self.is_sharded:
            return None
        shard, position = self.in_shard(place)
        return _read_chunk(self.shard_file(variable, shard), self.n_inner, position, most)

    def pack(
        self, part: int = 0, n_part: int = 1, *, least: int = 1, is_over: Callable[[], object] = lambda: False
    ) -> None:
        """Move blocks into their shards, one part of `n_part` that share the shards; needs the store's lock.

        Nothing is lost by a kill at any time: a shard is replaced as a whole, and shards are synced to the
        disk before the blocks' own files are removed.

        Parameters
        ----------
        least : int
            Leave shards alone for which fewer blocks are waiting.
        is_over : callable
            Asked before every shard whether to stop.

        Raises
        ------
        OSError
            The disk is full, or cannot be written; no block is lost.
        """
        n_shard = [-(-n // s) for n, s in zip(self._manifest.shape, self._manifest.shard, strict=False)]
        for variable in self._manifest.variables if self.is_sharded else ():
            packed: list[Path] = []
            for shard, waiting in self._waiting(variable).items():
                if np.ravel_multi_index(shard, n_shard) % n_part != part or len(waiting) < least:
                    continue
                if is_over():
                    break
                self._pack(self.shard_file(variable, shard), waiting)
                packed += waiting.values()
            if packed:
                os.sync()  # one for all shards: each by itself takes as long
            for own in packed:
                remove(own)
            with suppress(OSError):  # where some are left, or another process is quicker
                (self.folder / variable.name).rmdir()
        with suppress(OSError):
            self.folder.rmdir()

    def oversized(self) -> list[Path]:
        """Shards with bytes of no chunk, as of one that was written twice: readers find all cases in them."""
        found = []
        for variable in self._manifest.variables if self.is_sharded else ():
            for file in sorted((self._path / variable.name).glob("c.*[0-9]")):
                index = _index_of(file, self.n_inner)
                if index is not None:
                    used = index[index[:, 0] != ABSENT, 1].sum() + 16 * self.n_inner + 4
                    found += [file] if file.stat().st_size > used else []
        return found

    def compact(self) -> None:
        """Write such shards again; needs the store's lock."""
        for file in self.oversized():
            self._pack(file, {})

    def compose(self, variable: Variable, shard: Place, most: int) -> bytes:
        """The shard as it would be packed now; b"" where it has no chunk."""
        chunks = (self.read(variable, self.chunk_at(shard, i), most) for i in range(self.n_inner))
        index = np.full((self.n_inner, 2), ABSENT, "<u8")
        data = bytearray()
        for i, chunk in enumerate(chunks):
            if chunk:
                index[i] = len(data), len(chunk)
                data += chunk
        return bytes(data) + encode_index(index) if data else b""

    def _waiting(self, variable: Variable) -> dict[Place, dict[int, Path]]:
        """Shard -> position in it -> the block's own file."""
        folder = self.folder / variable.name
        pattern = re.compile(r"\d+" + r"\.\d+" * (len(self._ratio) - 1))
        found: dict[Place, dict[int, Path]] = {}
        for name in sorted(os.listdir(folder)) if folder.is_dir() else ():
            if pattern.fullmatch(name):
                place = tuple(map(int, name.split(".")))
                if all(
                    p * c < n
                    for p, c, n in zip(place, self._manifest.chunk, self._manifest.shape, strict=True)
                ):
                    shard, position = self.in_shard(place)
                    found.setdefault(shard, {})[position] = folder / name
        return found

    def _pack(self, file: Path, waiting: dict[int, Path]) -> None:
        """Replace a shard by one that holds the waiting blocks too."""
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_name(f"{file.name}.{uuid.uuid4().hex}.partial")
        index, end = np.full((self.n_inner, 2), ABSENT, "<u8"), 0
        try:
            with partial.open("wb") as out:
                for position in range(self.n_inner):
                    own = waiting.get(position)
                    data = read_regular(own) if own is not None and is_filled(own) else None
                    data = data or _read_chunk(file, self.n_inner, position)
                    if data:
                        index[position] = end, len(data)
                        end += out.write(data)
                out.write(encode_index(index))
                out.flush()
                if file.exists():  # it would be lost in a power cut
                    os.fsync(out.fileno())
            partial.replace(file)
        except OSError:
            partial.unlink(missing_ok=True)
            raise


def encode_index(index: NDArray[np.uint64]) -> bytes:
    """The index of a shard as the end of its file."""
    data = index.astype("<u8").tobytes()
    return data + struct.pack("<I", crc32c(data))


def _index_of(file: Path, n: int) -> NDArray[np.uint64] | None:
    """Offset and length of the chunks of a shard, (n, 2); None where it is absent or damaged."""
    try:
        found = file.stat()
        return _read_index(file, found.st_mtime_ns, found.st_ino, n)
    except OSError:
        return None


@lru_cache(maxsize=64)
def _read_index(file: Path, mtime: int, inode: int, n: int) -> NDArray[np.uint64] | None:  # all are the key
    with open_regular(file) as opened:
        return _index_in(opened.fileno(), n)


def _index_in(handle: int, n: int) -> NDArray[np.uint64] | None:
    n_byte = 16 * n + 4
    size = os.fstat(handle).st_size - n_byte
    data = os.pread(handle, n_byte, max(size, 0))
    if size < 0 or data[-4:] != struct.pack("<I", crc32c(data[:-4])):
        return None
    index = np.frombuffer(data[:-4], "<u8").reshape(n, 2).copy()
    end = np.uint64(size)
    index[(index[:, 0] > end) | (index[:, 1] > end - np.minimum(index[:, 0], end))] = ABSENT
    return index


def _read_chunk(file: Path, n: int, position: int, most: int = 2**31) -> bytes | None:
    """An encoded chunk of a shard; the shard may be replaced meanwhile."""
    try:
        with open_regular(file) as opened:
            index = _index_in(opened.fileno(), n)
            if index is None or index[position, 0] == ABSENT or int(index[position, 1]) > most:
                return None
            return os.pread(opened.fileno(), int(index[position, 1]), int(index[position, 0]))
    except OSError:
        return None
