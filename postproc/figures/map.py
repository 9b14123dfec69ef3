"""The map: a measure, the regime or the status over two axes, or over two quantities of a sample."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from postproc.cases.maps import default_axes, facet_axes, map_data, out_of_range, scatter_axes
from postproc.cases.sobol import is_log
from postproc.figures.branch_lines import events_at, mark_over_map
from postproc.figures.cells import cell_edges, hatch_cells, is_geometric, outline_cells, tick_levels
from postproc.figures.drawing import Drawing
from postproc.figures.palette import CATEGORIES, NOT_DONE, NOT_SETTLED, WARNING, coloured, paint_of
from postproc.figures.scatter import mark_cases, mark_size
from postproc.figures.small_multiples import color_bar, legend_below, name_facets, write_over
from postproc.store.axes import drawn_axes, refusal
from postproc.store.open import open_store
from postproc.store.rig_of_case import model_of
from postproc.store.select import first_of_rest, worst_of_stators
from postproc.store.units import displayed
from postproc.store.variables import require_variables
from rubhpc.errors import InputError
from rubhpc.schema import HAS_VALUES, INFERRED, MISSING
from rubhpc.study.sampling import CASE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from numpy.typing import NDArray

    from postproc.figures.options import Axis, Bounds, File, Metavar
    from postproc.figures.palette import Paint

    Edges = tuple[NDArray[np.float64], NDArray[np.float64]]


_MOST_DRAWN = 5000  # marks of a sample in a pdf or svg; of more, they become a picture in it
_PANEL = 200.0  # points: the shorter side of a panel, about


def map(  # noqa: A001 - the name of the command
    cases: xr.Dataset,
    value: str = "peak_contact_force",
    *,
    x: Axis | None = None,
    y: Axis | None = None,
    facet: Axis | Sequence[Axis] = (),
    contours: Annotated[int, Bounds(least=1), Metavar("N")] | None = None,
    log: bool = False,
    computed: bool = False,
    events: File | None = None,
) -> Drawing:
    """Map of a measure, the regime or the status over two axes.

    What is missing, not settled or out of the model's range is hatched. A sampled study is drawn as one point
    per case over two of its random quantities.

    Parameters
    ----------
    cases
        Axes that are not drawn are taken at their first value.
    value
        A measure, or regime or status; of several stators, the worst.
    x
        Axis across [default: the longest].
    y
        Axis up [default: the next longest].
    facet
        Axis with a map for each value; given twice: a grid of maps.
    contours
        Lines at N levels.
    log
        Colours on a logarithmic scale.
    computed
        Mark the computed cases of a refined map by dots; the others are inferred.
    events
        A store of branches: where motions meet, double their period or graze, over the map.
    """
    named = [facet] if isinstance(facet, str) else list(facet)
    is_sample = bool(drawn_axes(cases))
    if is_sample and contours:
        raise refusal(cases, "map: points of a sample have no contours; leave --contours out")
    if is_sample and computed:
        raise refusal(cases, "map: all cases of a sample are computed; leave --computed out")
    if events is not None and (is_sample or named):
        raise refusal(cases, "map: events go over one map of a grid; leave --facet out")
    across, up = scatter_axes(cases, x, y) if is_sample else default_axes(cases, x, y, named)
    spread = [CASE] if is_sample else [across, up]
    facets = facet_axes(cases, named, spread)
    require_variables(cases, [value])
    if "stator" not in (*spread, *facets):
        cases = worst_of_stators(cases, [value])
    cases, notes = first_of_rest(cases, [*spread, *facets], value)
    shown = map_data(cases, value, spread, facets)
    model = tuple(filter(None, model_of(cases).split(", ")))
    marked = None if events is None else events_at(open_store(events), shown, across, up)

    def draw(axes: list[Axes]) -> None:
        draw_maps(
            shown,
            value,
            axes,
            (across, up) if is_sample else None,
            log=log,
            n_contour=contours or 0,
            computed=computed,
            marks=lambda ax: [] if marked is None else mark_over_map(marked, shown, across, up, ax),
        )

    n_row, n_column = ([1, 1] + [shown.sizes[axis] for axis in facets])[-2:]
    return Drawing(
        shown=shown,
        draw=draw,
        panels=(n_row, n_column) if facets else None,
        height=30.0 + 45.0 * n_row,
        width=180.0 if facets else None,
        lines=tuple(notes),
        verdict=model,
    )


def draw_maps(
    data: xr.Dataset,
    value: str,
    axes: Sequence[Axes],
    drawn: tuple[str, str] | None = None,
    *,
    log: bool = False,
    n_contour: int = 0,
    computed: bool = False,
    marks: Callable[[Axes], Sequence[Artist]] = lambda _: [],
) -> Sequence[Axes]:
    """Draw maps from `map_data`, one for each value of its facets, in one scale of colours.

    Flags and periods have distinct colours, other measures a continuous bar and, where asked for, contours at
    about `n_contour` levels. Cases without a result are grey and hatched by their status; those that had not
    settled, or are out of the model's range, by lines; where most are out of range, a line around these
    leaves the colours to be seen. `computed` marks the computed cases by dots; `marks` draws over the first
    map, and returns what the legend is to name. A sample is drawn as one mark a case over what was `drawn`,
    across and up.
    """
    dims = [str(name) for name in data[value].dims]
    facets, (x_name, y_name) = (dims[:-1], drawn) if drawn else (dims[:-2], (dims[-1], dims[-2]))
    if not drawn:
        data = data.sortby(dims)
    x, x_label = displayed(data[x_name])
    y, y_label = displayed(data[y_name])
    edges = None if drawn else (cell_edges(x), cell_edges(y))
    shown, is_known = coloured(data, value)
    paint = paint_of(shown, log)
    if n_contour and value in CATEGORIES:
        raise InputError(f"map: {value} has no contours; draw it without --contours")
    levels = _levels(paint, n_contour) if n_contour and min(x.size, y.size) > 1 else np.array([])
    handles: list[Artist] = []
    for ax, place in zip(axes, np.ndindex(*(data.sizes[f] for f in facets)), strict=True):
        here = data.isel(dict(zip(facets, place, strict=True)))
        cells = paint.cells(shown.isel(dict(zip(facets, place, strict=True))).values)
        style: dict[str, Any] = {"norm": paint.norm, "cmap": paint.cmap}
        if edges is None:
            is_there = ~np.ma.getmaskarray(cells)
            style |= {"linewidths": 0, "rasterized": x.size > _MOST_DRAWN, "zorder": 2}
            drawing: Any = ax.scatter(x[is_there], y[is_there], mark_size(x.size), cells[is_there], **style)
            if not is_known:
                handles += mark_cases(ax, x, y, here, value, out_of_range(data)[0])
        else:
            drawing = ax.pcolormesh(*edges, cells, rasterized=True, **style)
            inside = levels[(levels > cells.min()) & (levels < cells.max())] if cells.count() else []
            if len(inside):
                ax.contour(x, y, cells, levels=inside, colors="white", linewidths=0.5)
            if not is_known:
                handles += _hatch(ax, edges, here, value, *out_of_range(data))
            if computed:
                handles += _dots(ax, x, y, here["status"].values)
            ax.set(xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
        for name, values, letter in ((x_name, x, "x"), (y_name, y, "y")):
            if is_log(data, name) if drawn else is_geometric(values):
                getattr(ax, f"set_{letter}scale")("log")
        if note := paint.note(cells):
            write_over(ax, note)
    handles += marks(axes[0])
    if edges is not None:
        tick_levels(axes[0], "x", data[x_name])
        tick_levels(axes[0], "y", data[y_name])
    if paint.has_bar:
        bar = color_bar(axes, drawing, paint)
        bar.ax.hlines(levels, *bar.ax.get_xlim(), color="white", linewidth=0.5)
    name_facets(axes, data, facets, x_label, y_label)
    legend_below(axes[0], list({str(mark.get_label()): mark for mark in handles}.values()))
    return axes


def _dots(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64], status: NDArray[np.int8]) -> list[Line2D]:
    """Mark the cases that were computed, and return what names them."""
    rows, columns = np.nonzero((status != MISSING) & (status != INFERRED))
    spacing = min(_PANEL / len(x), _PANEL / len(y))  # points of a page between two cases, about
    return ax.plot(
        x[columns],
        y[rows],
        linestyle="",
        marker="o",
        color="black",
        markersize=min(max(0.35 * spacing, 0.3), 2.0),
        markeredgewidth=0.0,
        rasterized=True,
        label="computed",
    )


def _hatch(ax: Axes, edges: Edges, data: xr.Dataset, value: str, beyond: str, is_most: bool) -> list[Artist]:
    """Hatch what has no result, no value, or is out of the model's range, and return what names them.

    `beyond` names what is out of range; where that is most of the figure, it is surrounded by a line with
    ticks on its side.
    """
    status = data["status"].values
    has_values = np.isin(status, HAS_VALUES)
    handles: list[Artist] = []
    for code, (name, color, hatch) in NOT_DONE.items():
        handles += hatch_cells(ax, edges, status == code, name, hatch, facecolor=color)
    # Such as durations without contact.
    empty = has_values & np.isnan(np.asarray(data[value].values, dtype=float))
    handles += hatch_cells(ax, edges, empty, "no value", "", facecolor="white")
    color = "k" if value in CATEGORIES else WARNING
    if "settled" in data and value != "settled":
        moving = has_values & (data["settled"].values == 0)
        handles += hatch_cells(ax, edges, moving, NOT_SETTLED, "||||", color=color)
    invalid = has_values & (data["validity"].values > 0)
    if is_most:
        return handles + outline_cells(ax, edges, invalid, f"{beyond}; ticks point into it", color=color)
    return handles + hatch_cells(ax, edges, invalid, beyond, "\\\\\\\\", color=color)


def _levels(paint: Paint, n_contour: int) -> NDArray[np.float64]:
    """Return about so many levels for contours, round ones on a linear scale."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import MaxNLocator

    low, high = float(paint.norm.vmin or 0.0), float(paint.norm.vmax or 0.0)
    if isinstance(paint.norm, LogNorm):
        levels = np.geomspace(low, high, n_contour + 2)
    else:
        levels = np.asarray(MaxNLocator(n_contour + 1).tick_values(low, high))
    return levels[(levels > low) & (levels < high)]
