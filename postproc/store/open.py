"""Open a finished store lazily."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.store.attributes import with_sound_attributes
from postproc.store.axes import drawn_axes
from postproc.store.branch_points import as_points
from postproc.store.inferred import fill_inferred
from postproc.store.run_ups import as_run_ups, is_run_up
from postproc.store.variables import SIGNAL_ROLES
from rubhpc.errors import StoreError
from rubhpc.input.array_files import CHECKED
from rubhpc.schema import POINT, TURNED, VARIABLES, role_of
from rubhpc.storage.regular_files import RegularFiles
from rubhpc.storage.store import is_damaged
from rubhpc.study.points import MOST_CASES

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr


def open_store(path: str | Path) -> xr.Dataset:
    """Return the store as a lazy, dask-backed dataset.

    Waveforms and spectra keep the chunks of the disk, so that a selection reads only its own chunks; measures
    and sections are read in pieces of about 100 MB, since maps and basins need all of them at once: chunk by
    chunk the sections of 10 000 cases take six times as long. A branch study is returned as its points
    (`postproc.store.branch_points`), one of run-ups with `speed` over `revolution`.

    Raises
    ------
    StoreError
        `path` does not exist, or is not a store of rubhpc.
    """
    path = Path(path)
    if not path.exists():
        raise StoreError(f"{path}: no such store; give the directory that a study was run into")
    try:
        arrays = _open(path, chunks={})
        long = [str(n) for n in arrays.data_vars if role_of(str(n)) in SIGNAL_ROLES]
        measures = _open(path, chunks="auto", without=long)
        arrays = arrays[long]
    except StoreError:
        raise
    except Exception as error:  # zarr and xarray raise a dozen kinds for a directory that is not a store
        reason = str(error).partition("\n")[0]
        raise StoreError(f"{path}: cannot be read as a zarr store ({reason}); check the path") from error
    store: xr.Dataset = measures.assign(arrays.data_vars)
    store = store[
        [*(n for n in VARIABLES if n in store.data_vars), *(n for n in store.data_vars if n not in VARIABLES)]
    ]
    if "status" not in store:
        raise StoreError(f"{path}: is not a rubhpc store; give the directory that a study was run into")
    store.encoding["source"] = str(path)
    if is_damaged(path):
        raise StoreError(f"{path}: its metadata are damaged; run its study again to repair them")
    if store["status"].size > MOST_CASES:
        raise StoreError(
            f"{path}: states {store['status'].size} cases, more than a store can have; get it anew"
        )
    store = with_sound_attributes(store, path)
    if f"{POINT}value" in store:
        return as_points(store)
    return as_run_ups(store) if is_run_up(store) else fill_inferred(store, path)


def _open(path: Path, chunks: Any, without: Sequence[str] = ()) -> xr.Dataset:
    import xarray as xr
    import zarr

    with warnings.catch_warnings(), zarr.config.set(CHECKED):
        # A store made by other tools may lack consolidated metadata. Durations in seconds stay numbers, and
        # nothing here is a date.
        warnings.simplefilter("ignore", RuntimeWarning)
        store = xr.open_zarr(
            RegularFiles(path),
            chunks=chunks,
            zarr_format=3,
            mask_and_scale=False,
            drop_variables=list(without),
            decode_times=False,
            decode_timedelta=False,
        )
    held = {n: store[n].compute() for n in ("revolution", TURNED, *drawn_axes(store)) if n in store}
    opened: xr.Dataset = store.assign_coords(held)
    return opened
