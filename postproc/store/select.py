"""Select cases of a store by the values of its axes, and the worst of its stators."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.store.axes import axes_of, drawn_axes, find_axis, refusal, source
from postproc.store.branch_points import is_of_points
from postproc.store.run_ups import is_run_up, steady_view
from postproc.store.units import meanings
from postproc.store.variables import require_variables
from rubhpc.input.quantity import parse_quantity
from rubhpc.schema import VARIABLES
from rubhpc.study.axes import coordinate_of, place_of, study_unit
from rubhpc.study.sampling import CASE
from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import xarray as xr
    from numpy.typing import NDArray

_MANY = 8  # values of an axis; of more than these, a message lists only some
_WORDS = {"max": "largest", "min": "smallest"}


def select(store: xr.Dataset, choice: Mapping[str, Any]) -> xr.Dataset:
    """Return the cases whose axes have the chosen values.

    Parameters
    ----------
    choice : mapping of axis name to value
        A number (SI) or a text such as ``"0.3"`` or ``"84 um"`` selects one grid value and drops the axis. A
        list, or a text with commas, keeps several; a slice, or a text such as ``"1.2..2.4"``, keeps all
        between, which is also how the cases of a sample are chosen by what was drawn. Dotted rig keys are
        known by either spelling; stators count from 1.

    Raises
    ------
    InputError
        No such axis, or no such value on it; the message names what is near.
    """
    for name, wanted in choice.items():
        if is_of_points(store) and coordinate_of(name) in store.coords:
            store = store.isel(point=_points(store, coordinate_of(name), wanted))
            continue
        if (drawn := coordinate_of(name)) in drawn_axes(store):
            places = _positions(store, drawn, wanted, is_drawn=True)
            store = store.isel({CASE: places})
            continue
        axis = find_axis(store, name)
        store = store.isel({axis: _positions(store, axis, wanted)})
    return store


def _points(store: xr.Dataset, name: str, wanted: Any) -> NDArray[np.intp]:
    """Return the points of branches at chosen values of a coordinate."""
    values, place = np.unique(store[name].values, return_inverse=True)
    known = store.drop_vars(name).assign_coords({name: (name, values, store[name].attrs)})
    found = _positions(known, name, wanted)
    return np.flatnonzero(np.isin(place, found))


def narrow(store: xr.Dataset, names: Iterable[str], spread: Iterable[str] = ()) -> xr.Dataset:
    """Return only the variables named, over the axes a figure spreads over and their own sample or order.

    Axes of one value are dropped; any other that is left must have been selected. Of several stators, the one
    with the largest contact force is taken.

    Raises
    ------
    InputError
        A variable is not kept, or axes of several values are left: one line says which values there are.
    """
    names = list(names)
    if is_run_up(store):
        store = steady_view(store, names)
    require_variables(store, names)
    spread = set(spread)
    data = store[names]
    if "stator" in data.dims and "stator" not in spread:
        data = at_most_loaded_stator(store)[names]
    free = [a for a in (*axes_of(store), "stator") if a in data.dims and a not in spread]
    several = [a for a in free if data.sizes[a] > 1]
    if several:
        which = "; ".join(f"{a} (one of {written_values(store[a])})" for a in several)
        example = f"--select {several[0]}={_written(store[several[0]], 0)!r}".replace("'", '"')
        raise refusal(store, f"select one value of {which}, as in {example}")
    data = data.isel(dict.fromkeys(free, 0))
    return data.drop_vars(_of_stator(store), errors="ignore") if "stator" in free else data


def first_of_rest(store: xr.Dataset, keep: Iterable[str], variable: str) -> tuple[xr.Dataset, list[str]]:
    """Return the store at the first value of every axis not kept, and a line on each such axis of several.

    The stators count as an axis where the variable depends on it.
    """
    require_variables(store, [variable])
    keep = set(keep)
    rest = [d for d in (*axes_of(store), *({"stator"} & set(store[variable].dims))) if d not in keep]
    notes = [
        f"{d} = {_written(store[d], 0)}: the first of {store.sizes[d]}; change with --select {d}=VALUE"
        for d in rest
        if store.sizes[d] > 1
    ]
    first = store.isel(dict.fromkeys(rest, 0))
    is_only = "stator" in rest and store.sizes["stator"] == 1
    return first.drop_vars(_of_stator(store)) if is_only else first, notes


def _of_stator(store: xr.Dataset) -> list[str]:
    """Return the coordinates of stators: a single stator and its position are left out of captions."""
    return [str(name) for name, values in store.coords.items() if "stator" in values.dims]


def written_values(axis: xr.DataArray, around: float | None = None) -> str:
    """List the values of an axis as they may be typed; of a long axis, those near `around` or its ends."""
    n = axis.size
    if n <= _MANY:
        return ", ".join(_written(axis, i) for i in range(n))
    if around is not None:
        near = np.sort(np.argsort(np.abs(axis.values - around), kind="stable")[:4])
        return f"..., {', '.join(_written(axis, int(i)) for i in near)}, ..."
    first = ", ".join(_written(axis, i) for i in range(3))
    return f"{first}, ..., {_written(axis, n - 1)}, {n} values"


def _written(axis: xr.DataArray, i: int) -> str:
    return _typed(axis, float(axis.values[i]))


def _typed(axis: xr.DataArray, value: float) -> str:
    names = meanings(axis)
    if 0 <= value < len(names) and value == int(value):
        return names[int(value)]
    return typed_quantity(value, str(axis.attrs.get("units", "1")))


def _positions(
    store: xr.Dataset, axis: str, wanted: Any, *, is_drawn: bool = False
) -> int | NDArray[np.intp]:
    """Return the index, or the indices, along `axis` of what is wanted."""
    if isinstance(wanted, str) and ".." in wanted:
        start, stop = wanted.split("..", 1)
        wanted = slice(start.strip() or None, stop.strip() or None)
    elif isinstance(wanted, str) and "," in wanted:
        wanted = wanted.split(",")
    if isinstance(wanted, slice):
        return _between(store, axis, wanted)
    if is_drawn:
        low, high = (_typed(store[axis], float(end)) for end in (store[axis].min(), store[axis].max()))
        raise refusal(
            store,
            f"{axis}: was drawn at random; select a range of it, such as {low}..{high}, or "
            f"a case by its number, {CASE}={int(store[CASE][0])}",
        )
    if isinstance(wanted, (list, tuple, np.ndarray)):
        return np.array([_nearest(store, axis, _number(store, axis, w)) for w in wanted])
    return _nearest(store, axis, _number(store, axis, wanted))


def _between(store: xr.Dataset, axis: str, wanted: slice) -> NDArray[np.intp]:
    values = store[axis].values.astype(float)
    low = -np.inf if wanted.start is None else _number(store, axis, wanted.start)
    high = np.inf if wanted.stop is None else _number(store, axis, wanted.stop)
    slack = 1e-6 * float(np.abs(values).max())
    inside = np.flatnonzero((values >= low - slack) & (values <= high + slack))
    if inside.size == 0:
        known = written_values(store[axis])
        raise refusal(store, f"{axis}: no value in that range; there is {known}")
    return inside


def _number(store: xr.Dataset, axis: str, wanted: Any) -> float:
    try:
        return float(wanted)  # SI, whatever the axis
    except (TypeError, ValueError):
        if names := meanings(store[axis]):
            if wanted in names:
                return float(names.index(wanted))
            known = ", ".join(names)
            raise refusal(store, f"{axis} = {wanted}: not on the grid; choose one of {known}") from None
        unit = study_unit(str(store[axis].attrs.get("units", "1")))
        return float(parse_quantity(wanted, unit, f"{source(store)}: {axis}"))


def _nearest(store: xr.Dataset, axis: str, wanted: float) -> int:
    place = place_of(wanted, store[axis].values.astype(float))
    if place is None:
        text, near = _typed(store[axis], wanted), written_values(store[axis], around=wanted)
        raise refusal(store, f"{axis} = {text}: not on the grid; choose one of {near}")
    return place


def worst_of_stators(store: xr.Dataset, names: Iterable[str]) -> xr.Dataset:
    """Return the store with variables at the worst of its stators, as `rubhpc.schema` declares; lazy.

    A stator without a value, such as a duration without contact, is left out. The attribute `of_stators` of
    these variables ("largest of 16 stators") becomes a part of their names on axes.
    """
    if store.sizes.get("stator", 1) == 1:
        return store
    found = {name: _worst(store[name]) for name in names if "stator" in store[name].dims}
    return store.assign(found)


def at_most_loaded_stator(cases: xr.Dataset) -> xr.Dataset:
    """Return the cases at the stator that has the largest contact force in any of them; lazy.

    The attribute `of_stators` of the coordinate `stator` ("largest force of 16") becomes a part of
    captions. Cases of a single stator, or without `peak_contact_force`, are unchanged.
    """
    n_stator = cases.sizes.get("stator", 1)
    if n_stator == 1 or "peak_contact_force" not in cases:
        return cases
    force = cases["peak_contact_force"]
    largest = force.max([dim for dim in force.dims if dim != "stator"]).fillna(0.0).compute()
    text = f"largest force of {n_stator}" if largest.any() else f"none of {n_stator} in contact"
    stator = cases["stator"].assign_attrs(of_stators=text)
    return cases.assign_coords(stator=stator).isel(stator=int(np.argmax(largest.values)))


def worst_word(name: str) -> str:
    """Return which value over stators is the worst: "largest" or "smallest"."""
    return _WORDS[VARIABLES[name].worst if name in VARIABLES else "max"]


def _worst(values: xr.DataArray) -> xr.DataArray:
    name = str(values.name)
    word = worst_word(name)
    of_stators = f"{word} of {values.sizes['stator']} stators"
    reduced = values.min("stator") if word == "smallest" else values.max("stator")
    long_name = str(values.attrs.get("long_name", name.replace("_", " ")))
    worst: xr.DataArray = reduced.assign_attrs(
        values.attrs, long_name=f"{long_name}, {of_stators}", of_stators=of_stators
    )
    return worst
