"""Checks that what a manifest says can be used: of the right types, and of sizes that fit each other.

Its checksum shows what a disk has changed in it, not what another program has written.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

from rubhpc.schema import VARIABLES, Variable
from rubhpc.study.axes import DIRECTION, FROM_REST, SWEEPS, meanings_of
from rubhpc.study.points import MOST_CASES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

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
