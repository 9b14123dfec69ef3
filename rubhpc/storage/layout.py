"""The arrays of a store on the disk: names, shapes, chunks, attributes and what never changes in them."""

from __future__ import annotations

import json
import math
import platform
import struct
import warnings
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
import zarr
from google_crc32c import value as crc32c
from numcodecs.blosc import Blosc
from zarr.codecs import BloscCodec, Crc32cCodec
from zarr.core.buffer import default_buffer_prototype
from zarr.storage import MemoryStore

from rubhpc.schema import ORDERS, TURNED, VARIABLES
from rubhpc.storage.disk import write_whole
from rubhpc.storage.manifest import PRIVATE, Manifest
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.study.axes import meanings_of
from rubhpc.version import __version__

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from zarr.core.buffer import Buffer

    from rubhpc.schema import Variable
    from rubhpc.study.cases import CaseGrid
    from rubhpc.study.study import Study

_PACKED_CHUNK = 2**20  # values in a chunk of a packed array, at most
# Where the stators stand: coordinate, key of the stator, unit, long name.
_PLACES = (
    ("stator_angle", "angle", "rad", "angle of the stator, from straight up in the sense of positive spin"),
    ("stator_node", "node", "1", "node of the rotor at which the stator stands"),
)
_PACKAGES = ("numpy", "numba", "scipy", "zarr")
# Periodic waveforms shrink to 2 %, those of a chaotic rub to 80 %, at 3 GB/s and more; zstd gains nothing on
# either that would be worth a third of the speed.
# The checksum has every reader notice a damaged byte, whatever it reads with.
_CODECS = (BloscCodec(cname="lz4", clevel=5, shuffle="shuffle"), Crc32cCodec())
_BLOSC = Blosc(cname="lz4", clevel=5, shuffle=Blosc.SHUFFLE)
_LEAST, _AT_SIZE = 20, 4  # bytes of blosc's header and the checksum; where the header has the decoded size

# For arrays being opened or made: a chunk of nothing but the fill value is written all the same, so that a
# file that is absent has been lost.
_WRITE_ALL = {"array.write_empty_chunks": True}


def skeleton(grid: CaseGrid, manifest: Manifest) -> dict[str, bytes]:
    """Metadata, coordinates and settings of a store: path in it -> content."""
    files: dict[str, Buffer] = {}
    group = zarr.create_group(
        MemoryStore(files), zarr_format=3, attributes=_attributes(grid, accepted=manifest.accepted)
    )
    made: dict[tuple[Any, ...], dict[str, Any]] = {}
    for variable in (*manifest.variables, *manifest.packed):
        # Most measures differ in name and attributes alone; zarr takes 2 ms an array and makes one of a kind.
        kind = (variable in manifest.packed, variable.dims, variable.dtype, repr(variable.fill_value))
        if kind in made:
            metadata = made[kind] | {"attributes": _attributes_of(variable, manifest)}
            files[f"{variable.name}/zarr.json"] = _as_json(metadata)
            continue
        if variable in manifest.packed:
            _create(group, variable, manifest, chunk=packed_chunk(manifest.shape))
        else:
            _create(group, variable, manifest, chunk=manifest.chunk, shard=manifest.shard)
        made[kind] = json.loads(files[f"{variable.name}/zarr.json"].to_bytes())
    with zarr.config.set(_WRITE_ALL):
        for name, (dims, values, attributes) in _static(grid).items():
            group.create_array(
                name, data=values, dimension_names=dims, attributes=attributes, compressors=_CODECS
            )
    with warnings.catch_warnings():
        # The format's specification is behind its implementations here.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(group.store)  # a reader opens one file instead of fifty
    return {name: held.to_bytes() for name, held in files.items()}


def build(path: Path, grid: CaseGrid) -> None:
    """Make all of a store in the empty directory `path`."""
    manifest = manifest_of(grid)
    files = skeleton(grid, manifest)
    for name, data in files.items():
        write_whole(path / name, data, is_synced=False)
    (path / PRIVATE / "journal").mkdir(parents=True)
    (path / PRIVATE / "logs").mkdir()
    replace(manifest, files={name: crc32(data) for name, data in files.items()}).write(path)


def encode(chunk: NDArray[Any]) -> bytes:
    """A whole chunk as zarr would write it, in a third of the time: 17 of them were 7 % of a run."""
    stored = np.ascontiguousarray(chunk, chunk.dtype.newbyteorder("<"))
    encoded: bytes = _BLOSC.encode(stored)
    return encoded + struct.pack("<I", crc32c(encoded))


def decode(data: bytes, dtype: str, shape: tuple[int, ...]) -> NDArray[Any] | None:
    """A chunk from its bytes; None where these are damaged."""
    kind = np.dtype(dtype).newbyteorder("<")
    n_byte = math.prod(shape) * kind.itemsize
    if len(data) < _LEAST or data[-4:] != struct.pack("<I", crc32c(data[:-4])):
        return None
    if struct.unpack_from("<I", data, _AT_SIZE)[0] != n_byte:  # of another shape
        return None
    try:
        return np.frombuffer(_BLOSC.decode(data[:-4]), kind).reshape(shape)
    except (RuntimeError, ValueError):  # not what blosc has written, though its checksum is right
        return None


def most_bytes(dtype: str, shape: tuple[int, ...]) -> int:
    """Size of an encoded chunk at most, bytes: what cannot be compressed is copied."""
    return math.prod(shape) * np.dtype(dtype).itemsize + _LEAST


