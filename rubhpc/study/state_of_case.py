"""Reads where one case of a store has ended, from the store's arrays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError, StoreError
from rubhpc.fem.assemble import assemble
from rubhpc.input.messages import brief
from rubhpc.input.quantity import parse_quantity
from rubhpc.rig.reading import rig_from_dict, with_keys
from rubhpc.schema import DONE, FINAL_STATE, STATUS
from rubhpc.study.axes import axis_table, coordinate_of, place_of, study_unit
from rubhpc.study.stored_state import StoredState

if TYPE_CHECKING:
    from collections.abc import Sequence

    import zarr
    from numpy.typing import NDArray

    from rubhpc.study.initial import Initial

    Selection = Sequence[tuple[str, str | float]]

_MOST_WRITTEN = 6  # values of an axis in a message


def with_state(initial: Initial) -> Initial:
    """Return a start from a case of a store with the state that it names, read unless it has been."""
    if initial.state is not None:
        return initial
    return replace(initial, state=read_state(initial.from_, initial.select))


def read_state(path: str, select: Selection) -> StoredState:
    """Return where one case of a store has ended.

    Parameters
    ----------
    path : str
        A store whose study keeps final states.
    select : sequence of (axis, value)
        Numbers in SI units or text, as of `--select`; axes of one value need none.
    """
    where = f"[initial] from: {path}"
    if not Path(path).exists():
        problem = f'{brief(path)} is not available; choose one of "rest", "contact_free"'
        raise InputError(f"[initial] from: {problem}, or the path of a store")
    try:
        return _read_state(path, select, where)
    except (StoreError, OSError, LookupError, ValueError, TypeError, AttributeError):
        raise InputError(f"{where}: is not a store of a study; give the path of one") from None


def _read_state(path: str, select: Selection, where: str) -> StoredState:
    import zarr

    from rubhpc.input.array_files import CHECKED, ArrayFiles

    with zarr.config.set(CHECKED):
        group = zarr.open_group(ArrayFiles(path), mode="r", zarr_format=3)
    rig: Any = group.attrs["rig"]
    if FINAL_STATE not in group:
        fix = 'run its study with [record] keep = ["state", ...]'
        raise InputError(f"{where}: keeps no final states; {fix}")
    states = _array(group, FINAL_STATE)
    dims = [str(d) for d in states.metadata.dimension_names or ()][:-1]  # type: ignore[union-attr]
    index, chosen = _find_case(group, dims, select, path)
    status = int(np.asarray(_array(group, "status")[index]))
    values = np.asarray(states[index], dtype="<f8")
    if status != DONE or not np.isfinite(values).all():
        at = ", ".join(f"{name} = {value:g}" for name, value in chosen.items())
        what = STATUS[status] if status != DONE else "not packed yet"
        raise InputError(f"{where}: the case {at} is {what}; select another, or run its study to the end")
    study: Any = group.attrs["study"]
    of_rig = [name for name in study.get("grid", {}) if "." in name and not axis_table(name)]
    keys = {name: chosen[coordinate_of(name)] for name in of_rig if coordinate_of(name) in chosen}
    return StoredState.of(values, assemble(with_keys(rig_from_dict(rig, f"{path}: rig"), keys)))


def _find_case(
    group: zarr.Group, dims: Sequence[str], select: Selection, path: str
) -> tuple[tuple[int, ...], dict[str, float]]:
    """Index of the case that is selected, and its values on all axes."""
    wanted = {coordinate_of(name): value for name, value in select}
    for name in wanted:
        if name not in dims:
            raise InputError(f"[initial] select: {path} has no axis {brief(name)}; it has {', '.join(dims)}")
    index = []
    for dim in dims:
        axis = _array(group, dim)
        values = np.asarray(axis[:], dtype=np.float64)
        if dim not in wanted and values.size > 1:
            key = dim if dim.isidentifier() else f'"{dim}"'
            example = f"select = {{ {key} = {_written(axis, values[0])} }}"
            problem = f"{path} has {values.size} values of {dim}, from which one has to be selected"
            raise InputError(f"[initial] select: {problem}; write {example}")
        index.append(_nearest(axis, values, dim, wanted[dim]) if dim in wanted else 0)
    names = [name for name in group if _array_dims(group, name) in [(dim,) for dim in dims]]
    chosen = {
        name: float(np.asarray(_array(group, name)[index[dims.index(_array_dims(group, name)[0])]]))
        for name in names
    }
    return tuple(index), chosen


def _nearest(axis: zarr.Array[Any], values: NDArray[np.float64], dim: str, wanted: str | float) -> int:
    meanings = str(axis.attrs.get("flag_meanings", "")).split()
    if wanted in meanings:
        return int(np.flatnonzero(values == meanings.index(str(wanted)))[0])
    unit = study_unit(str(axis.attrs.get("units", "1")))
    number = parse_quantity(wanted, unit, f"[initial] select.{dim}")
    place = place_of(number, values)
    if place is None:
        near = values[np.sort(np.argsort(np.abs(values - number), kind="stable")[:_MOST_WRITTEN])]
        listed = ", ".join(_written(axis, value) for value in near)
        problem = f"{brief(wanted)} is not on the grid of the store"
        raise InputError(f"[initial] select.{dim}: {problem}; choose one of {listed}")
    return place


def _array(group: zarr.Group, name: str) -> zarr.Array[Any]:
    array: zarr.Array[Any] = group[name]  # type: ignore[assignment]
    return array


def _array_dims(group: zarr.Group, name: str) -> tuple[str, ...]:
    return tuple(str(d) for d in _array(group, name).metadata.dimension_names or ())  # type: ignore[union-attr]


def _written(axis: zarr.Array[Any], value: float) -> str:
    meanings = str(axis.attrs.get("flag_meanings", "")).split()
    return f'"{meanings[int(value)]}"' if meanings else f"{value:.6g}"
