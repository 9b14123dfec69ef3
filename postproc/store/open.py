"""Open a store lazily: a finished one, with the inferred cases of a refined map, or one in work."""

from __future__ import annotations

import warnings
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.store.attributes import with_sound_attributes
from postproc.store.axes import drawn_axes
from postproc.store.branch_points import as_points, is_of_points
from postproc.store.run_ups import as_run_ups, is_run_up
from postproc.store.variables import SIGNAL_ROLES
from rubhpc.errors import StoreError
from rubhpc.input.array_files import CHECKED
from rubhpc.schema import INFERRED, POINT, TURNED, VARIABLES, role_of
from rubhpc.storage.disk import disk_errors
from rubhpc.storage.lock import is_alive, read_holder
from rubhpc.storage.manifest import PRIVATE, Manifest
from rubhpc.storage.regular_files import RegularFiles
from rubhpc.storage.resume import is_store
from rubhpc.storage.runs import read_runs
from rubhpc.storage.store import Store, is_damaged
from rubhpc.study.points import MOST_CASES
from rubhpc.study.refine import levels_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray


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
        return _opened(path)
    except StoreError:
        raise
    except Exception as error:  # zarr and xarray raise a dozen kinds for a directory that is not a store
        reason = str(error).partition("\n")[0]
        raise StoreError(f"{path}: cannot be read as a zarr store ({reason}); check the path") from error


def _opened(path: Path) -> xr.Dataset:
    arrays = open_arrays(path, chunks={})
    long = [str(n) for n in arrays.data_vars if role_of(str(n)) in SIGNAL_ROLES]
    store: xr.Dataset = open_arrays(path, chunks="auto", without=long).assign(arrays[long].data_vars)
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


def open_arrays(path: Path, chunks: Any, without: Sequence[str] = ()) -> xr.Dataset:
    """Return the arrays of a store as they lie on the disk, in chunks, or lazy without dask for None."""
    import xarray as xr
    import zarr

    with warnings.catch_warnings(), zarr.config.set(CHECKED):
        # A store made by other tools may lack consolidated metadata. Durations in seconds stay numbers, and
        # nothing here is a date.
        warnings.simplefilter("ignore", RuntimeWarning)
        warnings.simplefilter("ignore", UserWarning)  # of the private directory, without such metadata
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


def fill_inferred(store: xr.Dataset, path: Path) -> xr.Dataset:
    """Return the store with the inferred cases of a refined map filled, lazily; `status` still names them.

    Flags and other integers are those of the nearer neighbour on the axis that was halved; measures are
    interpolated linearly along it.
    """
    if not is_store(path):  # a copy, which has been filled
        return store
    manifest = Manifest.read(path)
    if manifest.refine is None:
        return store
    levels = levels_of(manifest.refine, manifest.points)

    def filled(values: NDArray[Any], status: NDArray[np.int8]) -> NDArray[Any]:
        is_inferred = status == INFERRED
        if not is_inferred.any():
            return values
        mask = is_inferred.reshape(*status.shape, *[1] * (values.ndim - status.ndim))
        return np.where(mask, levels.filled(values, ~is_inferred), values)

    names = [v.name for v in manifest.measures if v.name in store and v.name != "wall_time"]
    return store.assign({n: _mapped(filled, store[n], store["status"]) for n in names})


def _mapped(function: Any, values: xr.DataArray, status: xr.DataArray) -> xr.DataArray:
    """A function of the whole arrays of two variables, lazily where they are lazy."""
    if values.chunks is None:
        return values.copy(data=function(values.values, status.values))
    from dask.array.core import from_delayed
    from dask.delayed import delayed

    later = delayed(function, pure=True)(values.data, status.data)
    whole = from_delayed(later, values.shape, values.dtype)  # type: ignore[no-untyped-call]
    return values.copy(data=whole)


def open_live(path: Path) -> xr.Dataset:
    """Return the store as `open_store` does, with status and measures of every case in the journals.

    What only the journals contain becomes attributes: `reasons` (flat index of a case to why it failed or
    diverged), `runs` (machine, ranks and times of each) and `running` (who computes now; "" if nobody). A
    store without journals, such as a copy made with xarray, is returned unchanged. StoreError where there is
    no store, or it is damaged.
    """
    dataset = open_store(path)
    if not is_store(path):
        return dataset
    store = Store(path)
    with disk_errors(path):
        is_packed = store.is_packed()
        ledger = store.replay(with_measures=not is_packed)
        lock = path / PRIVATE / "lock"
        holder = read_holder(lock)
        holders = [holder] if holder is not None and is_alive(holder, lock) else store.parts.running()
        running = "; ".join(map(str, holders))
        runs = [asdict(run) for run in read_runs(path)]
    if not is_packed and not is_of_points(dataset):  # points have no values of cases
        packed = {name: (dataset[name], values) for name, values in store.packed_values(ledger).items()}
        dataset = dataset.assign(  # a run-up is opened without its axis of one speed
            {name: (was.dims, values.reshape(was.shape), was.attrs) for name, (was, values) in packed.items()}
        )
        dataset = fill_inferred(dataset, path)
    about_runs = {"reasons": dict(ledger.reasons), "runs": runs, "running": running}
    return dataset.assign_attrs(about_runs)
