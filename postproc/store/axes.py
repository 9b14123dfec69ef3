"""The axes of an opened store: those that are left after a selection, and what a sampled study has drawn."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

from postproc.store.attributes import table_of
from rubhpc.errors import InputError
from rubhpc.study.axes import coordinate_of
from rubhpc.study.sampling import CASE

if TYPE_CHECKING:
    import xarray as xr


def source(store: xr.Dataset) -> str:
    """Return the path that the dataset was opened from, for messages."""
    return str(store.encoding.get("source", "this store"))


def refusal(store: xr.Dataset, problem: str) -> InputError:
    """Return the error of a problem with a store, which names its path."""
    return InputError(f"{source(store)}: {problem}")


def axes_of(store: xr.Dataset) -> tuple[str, ...]:
    """Return the study's axes that are left, in the order of its grid; none for a single record."""
    return tuple(str(d) for d in store["status"].dims) if "status" in store else ()


def ordered_axes(store: xr.Dataset, figure: str) -> list[str]:
    """Return the axes of several values, along which a figure can run; the cases of a sample are in no order.

    InputError where there is none; the message names the `figure` that needs one.
    """
    axes = [axis for axis in axes_of(store) if store.sizes[axis] > 1 and axis != CASE]
    if not axes:
        what = "the cases of a sample have no order, rubhpc map draws them"
        left = what if drawn_axes(store) else "this selection is one case"
        if "revolution" in store.dims:
            left = "the speed of this case changes, rubhpc waterfall draws it"
        raise refusal(store, f"{figure} needs an axis of several values; {left}")
    return axes


def drawn_axes(store: xr.Dataset) -> list[str]:
    """Return the coordinates that a sampled study has drawn, in the order of its grid; [] of a grid."""
    if CASE not in axes_of(store):
        return []
    keys = [coordinate_of(key) for key in table_of(store, "study").get("grid", {})]
    drawn = [str(name) for name, at in store.coords.items() if at.dims == (CASE,) and name != CASE]
    return sorted(drawn, key=lambda name: keys.index(name) if name in keys else len(keys))


def find_axis(store: xr.Dataset, name: str) -> str:
    """Return the dimension of an axis, given by its name or its dotted rig key; "stator" counts as an axis.

    InputError where there is no such axis left; the message names the nearest one, or all.
    """
    axis = name.replace(".", "_")
    known = [*axes_of(store), *(d for d in ("stator",) if d in store.dims)]
    if axis in known:
        return axis
    if axis in store.coords and store.coords[axis].ndim == 0:
        raise refusal(store, f"{name}: is selected already; select it once")
    if axis in drawn_axes(store):
        raise refusal(
            store,
            f"{name}: was drawn at random and is not an axis; rubhpc map draws measures "
            "over drawn quantities",
        )
    near = difflib.get_close_matches(axis, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"the axes are {', '.join(known) or 'none'}"
    raise refusal(store, f"no axis {name}; {hint}")
