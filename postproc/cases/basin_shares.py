"""Of each motion that starts reach: how many do, with intervals, and an example; basin entropy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import entr

from postproc.cases.attractors import NO_MOTION
from postproc.store.units import in_words
from rubhpc.schema import DONE, REGIME

if TYPE_CHECKING:
    from collections.abc import Sequence

ENTROPY_BOX = 5  # starts along each side of the boxes of the basin entropy
_PLANE = ("vertical", "horizontal")


def fractions(attractor: xr.DataArray, starts: Sequence[str], store: xr.Dataset) -> xr.Dataset:
    """Return how many starts reach each motion, with 95 % intervals, and what the motion is.

    Parameters
    ----------
    attractor : DataArray
        From `attractors`.
    starts : sequence of str
        Dimensions over which starts differ.

    Returns
    -------
    Dataset over (*settings, attractor)
        `count`; `fraction` of the starts with a motion, its interval from `fraction_low` to `fraction_high`;
        `motion_regime` and `motion_period`, 0 where its cases have several; over settings alone `n_start`
        with a motion, and `n_without_motion`: not done, or not settled.
    """
    present = np.unique(attractor.values)
    numbers = present[present != NO_MOTION]
    is_of = attractor == xr.DataArray(numbers, dims="attractor", coords={"attractor": numbers})
    count = is_of.sum(starts)
    longest = store["period"].where(is_of, -1).max(starts)
    is_one = ((store["period"] == longest) | ~is_of).all(starts)
    period = longest.where(is_one, 0)  # records on a torus may pass for long periods
    is_like = (store["period"] == period) | ~(is_of & (store["period"] == period)).any(starts)
    n_start = (attractor != NO_MOTION).sum(starts)
    low, high = wilson(count, n_start)
    return xr.Dataset(
        {
            "count": count.assign_attrs(units="1", long_name="Starts that reach the motion"),
            "fraction": (count / n_start).assign_attrs(units="1", long_name="Basin fraction"),
            "fraction_low": low.assign_attrs(units="1", long_name="Lower end of the 95 % interval"),
            "fraction_high": high.assign_attrs(units="1", long_name="Upper end of the 95 % interval"),
            "motion_regime": _most_common(store["regime"], is_of & is_like, starts, len(REGIME)),
            "motion_period": period.assign_attrs(store["period"].attrs),
            "n_start": n_start.assign_attrs(units="1", long_name="Starts with a motion"),
            "n_without_motion": (attractor == NO_MOTION)
            .sum(starts)
            .assign_attrs(units="1", long_name="Starts not done or not settled"),
        }
    )


def _most_common(flag: xr.DataArray, is_of: xr.DataArray, starts: Sequence[str], n: int) -> xr.DataArray:
    """Flag, of `n`, that most cases of each motion have; -1 where no case has the motion."""
    counts = xr.concat([(is_of & (flag == code)).sum(starts) for code in range(n)], "code")
    found = counts.argmax("code").where(counts.max("code") > 0, -1)
    return found.astype(np.int8).assign_attrs(flag.attrs)


def wilson(count: xr.DataArray, n: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Return Wilson's 95 % interval of a share, of `count` out of `n` (Wilson, 1927)."""
    z = 1.959963984540054
    share = count / n
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z * np.sqrt(share * (1 - share) / n + z**2 / (4 * n**2)) / (1 + z**2 / n)
    return (middle - half).clip(0.0, 1.0), (middle + half).clip(0.0, 1.0)


def basin_entropy(attractor: xr.DataArray, x: str, y: str) -> tuple[float, float]:
    """Return basin entropy and boundary basin entropy of starts on a grid, nat.

    The mean Gibbs entropy of the motions in boxes of `ENTROPY_BOX` by `ENTROPY_BOX` neighbouring starts, over
    boxes at all places of the grid, and over those of more than one motion. Above ln 2 the boundary is
    fractal (Daza and others, Sci. Rep. 6, 31416, 2016). Starts without a motion are left out of their boxes.
    NaN where the grid is smaller than a box or no start has a motion, and on the boundaries where no box has
    two motions.
    """
    grid = attractor.transpose(y, x).sortby([y, x]).values
    if min(grid.shape) < ENTROPY_BOX:
        return np.nan, np.nan
    # The places overlap: boxes side by side would miss a boundary that runs between them.
    boxes = sliding_window_view(grid, (ENTROPY_BOX, ENTROPY_BOX)).reshape(-1, ENTROPY_BOX**2)
    count = np.array([(boxes == n).sum(axis=1) for n in np.unique(grid[grid != NO_MOTION])])
    if not count.size:
        return np.nan, np.nan
    count = count[:, count.any(axis=0)]
    entropy = np.asarray(entr(count / count.sum(axis=0)).sum(axis=0))
    is_mixed = (count > 0).sum(axis=0) > 1
    return float(entropy.mean()), float(entropy[is_mixed].mean()) if is_mixed.any() else np.nan


def name_of(regime: int, period: int) -> str:
    """Return what a motion is in words: "no contact", "P2", "chaotic"."""
    text = in_words(REGIME[regime])
    return f"P{period}" if text == "periodic" and period > 0 else text


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
