"""The files of arrays for zarr: only regular ones of format 3, whose metadata and lengths are checked."""

from __future__ import annotations

import asyncio
import json
import math
import re
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from zarr.codecs import BloscCodec, ZstdCodec
from zarr.core.buffer import default_buffer_prototype
from zarr.core.codec_pipeline import BatchedCodecPipeline
from zarr.registry import register_pipeline
from zarr.storage import LocalStore

from rubhpc.errors import StoreError, printable

if TYPE_CHECKING:
    from collections.abc import Iterable

    from zarr.abc.store import ByteRequest
    from zarr.core.array_spec import ArraySpec
    from zarr.core.buffer import Buffer, BufferPrototype, NDBuffer

METADATA = "zarr.json"
_MOST_METADATA = 2**28  # bytes: a rig of matrices may take more than a hundred million
_MOST_ENTRIES = 2**22  # of lists and tables in them: each takes a hundred bytes when it is read
_TYPES = {"bool", *(f"{kind}{n}" for kind in ("int", "uint") for n in (8, 16, 32, 64))}
_TYPES |= {f"float{n}" for n in (16, 32, 64)}
_COMPRESSORS = "blosc", "zstd"
_MOST_CHUNKS, _MOST_OF_SHARD = 2**16, 2**20  # of an array: zarr has a task for each; and of a shard
_MOST_CHUNK = 2**31  # bytes, which blosc cannot pass
# A longer array of one dimension is a coordinate, which is read as a store is opened: it is all there, and
# blosc shrinks nothing to less than 1/255.
_LONG, _SHRUNK = 2**25, 255
_OVERHEAD = 64  # bytes of an encoded chunk beyond its values, and of its place in a shard, at most


def read_metadata(path: Path, root: Path) -> tuple[bytes, dict[str, int]]:
    """Content of a file of metadata, and the bytes that a chunk, or a shard, of its arrays takes at most.

    Parameters
    ----------
    path : Path
        The `zarr.json` of a group or an array, a regular file.
    root : Path
        The store; names of arrays are relative to it.

    Raises
    ------
    StoreError
        They are none of format 3, or of what no store of this program holds.
    OSError
        The file cannot be read.
    """
    with path.open("rb") as file:
        data = file.read(_MOST_METADATA + 1)
    try:
        if len(data) > _MOST_METADATA:
            raise ValueError("too long")
        if sum(map(data.count, (b",", b"[", b"{"))) > _MOST_ENTRIES:
            raise ValueError("too many entries")
        content = json.loads(data)
        name = "" if path.parent == root else path.parent.relative_to(root).as_posix()
        members = {name: content} | _members(content)
        if not all(member.isprintable() for member in members):
            raise ValueError("a name of control characters")
        most = {
            member: _checked(about, root / member)
            for member, about in members.items()
            if about["node_type"] != "group"
        }
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
        reason = printable(str(error))[:120]
        raise StoreError(f"{path}: is not the metadata of a store ({reason}); get the store anew") from None
    return data, most


def stated_size(compressor: str, data: bytes) -> int:
    """Bytes into which a chunk says that it decodes, without decoding it; -1 where it does not say."""
    if compressor == "blosc":
        return int.from_bytes(data[4:8], "little") if len(data) >= 16 else -1
    if len(data) < 6 or data[:4] != b"\x28\xb5\x2f\xfd":
        return -1
    flags = data[4]
    is_single, n_dictionary = bool(flags & 32), (0, 1, 2, 4)[flags & 3]
    n_size = (1 if is_single else 0, 2, 4, 8)[flags >> 6]
    start = 5 + (not is_single) + n_dictionary
    if len(data) < start + n_size:
        return -1
    stated = int.from_bytes(data[start : start + n_size], "little")
    return stated + 256 * (n_size == 2) if n_size else -1


def _members(content: dict[str, Any]) -> dict[str, Any]:
    """The metadata of all arrays and groups below, where a group contains them."""
    held = content.get("consolidated_metadata")
    members: dict[str, Any] = {} if held is None else held["metadata"]
    return members


