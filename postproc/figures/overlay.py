"""Cases drawn over one another in one figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from postproc.store.units import written_value
from rubhpc.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

MOST = 7  # curves that have a colour of their own


def overlaid(own: str, *data: xr.DataArray) -> list[tuple[Any, ...]]:
    """Return the cases to draw over one another: its name for a legend, of one case None, and its data.

    `own` is the dimension of a curve; another of the first data, if there is one, is the axis of the study to
    spread over.

    Raises
    ------
    InputError
        There are more curves than can be distinguished.
    """
    first = data[0]
    over = next((d for d in first.dims if d != own), None)
    if over is None:
        return [(None, *data)]
    n_curve = first.sizes[over]
    if n_curve > MOST:
        hint = f"keep at most {MOST}, as in --select {over}=VALUE,VALUE"
        raise InputError(f"{over}: {n_curve} curves over one another cannot be distinguished; {hint}")
    return [
        (written_value(first[over][i]), *(one.isel({over: i}) if over in one.dims else one for one in data))
        for i in range(n_curve)
    ]
