"""Values of an axis of the study on the axes of a picture: ticks, cells around them, hatching, outlines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.store.units import displayed, meanings, plain_number

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.ticker import Locator
    from matplotlib.transforms import Transform
    from numpy.typing import NDArray

_MOST_TICKS = 40  # along a side of a map
MOST = 10  # values; an axis of more has round ticks
_CHARACTER, _GAP, _LINE = 1.5, 1.5, 3.6  # mm, of labels of 8 pt
_DEGREES = (1, 2, 5, 10, 15, 30, 45)  # between ticks of a phase
_PANEL = 0.85  # of the room for axes and their labels, taken by the axes


def tick_levels(ax: Axes, which: str, levels: xr.DataArray, at: NDArray[np.float64] | None = None) -> None:
    """Tick the values of a coordinate, and label the first and, going on, each that has room.

    Set limits and scale of the axes first. An axis of many values keeps its ticks. Values that are not at
    their displayed value on the axes are `at` (n,).
    """
    from matplotlib.ticker import NullLocator

    values, _ = displayed(levels)
    if values.size > MOST:
        return
    places = values if at is None else at
    names = [plain_number(value) for value in values]
    if flags := meanings(levels):
        names = [flags[int(value)] for value in levels.values]
    axis: Axis = getattr(ax, f"{which}axis")
    ascending = np.argsort(places)
    along = _millimetres(ax, which, places[ascending])
    need = _LINE if which == "y" else _GAP + _CHARACTER * max(map(len, names))
    named = [0]
    for k in range(1, values.size):
        if abs(along[k] - along[named[-1]]) >= need:
            named.append(k)
    if len(named) == 1:
        named.append(values.size - 1)
    labels = [""] * values.size
    for i in ascending[named]:
        labels[i] = names[i]
    axis.set_ticks(places, labels)
    axis.set_minor_locator(NullLocator())


def _millimetres(ax: Axes, which: str, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where values are along an axis, about: the layout of the figure is not known yet."""
    scale = getattr(ax, f"{which}axis").get_transform()
    ends = np.asarray(scale.transform(np.asarray(getattr(ax, f"get_{which}lim")())))
    share = (np.asarray(scale.transform(places)) - ends[0]) / (ends[1] - ends[0])
    box = ax.get_window_extent()
    pixels = box.width if which == "x" else box.height
    millimetres: NDArray[np.float64] = share * _PANEL * pixels / ax.figure.dpi * 25.4
    return millimetres


def degree_steps(ax: Axes) -> Locator:
    """Return ticks for the phase on an ordinate, degrees: right angles, or parts of them where it has few."""
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    low, high = sorted(ax.get_ylim())
    if high - low < _DEGREES[0]:
        return MaxNLocator(4, steps=[1, 2, 5, 10])
    step = next((step for step in _DEGREES if high - low <= 4 * step), 90 * max(1, round((high - low) / 450)))
    return MultipleLocator(step)


def cell_edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of cells around ascending grid values: half way between them, on their own scale."""
    if values.size == 1:
        half = 0.5 * abs(values[0]) or 0.5
        return np.array([values[0] - half, values[0] + half])
    if is_geometric(values):
        edges: NDArray[np.float64] = np.exp(cell_edges(np.log(values)))
        return edges
    middle = (values[1:] + values[:-1]) / 2
    first = 1.5 * values[0] - 0.5 * values[1]
    if values[0] > 0:
        first = max(first, 0.0)  # what is above 0, such as friction, has no cell below
    return np.concatenate(([first], middle, [1.5 * values[-1] - 0.5 * values[-2]]))


def hatch_cells(
    ax: Axes,
    edges: tuple[NDArray[np.float64], NDArray[np.float64]],
    mask: NDArray[np.bool_],
    label: str,
    hatch: str,
    facecolor: str = "none",
    color: str = "0.25",
    transform: Transform | None = None,
) -> list[Artist]:
    """Hatch the cells of a mask (n_y, n_x) as one patch; return it for a legend, or [] where none is.

    The edges are in the coordinates of the data, or of a `transform`.
    """
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if not mask.any():
        return []
    x, y = edges
    # Runs of marked cells along a row become one rectangle, so that a large region is a short path.
    ends = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, first = np.nonzero(ends == 1)
    _, last = np.nonzero(ends == -1)
    corners = np.stack(
        [
            np.column_stack((x[first], y[row])),
            np.column_stack((x[last], y[row])),
            np.column_stack((x[last], y[row + 1])),
            np.column_stack((x[first], y[row + 1])),
            np.column_stack((x[first], y[row])),
        ],
        axis=1,
    ).reshape(-1, 2)
    codes = np.tile([Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY], row.size)
    style: dict[str, Any] = {
        "hatch": hatch,
        "facecolor": facecolor,
        "edgecolor": color,
        "linewidth": 0.0,
        "label": label,
    }
    if transform is not None:
        style["transform"] = transform
    return [ax.add_patch(PathPatch(Path(corners, codes), **style))]


def outline_cells(
    ax: Axes,
    edges: tuple[NDArray[np.float64], NDArray[np.float64]],
    mask: NDArray[np.bool_],
    label: str,
    color: str = "0.25",
) -> list[Artist]:
    """Draw a line around the cells of a mask (n_y, n_x), with ticks that point into them.

    Return what names it in a legend, or [] where none is.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
    from matplotlib.markers import TICKDOWN, TICKLEFT, TICKRIGHT, TICKUP

    if not mask.any():
        return []
    x, y = edges
    into_right = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)  # 1 where the cell right is
    row, column = np.nonzero(into_right)
    upright = np.stack([np.stack([x[column], y[row]], 1), np.stack([x[column], y[row + 1]], 1)], 1)
    into_upper = np.diff(np.pad(mask.astype(np.int8), ((1, 1), (0, 0))), axis=0)
    row, column = np.nonzero(into_upper)
    level = np.stack([np.stack([x[column], y[row]], 1), np.stack([x[column + 1], y[row]], 1)], 1)
    lines = LineCollection(
        np.concatenate([upright, level]).tolist(), colors=color, linewidths=1.4, clip_on=False
    )
    lines.set_capstyle("round")
    ax.add_collection(lines, autolim=False)
    style: dict[str, Any] = {"color": color, "markersize": 3.0, "markeredgewidth": 0.6}
    named: dict[str, Any] = style | {"marker": TICKDOWN, "linewidth": 1.4}
    for parts, into, n, forth, back in (
        (upright, into_right, y.size - 1, TICKRIGHT, TICKLEFT),
        (level, into_upper, x.size - 1, TICKUP, TICKDOWN),
    ):
        step = -(-n // _MOST_TICKS)  # along a side of fine cells every so many have one
        signs, places = into[into != 0], np.add(*np.nonzero(into))
        for sign, marker in ((1, forth), (-1, back)):
            middle = parts[(signs == sign) & (places % step == 0)].mean(axis=1)
            ax.plot(*middle.T, linestyle="", marker=marker, scalex=False, scaley=False, **style)
    return [Line2D([], [], label=label, **named)]


def is_geometric(values: NDArray[np.float64]) -> bool:
    """Return whether grid values are spaced evenly on a log scale."""
    if values.size < 3 or values.min() <= 0:
        return False
    ratios = np.diff(np.log(values))
    return bool(np.ptp(ratios) < 1e-6 * np.abs(ratios).max())
