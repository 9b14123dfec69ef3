"""Revolutions of run-ups and driven rotors as a table, one row each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.store.axes import axes_of

if TYPE_CHECKING:
    from collections.abc import Sequence

_ALONG, _ROW = "revolution", "row"
_ALWAYS = ("speed", "time")


def has_revolutions(store: xr.Dataset, names: Sequence[str]) -> bool:
    """Whether these variables, one at least, are all of the revolutions of cases whose speed changes."""
    return bool(names) and all(_ALONG in store[name].dims for name in names)


def revolution_table(store: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Return revolutions as columns over `row`, loaded: case after case, as far as each has turned.

    Axes come first, then the number of the revolution, its mean speed and when it begins, then the variables
    `names`, all of revolutions: `phase_vertical_order_0.5` of an order, `..._stator_3` of one of
    several stators.
    """
    axes = axes_of(store)
    rows = (*axes, _ALONG)
    shape = store["speed"].transpose(*rows)
    has_turned = np.isfinite(shape.values).ravel()
    found: dict[str, xr.DataArray] = {name: store[name] for name in (*axes, _ALONG, *_ALWAYS)}
    for name in names:
        within = [dim for dim in store[name].dims if dim not in rows]
        if all(store.sizes[dim] == 1 for dim in within):
            found[name] = store[name].squeeze(within)
            continue
        for dim in within:  # one at most: orders or stators
            for i, label in enumerate(store[dim].values):
                found[f"{name}_{dim}_{label:.3g}"] = store[name].isel({dim: i})
    columns = {}
    for name, values in found.items():
        column = values.broadcast_like(shape).transpose(*rows).values.ravel()[has_turned]
        about = {k: str(v) for k, v in values.attrs.items() if k in ("units", "long_name")}
        columns[name] = (_ROW, column, about)
    attrs = {k: v for k, v in store.attrs.items() if k in ("title", "study", "rig", "versions", "identity")}
    return xr.Dataset(columns, attrs=attrs)