def packed_chunk(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Cases of a chunk of a packed array along each dimension of the grid."""
    chunk = list(shape)
    while math.prod(chunk) > _PACKED_CHUNK:
        longest = chunk.index(max(chunk))
        chunk[longest] = -(-chunk[longest] // 2)
    return tuple(chunk)


def checksum(values: NDArray[Any], start: int = 0) -> int:
    """CRC-32 of the bytes of an array, carried on from `start`."""
    return crc32(np.ascontiguousarray(values).data, start)


def _create(
    group: zarr.Group,
    variable: Variable,
    manifest: Manifest,
    *,
    chunk: tuple[int, ...],
    shard: tuple[int, ...] = (),
) -> None:
    extent = manifest.extent(variable)
    group.create_array(
        variable.name,
        shape=(*manifest.shape, *extent),
        chunks=(*chunk, *(max(n, 1) for n in extent)),
        chunk_key_encoding={"name": "default", "separator": "." if shard else "/"},
        shards=(*shard, *(max(n, 1) for n in extent)) if shard else None,
        dtype=variable.dtype,
        fill_value=variable.fill_value,
        compressors=_CODECS,
        dimension_names=(*manifest.dims, *variable.dims),
        attributes=_attributes_of(variable, manifest),
    )


def _attributes_of(variable: Variable, manifest: Manifest) -> dict[str, Any]:
    attributes: dict[str, Any] = {"units": variable.unit, "long_name": variable.long_name}
    if "sample" in variable.dims:
        # CF: a coordinate that is no dimension
        attributes["coordinates"] = TURNED if manifest.has_revolutions else "revolution"
    if variable.flags:
        attributes |= _flags(variable.flags)
    return attributes


def _as_json(metadata: dict[str, Any]) -> Buffer:
    """Metadata as zarr writes them."""
    text = json.dumps(metadata, indent=zarr.config.get("json_indent"))
    return default_buffer_prototype().buffer.from_bytes(text.encode())


def _flags(meanings: tuple[str, ...]) -> dict[str, Any]:
    """CF attributes that name the values 0, 1, ..."""
    return {"flag_values": list(range(len(meanings))), "flag_meanings": " ".join(meanings)}


def _static(grid: CaseGrid) -> dict[str, tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]]:
    """Coordinates and settings: name -> (dimensions, values, attributes)."""
    sizes = manifest_of(grid).sizes
    recording = grid.study.recording
    own: dict[str, tuple[NDArray[Any], str]] = {
        "stator": (np.arange(1, sizes["stator"] + 1), "number of the stator, as in the rig"),
        "revolution": (
            np.arange(sizes["sample"]) / recording.samples_per_revolution,
            "revolutions since the recording began",
        ),
        "order": (np.arange(sizes["order"]) / recording.revolutions, "multiple of the spin speed"),
        "section": (np.arange(sizes["section"]), "revolution of the section"),
    }
    if "revolution" in sizes:  # of a run-up, a dimension of its own
        own[TURNED] = own["revolution"]
        own["revolution"] = np.arange(sizes["revolution"]), "number of the revolution, from 0"
        own["order"] = np.array(ORDERS), "multiple of the spin speed"
        del own["section"]
    static: dict[str, tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]] = {
        axis.coordinate: (
            (axis.dimension,),
            np.array(axis.values, dtype=np.float64),
            {"units": axis.unit or "1", "long_name": axis.long_name}
            | (_flags(meanings) if (meanings := meanings_of(axis.name)) else {}),
        )
        for axis in grid.study.axes
    }
    for dim, n_case in zip(grid.dims, grid.shape, strict=True):
        if dim not in static:
            own[dim] = (np.arange(n_case), "number of the case in its sample")
    for name, (values, text) in own.items():
        is_of_samples = name == TURNED or (name == "revolution" and "revolution" not in sizes)
        dim = "sample" if is_of_samples else name
        static[name] = ((dim,), values, {"units": "1", "long_name": text})
    for name, attribute, unit, text in _PLACES:
        if not any(axis.name.endswith(f".{attribute}") for axis in grid.study.axes):  # or it is many places
            at = np.array([getattr(stator, attribute) for stator in grid.study.rig.stator])
            static[name] = (("stator",), at, {"units": unit, "long_name": text})
    for name, (dims, values) in grid.operating_points().items():
        if name not in static:  # a clearance axis is its own setting
            variable = VARIABLES[name]
            static[name] = (
                tuple(dims),
                np.asarray(values, dtype=np.float64),
                {"units": variable.unit, "long_name": variable.long_name},
            )
    return static


def _attributes(grid: CaseGrid, *, accepted: tuple[int, ...]) -> dict[str, Any]:
    study = grid.study
    return {
        "title": study.title,
        "conventions": "CF-1.11, SI units; a missing value is NaN, or -1 in integers; status tells why",
        "identity": grid.identity,
        "study": study.as_dict(),
        "rig": study.rig.as_dict(),
        "versions": {
            "rubhpc": __version__,
            "python": platform.python_version(),
            **{name: _version(name) for name in _PACKAGES},
        },
        # also where no array over the samples is kept
        "coordinates": " ".join(
            (TURNED if study.changes_speed else "revolution", *(name for name, *_ in _PLACES), *_drawn(study))
        ),
        **({"accepted_physics": list(accepted)} if accepted else {}),
    }


def _drawn(study: Study) -> list[str]:
    """Coordinates that share a dimension."""
    return [axis.coordinate for axis in study.axes if axis.coordinate != axis.dimension]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:  # run from a source tree
        return "unknown"
