"""Refined maps: cases that were not computed get the flags and measures of their surroundings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.schema import INFERRED
from rubhpc.storage.manifest import Manifest
from rubhpc.storage.resume import is_store
from rubhpc.study.refine import levels_of

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr
    from numpy.typing import NDArray


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
