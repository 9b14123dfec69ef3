"""What a store was made for: the study's identity, axes and chunks."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self
from zlib import crc32

from rubhpc.errors import StoreError
from rubhpc.schema import (
    VARIABLES,
    Variable,
    bore_variables,
    branch_variables,
    drive_variables,
    probe_variables,
    run_up_variables,
)
from rubhpc.storage.disk import read_regular, write_whole
from rubhpc.storage.journal import Header
from rubhpc.storage.measures import from_json, to_json, unlisted_measures
from rubhpc.study.axes import DIRECTION, FROM_REST, SWEEPS, coordinate_of, meanings_of, written
from rubhpc.study.continuation import CaseIds, continuation_of
from rubhpc.study.points import MOST_CASES, Points

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from rubhpc.study.continuation import Continuation

_FORMAT, _SHARDED = 4, 5  # a store without shards can be read by versions that know none
_READABLE = (3, _FORMAT, _SHARDED)  # format 3 does not list its measures
PRIVATE = ".rubhpc"  # the directory of a store that zarr does not look into
BLOCKS = "blocks"  # in it: blocks that have not been packed into shards yet
PARTS = "parts"  # in it: locks and shares of parts that are computed apart
GROWTH = "growth"  # in it: what a growth that was decided on has yet to move to its place
_NAMES = ("manifest.json", "manifest.copy.json")  # one damaged byte must not cost a study


@dataclass(frozen=True, kw_only=True)
class AxisRecord:
    """An axis of the grid as the manifest keeps it."""

    name: str
    dimension: str
    unit: str
    long_name: str
    values: tuple[float, ...]
    sweep: str = FROM_REST

    @property
    def coordinate(self) -> str:
        """Name of its values in the store."""
        return coordinate_of(self.name)


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """What a store was made for.

    Attributes
    ----------
    identity, parts
        Hash of what changes results, and what went into it.
    axes : tuple of AxisRecord
        The grid; the only part that may grow.
    chunk : tuple of int
        Cases of one block along each dimension, fixed for the life of the store.
    shard : tuple of int
        Cases of one shard along each dimension, fixed likewise; () where every block has its own files.
    sizes : dict
        Lengths of the dimensions after the axes: stator, sample, order, section.
    keep : tuple of str
        Roles of the arrays stored for every case.
    files : dict
        Path of each file that is of no case (metadata, coordinates, settings) -> CRC-32 of its bytes.
    measures : tuple of Variable
        Measures of a case, in the order of their packed record.
    added : tuple of str
        Measures that the store was made without, so that its older cases lack them.
    accepted : tuple of int
        Earlier versions of the physics whose cases were kept.
    refine : dict or None
        Of a map of which not all cases are computed: criteria, step of the first level, refined dimensions.
    """

    title: str
    identity: str
    parts: dict[str, Any]
    axes: tuple[AxisRecord, ...]
    chunk: tuple[int, ...]
    sizes: dict[str, int]
    keep: tuple[str, ...]
    files: dict[str, int]
    measures: tuple[Variable, ...]
    added: tuple[str, ...] = ()
    accepted: tuple[int, ...] = ()
    shard: tuple[int, ...] = ()
    refine: dict[str, Any] | None = None

    @property
    def has_revolutions(self) -> bool:
        """Whether its cases run up, revolution by revolution."""
        return "revolution" in self.sizes

    @cached_property
    def points(self) -> Points:
        """Where the cases lie."""
        return Points(self.axes)

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of the grid."""
        return self.points.dims

    @property
    def shape(self) -> tuple[int, ...]:
        """Cases along each dimension."""
        return self.points.shape

    @property
    def n_case(self) -> int:
        """Cases of the grid."""
        return self.points.n_case

    @property
    def header(self) -> Header:
        """Header of the journals of this store."""
        return Header(
            identity=self.identity,
            points=self.points,
            n_stator=self.sizes["stator"],
            measures=self.measures,
            n_added=len(self.added),
            continuation=self.continuation,
        )

    @cached_property
    def continuation(self) -> Continuation | None:
        """From which case each one starts; None where all start at rest."""
        return continuation_of(self.axes)

    @cached_property
    def _ids(self) -> CaseIds:
        return CaseIds(self.identity, self.points.values, self.continuation)

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """The arrays stored for every case and written block by block, in the order of their checksum."""
        probed = _probed(self.parts)
        known = VARIABLES | probe_variables(probed) | branch_variables() | run_up_variables(probed)
        if any(stator.get("kind") == "bore" for stator in self.parts["rig"].get("stator", [])):
            known |= bore_variables()
        if "drive" in self.parts:
            known |= drive_variables()
        return tuple(v for v in known.values() if v.role in self.keep)

    @property
    def packed(self) -> tuple[Variable, ...]:
        """The arrays that are packed from the journals: status and measures."""
        return (VARIABLES["status"], *self.measures)

    def extent(self, variable: Variable) -> tuple[int, ...]:
        """Shape of a variable after the axes."""
        return tuple(self.sizes[dim] for dim in variable.dims)

    def case_id(self, flat: int) -> str:
        """Id of a case."""
        return self._ids(self.points.at_flat(flat))

    def name_case(self, flat: int) -> str:
        """Coordinates of a case, as in `friction=0.3, clearance_ratio=0.7`; in a sample its number first."""
        own = {axis.coordinate for axis in self.axes}
        index = zip(self.dims, self.points.index(flat), strict=True)
        numbers = [f"{dim}={i}" for dim, i in index if dim not in own]
        values = (
            written(axis.name, value, axis.unit)
            for axis, value in zip(self.axes, self.points.at_flat(flat), strict=True)
        )
        return ", ".join([*numbers, *values])

    def write(self, store: Path) -> None:
        """Put the manifest into a store, twice."""
        content = {f.name: getattr(self, f.name) for f in fields(self)}
        axes = [{f.name: getattr(axis, f.name) for f in fields(axis)} for axis in self.axes]
        content |= {"axes": axes, "measures": to_json(self.measures)}
        if not self.shard:
            del content["shard"]
        if self.refine is None:
            del content["refine"]
        text = json.dumps(content).encode()
        number = _SHARDED if self.shard else _FORMAT
        for name in _NAMES:
            write_whole(store / PRIVATE / name, b"rubhpc %d %08x\n%s" % (number, crc32(text), text))

    @classmethod
    def read(cls, store: Path) -> Self:
        """The manifest of a store, with a committed growth applied.

        Raises
        ------
        StoreError
            There is no store, it is not one of this program, or its manifest is damaged.
        """
        damaged, is_other = None, False
        for place in manifests(store):
            try:
                return cls._of_json(json.loads(_vouched(place)))
            except (FileNotFoundError, NotADirectoryError):
                continue
            except _OtherFormat:
                is_other = True
                continue
            except (ValueError, OSError) as error:
                damaged = error
            except (TypeError, KeyError, AttributeError):  # its checksum is right, its content is not
                damaged = ValueError("unknown content")
        if is_other:
            raise StoreError(f"{store}: made by another version of rubhpc; use that one or another --output")
        if damaged is not None:
            raise StoreError(
                f"{store}: both copies of its manifest are damaged ({damaged}); "
                "put one back from a backup or run into another --output"
            )
        if store.is_file():
            raise StoreError(f"{store}: is not a rubhpc store but a file")
        if not store.exists():
            raise StoreError(f"{store}: no such store; give the directory that a study was run into")
        raise StoreError(no_store(store, "give the directory that a study was run into"))

    @classmethod
    def _of_json(cls, content: dict[str, Any]) -> Self:
        check_content(content)
        axes = (AxisRecord(**{**axis, "values": tuple(axis["values"])}) for axis in content["axes"])
        tuples = {
            name: tuple(content.get(name, ())) for name in ("chunk", "shard", "keep", "added", "accepted")
        }
        measures = from_json(content["measures"]) if "measures" in content else unlisted_measures()
        manifest = cls(**{**content, **tuples, "axes": tuple(axes), "measures": measures})
        check_fit(manifest)
        return manifest

    def damaged_copies(self, store: Path) -> list[str]:
        """Names of the files of this manifest that are missing or damaged."""
        names = []
        for name in _NAMES:
            try:
                _vouched(store / PRIVATE / name)
            except (ValueError, OSError, _OtherFormat):
                names.append(name)
        return names


