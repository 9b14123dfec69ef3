"""The map of a sample: a point a case over two of the quantities that were drawn at random."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.cases.maps import out_of_range
from postproc.cases.sobol import is_log
from postproc.figures.palette import CATEGORIES, NOT_DONE, NOT_SETTLED, WARNING, coloured, paint_of
from postproc.figures.small_multiples import color_bar, legend_below, name_facets, write_over
from postproc.store.units import displayed
from rubhpc.schema import DONE

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

_INK = 5000.0  # points squared of all marks together, about: they grow small as they become many
_SMALLEST, _LARGEST = 3.0, 24.0  # points squared


def scatter_maps(
    data: xr.Dataset, value: str, x: str, y: str, axes: Sequence[Axes], log: bool = False
) -> Sequence[Axes]:
    """Draw the points of `postproc.cases.maps.map_data`, a panel for each value of its facets, in one scale.

    Flags and periods have distinct colours, other measures a continuous bar. A case without a result is a
    grey cross, a square marks what had not settled and a ring what is out of the model's range.
    """
    *facets, case = map(str, data[value].dims)
    across, x_label = displayed(data[x])
    up, y_label = displayed(data[y])
    shown, is_known = coloured(data, value)
    paint = paint_of(shown, log)
    size = float(np.clip(_INK / data.sizes[case], _SMALLEST, _LARGEST))
    handles: dict[str, Artist] = {}
    for ax, place in zip(axes, np.ndindex(*(data.sizes[f] for f in facets)), strict=True):
        at = dict(zip(facets, place, strict=True))
        colours = paint.cells(shown.isel(at).values)
        has_colour = ~np.ma.getmaskarray(colours)
        points = ax.scatter(
            across[has_colour],
            up[has_colour],
            size,
            colours[has_colour],
            norm=paint.norm,
            cmap=paint.cmap,
            linewidths=0,
            rasterized=data.sizes[case] > 5000,
            zorder=2,
        )
        if not is_known:
            for mark in _marks(ax, across, up, data.isel(at), value, size, out_of_range(data)[0]):
                handles[str(mark.get_label())] = mark
        for name, set_scale in ((x, ax.set_xscale), (y, ax.set_yscale)):
            if is_log(data, name):
                set_scale("log")
        if note := paint.note(colours):
            write_over(ax, note)
    if paint.has_bar:
        color_bar(axes, points, paint)
    name_facets(axes, data, facets, x_label, y_label)
    legend_below(axes[0], list(handles.values()))
    return axes


def _marks(
    ax: Axes,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    data: xr.Dataset,
    value: str,
    size: float,
    beyond: str,
) -> list[Artist]:
    """Cross what has no result or no value, ring what is out of the model's range; return legend handles."""
    status = data["status"].values
    is_done = status == DONE
    marked: list[tuple[NDArray[np.bool_], dict[str, Any]]] = [
        (status == code, {"label": name, "marker": "x", "color": str(float(grey) / 2), "linewidths": 0.8})
        for code, (name, grey, _) in NOT_DONE.items()
    ]
    empty = is_done & np.isnan(np.asarray(data[value].values, dtype=float))
    marked.append((empty, {"label": "no value", "marker": "+", "color": "0.6", "linewidths": 0.6}))
    ring = {"s": 2.5 * size, "marker": "o", "facecolors": "none", "linewidths": 0.5}
    colour = "k" if value in CATEGORIES else WARNING
    if "settled" in data and value != "settled":
        square = ring | {"s": 4.0 * size, "marker": "s", "label": NOT_SETTLED, "edgecolors": colour}
        marked.append((is_done & (data["settled"].values == 0), square))
    marked.append((is_done & (data["validity"].values > 0), ring | {"label": beyond, "edgecolors": colour}))
    return [
        ax.scatter(x[mask], y[mask], **{"s": size, "zorder": 3} | style)
        for mask, style in marked
        if mask.any()
    ]
