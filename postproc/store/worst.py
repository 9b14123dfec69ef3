"""The worst stator: a measure with a value for each stator as one value of the case."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
