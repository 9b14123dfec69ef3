"""Checks of the metadata of a group or an array before zarr acts on them: a store may come from anybody.

zarr imports whatever codec the metadata name, some of which run what they read, and makes room for whatever
length they state. A store of this program needs few codecs, holds numbers alone, and is in format 3.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import StoreError, printable

if TYPE_CHECKING:
    from pathlib import Path

METADATA = "zarr.json"
_MOST_METADATA = 2**28  # bytes: a rig of matrices may take more than a hundred million
_MOST_ENTRIES = 2**22  # of lists and tables in them: each takes a hundred bytes when it is read
_TYPES = {"bool", *(f"{kind}{n}" for kind in ("int", "uint") for n in (8, 16, 32, 64))}
_TYPES |= {f"float{n}" for n in (16, 32, 64)}
_COMPRESSORS = "blosc", "zstd"
_MOST_CHUNKS = 2**20  # of an array, or of a shard: zarr lists them all
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
    if len(data) < 14 or data[:4] != b"\x28\xb5\x2f\xfd":
        return -1
    flags = data[4]
    is_single, n_dictionary = bool(flags & 32), (0, 1, 2, 4)[flags & 3]
    n_size = (1 if is_single else 0, 2, 4, 8)[flags >> 6]
    start = 5 + (not is_single) + n_dictionary
    stated = int.from_bytes(data[start : start + n_size], "little")
    return stated + 256 * (n_size == 2) if n_size else -1


def _members(content: dict[str, Any]) -> dict[str, Any]:
    """The metadata of all arrays and groups below, where a group contains them."""
    held = content.get("consolidated_metadata")
    members: dict[str, Any] = {} if held is None else held["metadata"]
    if not all(name.isprintable() for name in members):
        raise ValueError("a name of control characters")
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
        _check_lengths(chunk, inside["chunk_shape"])
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


def _check_lengths(shape: list[int], chunk: list[int]) -> None:
    """Refuse lengths that are no numbers, that do not fit each other, or make too many chunks."""
    lengths = [*shape, *chunk]
    if not all(type(n) is int and 0 <= n < 2**63 for n in lengths) or 0 in chunk:
        raise ValueError("lengths that are no numbers")
    if math.prod(-(-n // c) for n, c in zip(shape, chunk, strict=True)) > _MOST_CHUNKS:
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
