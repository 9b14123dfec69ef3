"""Cases drawn over one another in one figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.store.units import written_value
from rubhpc.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

MOST = 7  # curves that have a colour of their own


def overlaid(data: xr.DataArray, own: str) -> list[tuple[str | None, xr.DataArray]]:
    """Return the cases to draw over one another, each with its name for a legend; of one case, no name.

    `own` is the dimension of a curve; the other, if there is one, is the axis of the study to spread over.

    Raises
    ------
    InputError
        There are more curves than can be distinguished.
    """
    over = next((d for d in data.dims if d != own), None)
    if over is None:
        return [(None, data)]
    n_curve = data.sizes[over]
    if n_curve > MOST:
        hint = f"keep at most {MOST}, as in --select {over}=VALUE,VALUE"
        raise InputError(f"{over}: {n_curve} curves over one another cannot be distinguished; {hint}")
    return [(written_value(data[over][i]), data.isel({over: i})) for i in range(n_curve)]