def _probed(parts: dict[str, Any]) -> list[tuple[str, str]]:
    """Name and quantity of the probes of a study, from the parts of its identity."""
    return [(probe["name"], probe["quantity"]) for probe in parts["record"].get("probe", [])]


class _OtherFormat(Exception):  # noqa: N818 - becomes the text of a StoreError
    """A manifest that another version wrote."""


def no_store(path: Path, advice: str) -> str:
    """Return why there is no manifest at a path that exists: what it lacks, or is not, and what to do.

    What a store without its private directory holds can be read, and no run overwrites it.
    """
    if (path / "zarr.json").is_file() and not (path / PRIVATE).is_dir():
        return (
            f"{path}: its directory {PRIVATE} is missing, which holds the journals and all checksums; "
            "copy it too (cp -r STORE, not STORE/*), or move this store away and run the study again"
        )
    if (path / PRIVATE / "journal").is_dir():
        return f"{path}: both copies of its manifest are missing; put one back from a backup, or {advice}"
    return f"{path}: is not a rubhpc store; {advice}"


def manifests(store: Path) -> list[Path]:
    """Where the manifest of a store may be, the one that counts first."""
    growth = store / PRIVATE / GROWTH / PRIVATE
    return [folder / name for folder in (growth, store / PRIVATE) for name in _NAMES]


