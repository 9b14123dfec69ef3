"""The worst stator: measures of several stators as one value of the case, signals as those of one stator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.schema import VARIABLES

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr

_WORDS = {"max": "largest", "min": "smallest"}


def worst_of_stators(store: xr.Dataset, names: Iterable[str]) -> xr.Dataset:
    """Return the store with variables at the worst of its stators; lazy.

    The largest value of all stators, or the smallest where `rubhpc.schema` declares that as the worse one. A
    stator without a value, such as a duration without contact, is left out. The attribute `of_stators` of
    these variables ("largest of 16 stators") becomes a part of their names on axes. Variables that do not
    depend on the stator are unchanged, and so is a store of a single one.
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
