"""Sobol indices as a figure: two bars an axis of the study, with their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.store.units import short_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BAR = 0.36  # of the distance between two axes of the study
_STYLES = (("total", "Total, with interactions", "#BBD7EA", -1), ("first_order", "First order", "C0", 1))


def height(indices: xr.Dataset) -> float:
    """Return a height of the figure, mm, at which bars are equally thick however many there are."""
    return 24.0 + 10.0 * indices.sizes["axis"]


def bars(indices: xr.Dataset, ax: Axes) -> Axes:
    """Draw the indices of `postproc.cases.sensitivity`, the axis that matters most at the top."""
    at = -np.arange(indices.sizes["axis"], dtype=float)
    for name, label, colour, side in _STYLES:
        share = indices[name].values
        ends = [share - indices[f"{name}_low"].values, indices[f"{name}_high"].values - share]
        place = at + side * _BAR / 2
        ax.barh(place, share, _BAR, color=colour, label=label, zorder=2)
        ax.errorbar(share, place, xerr=ends, fmt="none", ecolor="k", elinewidth=0.7, capsize=2, zorder=3)
    named = zip(indices["axis"].values, indices["axis_name"].values, strict=True)
    ax.set_yticks(at, [short_name(xr.DataArray(name=n, attrs={"long_name": text})) for n, text in named])
    ax.tick_params(axis="y", length=0)
    about = indices.attrs
    scalar = xr.DataArray(name=about["measure"], attrs={"long_name": about["measure_name"]})
    told = f"{about['interactions']:.0%} interactions, {about['confidence']:.0%} intervals"
    # To the left of the panel there is room that long names of axes take.
    ax.set_title(f"{short_name(scalar)} ({told})", fontsize=7, loc="right")
    low, high = (indices[[f"first_order_{e}", f"total_{e}"]].to_dataarray() for e in ("low", "high"))
    ends_at = min(0.0, 1.1 * float(low.min())), max(1.0, 1.03 * float(high.max()))  # of estimates
    ax.set(xlim=ends_at, xlabel="Share of the variance")
    ax.xaxis.grid(visible=True, zorder=0)
    handles, labels = ax.get_legend_handles_labels()
    ax.figure.legend(handles[::-1], labels[::-1], loc="outside lower center", ncols=2)
    return ax
