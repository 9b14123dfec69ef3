"""A case of each motion that starts reach: its place among the starts, its section and its orbit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.cases.attractors import NO_MOTION
from rubhpc.schema import DONE

if TYPE_CHECKING:
    from collections.abc import Sequence

_PLANE = ("vertical", "horizontal")


def examples(found: xr.DataArray, cases: xr.Dataset, starts: Sequence[str]) -> xr.Dataset:
    """Return an example of each motion: the first start that reaches it, by the values of the starts.

    Parameters
    ----------
    found : DataArray
        From `attractors`.
    cases : Dataset
        Those cases, with sections, and waveforms if there are any.
    starts : sequence of str
        Dimensions over which starts differ.

    Returns
    -------
    Dataset over (*settings, attractor)
        `example_START`, the coordinates of the start (NaN where no case has the motion); over `section` also
        `motion_section_vertical` and `..._horizontal`, m. Of one setting also `orbit_vertical` and
        `orbit_horizontal` over `sample`, m, where waveforms are kept.
    """
    ordered = cases.sortby([d for d in starts if cases[d].dtype.kind in "fiu"])
    number = found.reindex_like(ordered["status"]).where(ordered["status"] == DONE, NO_MOTION)
    numbers = np.unique(number.values[number.values != NO_MOTION])
    settings = [str(d) for d in number.dims if d not in starts]
    flat = number.transpose(*settings, *starts).values.reshape(*(number.sizes[d] for d in settings), -1)
    is_of = flat[..., np.newaxis, :] == numbers[:, np.newaxis]
    dims, has_one = (*settings, "attractor"), is_of.any(axis=-1)
    place = np.unravel_index(is_of.argmax(axis=-1), [number.sizes[d] for d in starts])
    at = {d: xr.DataArray(i, dims=dims) for d, i in zip(starts, place, strict=True)}
    at |= {d: xr.DataArray(np.arange(number.sizes[d]), dims=d) for d in settings}
    is_there = xr.DataArray(has_one, dims=dims, coords={"attractor": numbers})
    shown = xr.Dataset(coords={d: ordered[d] for d in settings} | {"attractor": numbers})
    for name in (
        str(n) for n, c in ordered.coords.items() if set(c.dims) & set(starts) and n not in settings
    ):
        values = ordered[name].astype(float).isel({d: at[str(d)] for d in ordered[name].dims})
        shown[f"example_{name}"] = (dims, np.where(has_one, values.values, np.nan), ordered[name].attrs)
    for name in _PLANE:
        section = ordered[f"section_{name}"].load().isel(at).where(is_there)
        shown[f"motion_section_{name}"] = ((*dims, "section"), section.transpose(*dims, "section").values)
        shown[f"motion_section_{name}"].attrs = cases[f"section_{name}"].attrs
        if name in cases and not settings:
            orbits = [
                ordered[name].isel({d: int(at[d][i]) for d in starts}).values for i in range(len(numbers))
            ]
            shown[f"orbit_{name}"] = (("attractor", "sample"), np.array(orbits), cases[name].attrs)
    return shown
