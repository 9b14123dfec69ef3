"""The points of a branch study as one dimension, with the values of all axes as their coordinates."""

from __future__ import annotations

import numpy as np
import xarray as xr

from postproc.store.attributes import table_of
from postproc.store.axes import refusal
from rubhpc.schema import BRANCH_EVENT, POINT

NAMES = ("unstable", "stable")  # meanings of `stability`
_WHOLE = {"branch": "int32", "period": "int16", "regime": "int8", "stability": "int8", "event": "int8"}


def is_of_points(store: xr.Dataset) -> bool:
    """Whether a dataset holds the points of branches."""
    return "point" in store.dims and "stability" in store.data_vars


def followed(store: xr.Dataset) -> str:
    """Return the coordinate along which branches were followed."""
    return str(table_of(store, "study")["branch"]["along"]).replace(".", "_")


def other_axes(points: xr.Dataset) -> list[str]:
    """Return the coordinates that set the case of a point and have several values."""
    along = followed(points)
    return [
        str(name)
        for name, values in points.coords.items()
        if values.dims == ("point",) and name not in ("branch", "period", along)
    ]


def check_points(store: xr.Dataset) -> None:
    """Refuse a store of branches without a point."""
    if store.sizes.get("point") == 0:
        problem = "contains no point of a branch"
        raise refusal(store, f"{problem}; rubhpc status says whether any was found or computed")


def one_case(points: xr.Dataset) -> tuple[xr.Dataset, str, list[str]]:
    """Return the points at the first value of every axis, the axis followed, and a line on each such axis.

    Axes of one value become coordinates without a dimension, as captions have them. InputError where there is
    no point.
    """
    check_points(points)
    notes = []
    for name in other_axes(points):
        values = np.unique(points[name].values)
        if values.size > 1:
            points = points.isel(point=np.flatnonzero(points[name].values == points[name].values[0]))
            notes.append(
                f"{name} = {float(points[name][0]):.6g}: the first of {values.size}; "
                f"change with --select {name}=VALUE"
            )
        points = points.assign_coords({name: ((), points[name].values[0], points[name].attrs)})
    return points, followed(points), notes


def as_points(store: xr.Dataset) -> xr.Dataset:
    """Return a branch store with one dimension `point`: branch after branch, case after case, loaded.

    The axes, the one that was followed included, and `branch` and `period` are coordinates of the points.
    `status` is that of their case.
    """
    cases = [str(dim) for dim in store["status"].dims]
    along = followed(store)
    names = [str(name) for name in store.data_vars if str(name).startswith(POINT)]
    status = store["status"].values
    coords = {d: store[d] for d in cases if d != along}
    is_there = store[f"{POINT}value"].notnull().transpose(*cases, "point").values
    where = np.nonzero(is_there)
    picked = {}
    for name in names:
        values = store[name].transpose(*cases, "point", ...)  # read one at a time: few hold points
        short = name.removeprefix(POINT)
        data = values.values[where]
        if short in _WHOLE:
            data = np.where(np.isfinite(data), data, -1).astype(_WHOLE[short])
        picked[short] = (("point", *values.dims[len(cases) + 1 :]), data, dict(values.attrs))
    value = picked.pop("value")
    picked["status"] = (("point",), status[where[:-1]], dict(store["status"].attrs))
    points = xr.Dataset(picked, attrs=store.attrs)
    axis = {along: ("point", value[1], dict(store[along].attrs))}
    for dim, values in coords.items():
        axis[dim] = ("point", values.values[where[cases.index(dim)]], dict(values.attrs))
    places = {n: c for n, c in store.coords.items() if c.dims == ("stator",)}
    points = points.assign_coords(axis | places).set_coords(["branch", "period"])
    for name, meanings in (("stability", NAMES), ("event", BRANCH_EVENT)):
        points[name].attrs |= {"flag_values": list(range(len(meanings))), "flag_meanings": " ".join(meanings)}
    points.encoding.update(store.encoding)
    return points
