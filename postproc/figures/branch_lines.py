"""Branches of periodic motions in a diagram: stable full, unstable dashed, events marked and named."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.palette import categories
from postproc.store.axes import refusal
from postproc.store.branch_points import followed, is_of_points, other_axes
from postproc.store.units import displayed, scale_of
from rubhpc.schema import BRANCH_EVENT

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from numpy.typing import NDArray

MARKED: dict[str, tuple[str, str, float]] = {  # event: name, marker, size
    "fold": ("fold", "o", 4.0),
    "period_doubling": ("period doubling", "D", 3.6),
    "neimark_sacker": ("Neimark-Sacker", "s", 3.8),
    "grazing": ("grazing", "^", 4.4),
    "branch_point": ("branch point", "P", 4.6),
}
_IN_A_ROW = 6  # names in the legend
_STYLES: dict[bool, dict[str, Any]] = {
    True: {"linestyle": "-", "linewidth": 1.2},
    False: {"linestyle": "--", "linewidth": 0.9},
}


def draw_branches(data: xr.Dataset, variable: str, along: str, ax: Axes) -> Axes:
    """Draw a variable of the points of branches over the axis that they follow.

    Of several values a point, as of a section, there is a line each: a motion of two revolutions has two.
    """
    scale = scale_of(data[variable])
    x, _ = displayed(data[along])
    y = data[variable].values.reshape(x.size, -1) * scale.factor
    y = np.sort(y, axis=1)  # which revolution comes first may change along a branch; NaN comes last
    draw_lines(data, x, y, ax)
    mark_events(data, x, y, ax)
    return ax


def draw_lines(data: xr.Dataset, x: NDArray[Any], y: NDArray[Any], ax: Axes) -> None:
    """Draw ordinates (n_point, n) over abscissas (n_point,), named by period and stability for a legend."""
    color = categories("period", data["period"].values)
    period, stable = data["period"].values.astype(int), data["stability"].values == 1
    drawn = [(period[rows[0]], bool(stable[rows[0 if rows.size < 2 else 1]]), rows) for rows in runs(data)]
    named: set[str] = set()
    for code, is_stable, rows in sorted(drawn, key=lambda run: (run[0], not run[1])):
        name, shade = color[code]
        label = f"{name}, {'stable' if is_stable else 'unstable'}"
        for column in range(int(np.isfinite(y[rows]).any(axis=0).sum())):
            first = None if label in named else label
            ax.plot(x[rows], y[rows, column], color=shade, label=first, **_STYLES[is_stable])
            named.add(label)


def mark_events(data: xr.Dataset, x: NDArray[Any], y: NDArray[Any], ax: Axes) -> list[Line2D]:
    """Mark the events at abscissas (n_point,) and ordinates (n_point, n), named for a legend."""
    events, drawn = data["event"].values, []
    for code, event in enumerate(BRANCH_EVENT):
        if event not in MARKED or not (events == code).any():
            continue
        text, marker, size = MARKED[event]
        at = events == code
        places = np.repeat(x[at], y.shape[1]), y[at].ravel()
        drawn += ax.plot(
            *places,
            linestyle="",
            marker=marker,
            markersize=size,
            markeredgecolor="black",
            markerfacecolor="white",
            markeredgewidth=0.7,
            label=text,
            zorder=4,
        )
    return drawn


def name_branches(axes: Sequence[Axes]) -> None:
    """Add the legend of branches to a figure, in two rows where one would reach its caption."""
    n_name = sum(len(ax.get_legend_handles_labels()[1]) for ax in axes)
    axes[0].figure.legend(
        loc="outside upper right",
        ncols=n_name if n_name <= _IN_A_ROW else -(-n_name // 2),
        handlelength=1.2,
        handletextpad=0.3,
        columnspacing=0.8,
    )


def events_at(points: xr.Dataset, shown: xr.Dataset, x: str, y: str) -> xr.Dataset:
    """Return the events of branches in the plane of two axes of a map, at the values of its other axes.

    InputError where the store has no branches, or they do not run in this plane.
    """
    if not is_of_points(points):
        raise refusal(points, "events: has no branches; give the store of a study with [branch]")
    lacking = [name for name in (x, y) if name not in points.coords]
    if lacking or followed(points) not in (x, y):
        why = f"its branches follow {followed(points)}, the map is over {x} and {y}"
        raise refusal(points, f"events: {why}; choose axes with --x and --y")
    is_here = np.isin(points["event"].values, [BRANCH_EVENT.index(name) for name in MARKED])
    for name in other_axes(points):
        if name not in (x, y) and name in shown.coords and shown[name].ndim == 0:
            is_here &= np.isclose(points[name].values, float(shown[name]), rtol=1e-6)
    if not is_here.any():
        raise refusal(points, "events: there is none at the values of the map; select others")
    return points.isel(point=np.flatnonzero(is_here))


def mark_over_map(points: xr.Dataset, shown: xr.Dataset, x: str, y: str, ax: Axes) -> list[Line2D]:
    """Mark events over a map, in its units; returns the marks, one a kind, for its legend."""
    places = [points[name].values * scale_of(shown[name]).factor for name in (x, y)]
    return mark_events(points, places[0], places[1][:, None], ax)


def runs(data: xr.Dataset) -> Iterator[NDArray[np.intp]]:
    """Yield the points of each stretch of one stability; neighbours share the point between."""
    branch, stable = data["branch"].values, data["stability"].values
    case = _case(data)
    start = 0
    for k in range(1, branch.size + 1):
        if k == branch.size or branch[k] != branch[start] or case[k] != case[start]:
            yield np.arange(start, k)
            start = k
        elif k - start > 1 and stable[k] != stable[k - 1]:
            yield np.arange(start, k)
            start = k - 1


def _case(data: xr.Dataset) -> NDArray[np.intp]:
    """Number of the case of each point."""
    own = [name for name in other_axes(data) if data[name].ndim]
    if not own:
        return np.zeros(data.sizes["point"], dtype=np.intp)
    columns = np.stack([data[name].values for name in own], axis=1)
    return np.asarray(np.unique(columns, axis=0, return_inverse=True)[1]).ravel()
