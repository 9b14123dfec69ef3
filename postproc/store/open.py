"""Open a finished store lazily."""

from __future__ import annotations

import difflib
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError, StoreError
from rubhpc.schema import VARIABLES
from rubhpc.study.axes import coordinate_of
from rubhpc.study.sampling import CASE

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr
    from numpy.typing import ArrayLike

LONG_ROLES = ("waveform", "spectrum", "section")


def open_store(path: str | Path) -> xr.Dataset:
    """Return the store as a lazy, dask-backed dataset.

    Waveforms, spectra and sections are divided as they lie on disk, so that a selection reads no more than
    its own chunks; scalars are read in pieces of up to some 100 MB, since a map wants all of them at once.

    Raises
    ------
    StoreError
        There is nothing at `path`, or no store of rubhpc.
    """
    path = Path(path)
    if not path.exists():
        raise StoreError(f"{path}: no such store; give the directory that a study was run into")
    long = [n for n, v in VARIABLES.items() if v.role in LONG_ROLES]
    short = [n for n in VARIABLES if n not in long]
    try:
        scalars = _open(path, chunks="auto", without=long)
        arrays = _open(path, chunks={}, without=short)
    except Exception as error:  # zarr and xarray raise a dozen kinds for a directory that is none of theirs
        reason = str(error).partition("\n")[0]
        raise StoreError(f"{path}: cannot be read as a zarr store ({reason}); check the path") from error
    store: xr.Dataset = scalars.assign(arrays.data_vars)
    store = store[
        [*(n for n in VARIABLES if n in store.data_vars), *(n for n in store.data_vars if n not in VARIABLES)]
    ]
    if "status" not in store:
        raise StoreError(f"{path}: is not a rubhpc store; give the directory that a study was run into")
    store.encoding["source"] = str(path)
    return store


def _open(path: Path, chunks: Any, without: list[str]) -> xr.Dataset:
    import xarray as xr

    with warnings.catch_warnings():
        # A store made elsewhere may lack consolidated metadata. Durations in seconds stay numbers, and
        # nothing here is a date.
        warnings.simplefilter("ignore", RuntimeWarning)
        store = xr.open_zarr(
            path, chunks=chunks, drop_variables=without, decode_times=False, decode_timedelta=False
        )
    held = {n: store[n].compute() for n in ("revolution", *drawn_axes(store)) if n in store}
    opened: xr.Dataset = store.assign_coords(held)
    return opened


def source(store: xr.Dataset) -> str:
    """Return the path the dataset came from, for messages."""
    return str(store.encoding.get("source", "this store"))


def axes_of(store: xr.Dataset) -> tuple[str, ...]:
    """Return the study's axes that are still there, in the order of its grid; none for a single record."""
    return tuple(str(d) for d in store["status"].dims) if "status" in store else ()


def ordered_axes(store: xr.Dataset, figure: str) -> list[str]:
    """Return the axes of several values, along which a figure can run; the cases of a sample are in no order.

    Raises
    ------
    InputError
        There is none; `figure` says what needs one.
    """
    axes = [axis for axis in axes_of(store) if store.sizes[axis] > 1 and axis != CASE]
    if not axes:
        what = "the cases of a sample lie in no order, rubhpc map draws them"
        left = what if drawn_axes(store) else "this selection is one case"
        raise InputError(f"{source(store)}: {figure} needs an axis of several values; {left}")
    return axes


def drawn_axes(store: xr.Dataset) -> list[str]:
    """Return the coordinates that a sampled study has drawn, in the order of its grid; [] of a grid."""
    if CASE not in axes_of(store):
        return []
    study = store.attrs.get("study")
    keys = [coordinate_of(key) for key in study["grid"]] if isinstance(study, dict) else []
    drawn = [str(name) for name, at in store.coords.items() if at.dims == (CASE,) and name != CASE]
    return sorted(drawn, key=lambda name: keys.index(name) if name in keys else len(keys))


def find_axis(store: xr.Dataset, name: str) -> str:
    """Return the dimension of an axis, known by it or by its dotted rig key; "stator" counts as an axis.

    Raises
    ------
    InputError
        There is no such axis any more; the nearest, or else all, are named.
    """
    axis = name.replace(".", "_")
    known = [*axes_of(store), *(d for d in ("stator",) if d in store.dims)]
    if axis in known:
        return axis
    if axis in store.coords and store.coords[axis].ndim == 0:
        raise InputError(f"{source(store)}: {name}: has been selected already; leave one of the two out")
    if axis in drawn_axes(store):
        raise InputError(
            f"{source(store)}: {name}: was drawn at random, so that nothing runs along it; rubhpc map draws "
            "measures over what was drawn"
        )
    near = difflib.get_close_matches(axis, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"the axes are {', '.join(known) or 'none'}"
    raise InputError(f"{source(store)}: no axis {name}; {hint}")


def need(store: xr.Dataset, names: Iterable[str]) -> None:
    """Check that the store keeps the variables; InputError with the mend where it does not."""
    for name in names:
        if name in store:
            continue
        variable = VARIABLES.get(name)
        if variable is not None and variable.role in LONG_ROLES:
            mend = f'run the study with "{variable.role}" in [record] keep'
            raise InputError(f"{source(store)}: keeps no {name}; {mend}")
        known = [str(n) for n in store.data_vars]
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"it has {', '.join(known)}"
        raise InputError(f"{source(store)}: has no variable {name}; {hint}")


def need_results(values: ArrayLike, store: xr.Dataset) -> None:
    """Check that at least one value is there to be drawn."""
    if not np.isfinite(np.asarray(values, dtype=float)).any():
        mend = "run the study to its end, or select others"
        raise InputError(f"{source(store)}: no case of this selection is done; {mend}")