def _checked(about: dict[str, Any], path: Path) -> int:
    """Bytes that a chunk of an array takes on the disk at most.

    Raises
    ------
    ValueError, TypeError, KeyError, AttributeError
        The array is none of a store; the text says what.
    """
    if about["zarr_format"] != 3 or about["node_type"] != "array":
        raise ValueError("not an array of format 3")
    if about["data_type"] not in _TYPES:
        raise ValueError(f"values of type {str(about['data_type'])[:40]}, which are no numbers")
    if about.get("storage_transformers") or about["chunk_key_encoding"]["name"] != "default":
        raise ValueError("files in another order than that of a store")
    if not all(isinstance(n, str) and n.isprintable() for n in about.get("dimension_names") or ()):
        raise ValueError("dimensions that are not named")
    if about["chunk_grid"]["name"] != "regular":
        raise ValueError("chunks of unequal size")
    size = np.dtype(about["data_type"]).itemsize
    shape, chunk = about["shape"], about["chunk_grid"]["configuration"]["chunk_shape"]
    n_inner = 1
    _check_lengths(shape, chunk)
    codecs = about["codecs"]
    if codecs[0]["name"] == "sharding_indexed":
        inside = codecs[0]["configuration"]
        _check_lengths(chunk, inside["chunk_shape"], _MOST_OF_SHARD)
        n_inner = math.prod(n // c for n, c in zip(chunk, inside["chunk_shape"], strict=True))
        _check_codecs(inside["index_codecs"], ())
        _check_codecs(inside["codecs"], ("blosc",))
        if len(codecs) > 1:
            raise ValueError("shards that are encoded")
    else:
        _check_codecs(codecs, _COMPRESSORS)
    n_byte = math.prod(shape) * size
    if len(shape) == 1 and n_byte > _LONG and n_byte > _SHRUNK * _stored(path):
        raise ValueError(f"{shape[0]} values, of which its files hold few")
    if n_byte and math.prod(chunk) * size // n_inner >= _MOST_CHUNK:
        raise ValueError("chunks that are too long")
    most: int = math.prod(chunk) * size + _OVERHEAD * (n_inner + 1)
    return most


def _check_lengths(shape: list[int], chunk: list[int], most: int = _MOST_CHUNKS) -> None:
    """Refuse lengths that are no numbers, that do not fit each other, or make too many chunks."""
    lengths = [*shape, *chunk]
    if not all(type(n) is int and 0 <= n < 2**63 for n in lengths) or 0 in chunk:
        raise ValueError("lengths that are no numbers")
    if math.prod(-(-n // c) for n, c in zip(shape, chunk, strict=True)) > most:
        raise ValueError("too many chunks")


def _check_codecs(codecs: list[dict[str, Any]], compressors: tuple[str, ...]) -> None:
    """Refuse any codecs but bytes, one of the compressors, and a checksum, in this order."""
    names = [codec["name"] for codec in codecs]
    compressed = names[1:2] if names[1:2] and names[1] in compressors else []
    if names not in ([["bytes", *compressed], ["bytes", *compressed, "crc32c"]]):
        raise ValueError(f"codecs {', '.join(map(str, names))[:60]}, which no store has")


def _stored(path: Path) -> int:
    """Bytes of the chunks of an array."""
    return sum(file.stat().st_size for file in (path / "c").rglob("*") if file.is_file())


_OLD = (".zarray", ".zattrs", ".zgroup", ".zmetadata")  # of format 2, which may name code to be run
_CHUNK = re.compile(r"(^|/)c([/.][\d/.]+)?$")  # the end of the key of a chunk, behind the name of its array


class CheckedPipeline(BatchedCodecPipeline):
    """Reads chunks as zarr does, and reports a damaged one as a StoreError."""

    async def read(self, batch_info: Iterable[Any], out: NDBuffer, drop_axes: tuple[int, ...] = ()) -> None:
        """Read and decode chunks into `out`.

        Raises
        ------
        StoreError
            A chunk is damaged.
        """
        batch = list(batch_info)
        try:
            await super().read(batch, out, drop_axes)
        except (ValueError, RuntimeError, TypeError, ArithmeticError) as error:  # of zarr and its codecs
            where = str(batch[0][0]).removeprefix("file://") if len(batch) == 1 else "a chunk"
            reason = " ".join(str(error).split())
            raise StoreError(f"{where}: is damaged ({reason}); rubhpc verify names its cases") from error

    async def decode_batch(
        self, chunk_bytes_and_specs: Iterable[tuple[Buffer | None, ArraySpec]]
    ) -> Iterable[NDBuffer | None]:
        """Decode chunks, none of which says that it decodes into more than it should.

        Raises
        ------
        ValueError
            One does.
        """
        batch = list(chunk_bytes_and_specs)
        compressors = [kind for kind in map(_compressor, self.bytes_bytes_codecs) if kind]
        for data, spec in batch if compressors else ():
            size = math.prod(spec.shape) * spec.dtype.to_native_dtype().itemsize
            if data is not None and stated_size(compressors[0], data[:32].to_bytes()) != size:
                raise ValueError("a chunk of another size")
        return await super().decode_batch(batch)


def _compressor(codec: object) -> str:
    return {BloscCodec: "blosc", ZstdCodec: "zstd"}.get(type(codec), "")


register_pipeline(CheckedPipeline)
CHECKED = {"codec_pipeline.path": f"{CheckedPipeline.__module__}.{CheckedPipeline.__qualname__}"}


class ArrayFiles(LocalStore):
    """A directory for zarr; a pipe in it is not waited for, and a device is not read.

    Metadata are checked (`rubhpc.input.array_files`), those of format 2 are not there, and no file is
    longer than a chunk of its array can be.
    """

    def __init__(self, root: Any, *, read_only: bool = True) -> None:
        super().__init__(Path(root), read_only=read_only)
        self._longest: dict[str, int] = {}  # bytes of a chunk, or a shard, of each array

    async def get(
        self,
        key: str,
        prototype: BufferPrototype | None = None,
        byte_range: ByteRequest | None = None,
    ) -> Buffer | None:
        """The content of a file, or a part of it; None where there is none.

        Raises
        ------
        StoreError
            It is no regular file, or has what no store has.
        """
        path = self.root / key
        if path.name in _OLD:
            return None
        try:
            found = path.stat()
            if path.name == METADATA and stat.S_ISREG(found.st_mode):
                data, longest = await asyncio.to_thread(read_metadata, path, self.root)
                self._longest |= longest
                return (prototype or default_buffer_prototype()).buffer.from_bytes(data)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise StoreError(f"{path}: cannot be read ({error.strerror}); see rubhpc verify") from error
        if not stat.S_ISREG(found.st_mode):
            raise StoreError(f"{path}: is not a regular file; rubhpc verify names what is damaged")
        if found.st_size > self._longest.get(_CHUNK.sub("", key), 0):
            raise StoreError(f"{path}: is longer than a chunk can be; rubhpc verify names its cases")
        return await super().get(key, prototype, byte_range)