def _vouched(path: Path) -> bytes:
    """The text of a manifest, if its checksum is right."""
    head, _, text = read_regular(path).partition(b"\n")
    if found := re.fullmatch(rb"rubhpc (\d+) ([0-9a-f]{8})", head):
        if int(found[1]) not in _READABLE:
            raise _OtherFormat
        if int(found[2], 16) == crc32(text):
            return text
    elif head.startswith(b"{"):  # of version 1, which kept no checksum
        raise _OtherFormat
    raise ValueError("checksum")


_TYPES = ("float32", "float64", "int8", "int16", "int32", "int64")  # of arrays
_MOST = 2**31  # cases, samples or other places along a dimension
_MOST_STATORS = 2**16


def check_content(content: dict[str, Any]) -> None:
    """Check the types of what was read from the JSON of a manifest.

    Raises
    ------
    ValueError, KeyError, TypeError
        Something is lacking, or of another type.
    """
    of_text, of_counts = _each(_is_text), _each(_is_count)
    _require(_is_text(content["title"]), _is_text(content["identity"]), isinstance(content["parts"], dict))
    _require(*(of_counts(content.get(name, [])) for name in ("chunk", "shard", "accepted")))
    _require(of_text(content["keep"]), of_text(content.get("added", [])))
    _require(*(_is_text(axis[name]) for axis in content["axes"] for name in ("name", "dimension", "unit")))
    for axis in content["axes"]:
        _require(_each(_is_number)(axis["values"]), axis["values"] != [], _is_text(axis["long_name"]))
    for sizes, most in ((content["sizes"], _MOST), (content["files"], 2**32)):
        _require(isinstance(sizes, dict), all(_is_count(n) and n < most for n in sizes.values()))
    texts = [field.name for field in fields(Variable) if field.type == "str"]
    for measure in content.get("measures", []):
        _require(*(_is_text(measure[name]) for name in texts if name in measure))
        _require(of_text(measure["dims"]), of_text(measure["flags"]))
    _require(_is_count(content["parts"]["physics"]), isinstance(content["parts"]["record"], dict))
    refine = content.get("refine")
    if refine is not None:
        _require(of_text(refine["dimensions"]), _is_count(refine["coarse"]))
        _require(isinstance(refine["by"], list), all(isinstance(by, list) for by in refine["by"]))
        _require(*(len(by) == 2 and _is_text(by[0]) and _is_number(by[1]) for by in refine["by"]))


def check_fit(manifest: Any) -> None:
    """Check that the parts of a manifest, of the right types each, fit each other.

    Parameters
    ----------
    manifest : Manifest
        As `rubhpc.storage.manifest` has read it.

    Raises
    ------
    ValueError, KeyError, TypeError
        They do not.
    """
    dims, shape, chunk, sizes = manifest.dims, manifest.shape, manifest.chunk, manifest.sizes
    measures = [variable.name for variable in manifest.measures]
    lengths = dict(zip(dims, shape, strict=True))
    _require(0 < manifest.n_case <= MOST_CASES, sizes["stator"] < _MOST_STATORS)
    _require(set(manifest.added) <= set(measures))
    _require(len(chunk) == len(dims), all(0 < n < _MOST for n in chunk), len(set(measures)) == len(measures))
    _require(manifest.shard == () or len(manifest.shard) == len(dims))
    _require(*(s > 0 and s % n == 0 for s, n in zip(manifest.shard, chunk, strict=False)))
    for axis in manifest.axes:
        meanings = meanings_of(axis.name)
        _require(len(axis.values) == lengths[axis.dimension], axis.sweep in SWEEPS)
        _require(not meanings or all(0 <= value < len(meanings) for value in axis.values))
    swept = [axis.sweep for axis in manifest.axes if axis.sweep != FROM_REST]
    names = [axis.name for axis in manifest.axes]
    _require(len(set(names)) == len(names), len(swept) < 2, (DIRECTION in names) == (swept == ["both"]))
    for variable in manifest.measures:
        _require(
            variable.name != "" and "/" not in variable.name,
            variable.dtype in _TYPES,
            variable.dims in ((), ("stator",)),
        )
        _require(variable.dims == VARIABLES.get(variable.name, variable).dims)
    for variable in manifest.variables:
        manifest.extent(variable)
    if manifest.refine is not None:
        coarse = manifest.refine["coarse"]
        _require(
            set(manifest.refine["dimensions"]) <= set(dims), 0 < coarse < _MOST, not coarse & (coarse - 1)
        )
        _require({name for name, _ in manifest.refine["by"]} <= set(measures))


def _require(*held: bool) -> None:
    if not all(held):
        raise ValueError("unknown content")


def _is_text(value: object) -> bool:
    return isinstance(value, str) and value.isprintable()


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _each(is_fit: Callable[[object], bool]) -> Callable[[Iterable[object]], bool]:
    """Whether something is a list of such values."""
    return lambda values: isinstance(values, list) and all(map(is_fit, values))
