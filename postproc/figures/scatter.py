"""The map of a sample: a point a case over two of the quantities that were drawn at random."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.palette import CATEGORIES, NOT_DONE, NOT_SETTLED, WARNING
from rubhpc.schema import DONE

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

_INK = 5000.0  # points squared of all marks together, about: they grow small as they become many
_SMALLEST, _LARGEST = 3.0, 24.0  # points squared


def mark_size(n: int) -> float:
    """Size of each of so many marks, points squared."""
    return float(np.clip(_INK / n, _SMALLEST, _LARGEST))


def mark_cases(
    ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64], data: xr.Dataset, value: str, beyond: str
) -> list[Artist]:
    """Cross what has no result or no value, square what had not settled, ring what is out of range.

    Returns what a legend is to name; `beyond` is the name of the last.
    """
    status = data["status"].values
    is_done = status == DONE
    marked: list[tuple[NDArray[np.bool_], dict[str, Any]]] = [
        (status == code, {"label": name, "marker": "x", "color": str(float(grey) / 2), "linewidths": 0.8})
        for code, (name, grey, _) in NOT_DONE.items()
    ]
    empty = is_done & np.isnan(np.asarray(data[value].values, dtype=float))
    marked.append((empty, {"label": "no value", "marker": "+", "color": "0.6", "linewidths": 0.6}))
    size = mark_size(status.size)
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
