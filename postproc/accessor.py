"""`store.rub`: the figures of a store, one method each, for notebooks; `rubhpc.open` registers it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import xarray as xr

from postproc.figure_methods import FigureMethods
from postproc.store.open import open_store
from postproc.store.select import select

if TYPE_CHECKING:
    from pathlib import Path

    class Cases(xr.Dataset):  # type: ignore[no-untyped-call]
        """A store as type checkers see it."""

        rub: Rub


@xr.register_dataset_accessor("rub")  # type: ignore[no-untyped-call]  # xarray leaves it untyped
class Rub(FigureMethods):
    """Figures of a store.

    A method draws what the command of its name draws, and takes its options as keywords of the same names and
    defaults (`postproc.catalogue`). Further keywords choose cases, as in `select` (a dotted rig key with
    underscores).

    Examples
    --------
    >>> cases = rubhpc.open("quickstart.zarr")  # doctest: +SKIP
    >>> cases.rub.orbit(speed_ratio=1.7, clearance_ratio=0.7)  # doctest: +SKIP
    """

    def select(self, **choice: Any) -> Cases:
        """Return the cases whose axes have these values: numbers in SI, text with a unit, lists or slices.

        Raises
        ------
        InputError
            No such axis, or no such value on it; the message names what is near.
        """
        return cast("Cases", select(self._store, choice))


def open(path: str | Path) -> Cases:  # noqa: A001 - the public name
    """Return a store as a lazy, dask-backed dataset with the figures of `Rub` as its attribute `rub`.

    See `postproc.store.open.open_store`.
    """
    return cast("Cases", open_store(path))
