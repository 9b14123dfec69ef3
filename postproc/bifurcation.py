"""Bifurcation diagrams: the section points of a signal over an axis of the study, by period or regime."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.cells import is_geometric
from postproc.load import find_axis, need_results, ordered_axes
from postproc.map_figure import categories
from postproc.sections import section_of
from postproc.selection import narrow
from postproc.units import displayed, scale_of, short_name
from rubhpc.schema import DONE

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

COLORINGS = ("regime", "period")
WIDTH = 180  # mm: two columns, since an axis has hundreds of values
_MOST_DRAWN = 200_000  # points in a pdf or svg; of more, they become a picture in it
_SIZES = 0.6, 3.5  # of the points, pt
_LEAST_RANGE = 0.02  # of the largest value: points of one motion differ by rounding over all cases


def default_axis(store: xr.Dataset, along: str | None = None) -> str:
    """Return the axis named, or else the longest one.

    Raises
    ------
    InputError
        There is no such axis, or none of several values.
    """
    if along:
        return find_axis(store, along)
    axes = ordered_axes(store, "a bifurcation diagram")
    return max(axes, key=lambda a: store.sizes[a])


def bifurcation_data(store: xr.Dataset, signal: str, along: str) -> xr.Dataset:
    """Return the section of a signal with regime, period and status, over (along, section); lazy.

    Raises
    ------
    InputError
        Axes besides `along` have several values, or the store keeps neither section nor waveform.
    """
    name = f"section_{signal}"
    store = store.assign({name: section_of(store, signal)})
    data = narrow(store, [name, *COLORINGS, "status"], [along]).sortby(along)
    return data.transpose(along, "section", ...)


def bifurcation(data: xr.Dataset, signal: str, ax: Axes, color: str | None = "regime") -> Axes:
    """Draw the points of `bifurcation_data` over its axis, coloured by regime, by period or not at all."""
    section = data[f"section_{signal}"].load()
    need_results(section, data)
    along = str(section.dims[0])
    x, x_label = displayed(data[along])
    scale = scale_of(section)
    y = section.values * scale.factor
    size = float(np.clip(2.0 * np.sqrt(80 / x.size), *_SIZES))
    style: dict[str, Any] = {
        "linestyle": "",
        "marker": "o",
        "markersize": size,
        "markeredgewidth": 0.0,
        "rasterized": y.size > _MOST_DRAWN,
    }
    if color is None:
        ax.plot(np.repeat(x, y.shape[1]), y.ravel(), color="C0", **style)
    else:
        codes = np.where(data["status"].values == DONE, data[color].values, -1)
        for code, (name, shade) in categories(color, codes).items():
            chosen = codes == code
            points = np.repeat(x[chosen], y.shape[1]), y[chosen].ravel()
            ax.plot(*points, color=shade, label=name, **style)
        ax.figure.legend(
            loc="outside upper right", ncols=16, markerscale=4.0 / size, handletextpad=0.2, columnspacing=1.0
        )
    ax.margins(x=0.01)
    if is_geometric(x):
        ax.set_xscale("log")
    _widen(ax, y)
    ax.set(xlabel=x_label, ylabel=scale.label(f"{short_name(section)},\nonce a revolution"))
    return ax


def _widen(ax: Axes, y: NDArray[np.float64]) -> None:
    """Keep points that differ by rounding from filling the axes."""
    low, high = float(np.nanmin(y)), float(np.nanmax(y))
    least = _LEAST_RANGE * max(abs(low), abs(high))
    if high - low < least:
        ax.set_ylim((low + high - least) / 2, (low + high + least) / 2)
