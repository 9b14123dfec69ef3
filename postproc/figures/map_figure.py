"""The map as a figure: colours for values and regimes, hatching for what is missing or out of range."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from postproc.cases.maps import VALIDITY
from postproc.figures.cells import cell_edges, hatch_cells, is_geometric
from postproc.store.units import displayed, scale_of, short_name, written_value
from rubhpc.errors import InputError
from rubhpc.schema import DIVERGED, DONE, FAILED, MISSING, REGIME, STATUS, VARIABLES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.colors import Normalize
    from numpy.typing import NDArray

    Edges = tuple[NDArray[np.float64], NDArray[np.float64]]

# Cases without a result: name, grey, hatch.
NOT_DONE = {
    MISSING: ("missing", "0.93", "...."),
    FAILED: ("failed", "0.8", "xxxx"),
    DIVERGED: ("diverged", "0.6", "////"),
}
REGIME_COLORS = ("#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7")
PERIOD_COLORS = ("#D55E00", "#56B4E9", "#0072B2", "#009E73", "#CC79A7")  # none, P1 to P4
WARNING = "#D55E00"  # seen on the dark and on the light end of the colour bar
_TITLE_WIDTH = 90  # characters of the titles of a row of panels
_LEGEND_WIDTH = 64  # characters that fit a column of a page, 6 of them taken by each handle
CATEGORIES = ("status", "regime", "period")
STATUS_COLORS = ("#ededed", "#009E73", "#000000", "#D55E00")


def value_maps(
    data: xr.Dataset, value: str, axes: Sequence[Axes], log: bool = False, n_contour: int = 0
) -> Sequence[Axes]:
    """Draw maps from `map_data`, one for each value of its facets, in one scale of colours.

    Flags and periods have distinct colours, other scalars a continuous bar and, where asked for, contours.
    Cells without a result are grey and hatched by their status; out of the model's range, by lines.

    Parameters
    ----------
    data : Dataset over (row, column, y, x), (column, y, x) or (y, x)
    axes : sequence of Axes
        As many as there are facets, row by row.
    n_contour : int
        Contour lines at about so many levels.
    """
    *facets, y_name, x_name = map(str, data[value].dims)
    data = data.sortby([*facets, y_name, x_name])
    x, x_label = displayed(data[x_name])
    y, y_label = displayed(data[y_name])
    edges = cell_edges(x), cell_edges(y)
    shown, is_known = coloured(data, value)
    paint = paint_of(shown, log)
    if n_contour and value in CATEGORIES:
        raise InputError(f"map: {value} has no contours; draw it without --contours")
    levels = _levels(paint, n_contour) if n_contour and min(x.size, y.size) > 1 else np.array([])
    handles: dict[str, Artist] = {}
    for ax, place in zip(axes, np.ndindex(*(data.sizes[f] for f in facets)), strict=True):
        here = dict(zip(facets, place, strict=True))
        cells = paint.cells(shown.isel(here).values)
        mesh = ax.pcolormesh(*edges, cells, norm=paint.norm, cmap=paint.cmap, rasterized=True)
        inside = levels[(levels > cells.min()) & (levels < cells.max())] if cells.count() else []
        if len(inside):
            ax.contour(x, y, cells, levels=inside, colors="white", linewidths=0.5)
        if not is_known:
            for patch in _hatch(ax, edges, data.isel(here), value, reasons_of(data)):
                handles[str(patch.get_label())] = patch
        for values, name in ((x, "x"), (y, "y")):
            if is_geometric(values):
                getattr(ax, f"set_{name}scale")("log")
        ax.set(xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
    if paint.names != []:  # a flag that no case has needs no colours
        bar = color_bar(axes, mesh, paint)
        bar.ax.hlines(levels, *bar.ax.get_xlim(), color="white", linewidth=0.5)
    name_facets(axes, data, facets, x_label, y_label)
    legend_below(axes[0], list(handles.values()))
    return axes


def coloured(data: xr.Dataset, value: str) -> tuple[xr.DataArray, bool]:
    """Return the values that have a colour, and whether all have, being known before any case is done."""
    is_known = value == "status" or VARIABLES[value].role == "setting"
    return (data[value] if is_known else data[value].where(data["status"] == DONE)), is_known


def paint_of(shown: xr.DataArray, log: bool) -> Paint:
    """Return how values become colours: those of a flag or a period distinct ones, others of a scale."""
    return _category_paint(shown) if shown.name in CATEGORIES else _scalar_paint(shown, log)


def color_bar(axes: Sequence[Axes], mesh: Any, paint: Paint) -> Colorbar:
    """Draw the scale of colours beside all panels."""
    bar = axes[0].figure.colorbar(mesh, ax=list(axes), pad=0.02, aspect=25, ticks=paint.ticks)
    bar.set_label(paint.label)
    if paint.names:
        bar.ax.set_yticklabels(paint.names)
        bar.ax.tick_params(which="both", length=0)
    return bar


def legend_below(ax: Axes, handles: list[Artist]) -> None:
    """Name what is marked, below all panels, in as many columns as fit."""
    if handles:
        n_column = _columns([len(str(handle.get_label())) for handle in handles])
        ax.figure.legend(handles=handles, loc="outside lower center", ncols=n_column, fontsize=6.5)


class Paint(NamedTuple):
    """How values become colours, the same on every panel."""

    cells: Callable[[NDArray[Any]], np.ma.MaskedArray[Any, Any]]  # values to what is drawn
    norm: Normalize | None
    cmap: Any
    label: str
    ticks: list[int] | None = None
    names: list[str] | None = None


def _scalar_paint(shown: xr.DataArray, log: bool) -> Paint:
    from matplotlib.colors import LogNorm, Normalize

    scale = scale_of(shown)

    def cells(values: NDArray[Any]) -> np.ma.MaskedArray[Any, Any]:
        drawn = np.ma.masked_invalid(np.asarray(values, dtype=float) * scale.factor)
        return np.ma.masked_less_equal(drawn, 0.0) if log else drawn

    everything = cells(shown.values)
    if np.ma.masked_invalid(np.asarray(shown.values, dtype=float)).count() == 0:
        raise InputError(
            f"map: no case of this selection has a {shown.name}; run the study first, or select others"
        )
    if everything.count() == 0:
        raise InputError(f"map: {shown.name} is nowhere positive; draw it without --log")
    limits = float(everything.min()), float(everything.max())
    norm = LogNorm(*limits) if log else Normalize(*limits)
    return Paint(cells, norm, "cividis", scale.label(short_name(shown)))


def _category_paint(shown: xr.DataArray) -> Paint:
    from matplotlib.colors import ListedColormap, Normalize

    def coded(values: NDArray[Any]) -> NDArray[np.int64]:
        codes: NDArray[np.int64] = np.nan_to_num(np.asarray(values, dtype=float), nan=-1).astype(np.int64)
        return codes

    known = categories(str(shown.name), coded(shown.values))
    if not known:
        return Paint(
            lambda values: np.ma.masked_where(coded(values) < 0, values),
            None,
            "Greys",
            short_name(shown),
            [],
            [],
        )
    present = list(known)

    def cells(values: NDArray[Any]) -> np.ma.MaskedArray[Any, Any]:
        codes = coded(values)
        return np.ma.masked_where(codes < 0, np.searchsorted(present, codes).clip(max=len(present) - 1))

    return Paint(
        cells,
        Normalize(-0.5, len(present) - 0.5),
        ListedColormap([color for _, color in known.values()]),
        short_name(shown),
        list(range(len(present))),
        [name for name, _ in known.values()],
    )


def reasons_of(data: xr.Dataset) -> str:
    """Name what leaves the model's range in any case that is done."""
    validity = np.where(data["status"].values == DONE, data["validity"].values, 0)
    return ", ".join(text for bit, text, _ in VALIDITY.values() if (validity & bit).any())


def _hatch(ax: Axes, edges: Edges, data: xr.Dataset, value: str, reasons: str) -> list[Artist]:
    """Hatch what has no result, no value, or is out of the model's range, and return what names them."""
    status = data["status"].values
    handles: list[Artist] = []
    for code, (name, color, hatch) in NOT_DONE.items():
        handles += hatch_cells(ax, edges, status == code, name, hatch, facecolor=color)
    # Such as durations without contact.
    empty = (status == DONE) & np.isnan(np.asarray(data[value].values, dtype=float))
    handles += hatch_cells(ax, edges, empty, "no value", "", facecolor="white")
    invalid = (status == DONE) & (data["validity"].values > 0)
    color = "k" if value in CATEGORIES else WARNING
    return handles + hatch_cells(ax, edges, invalid, f"out of range: {reasons}", "\\\\\\\\", color=color)


def _levels(paint: Paint, n_contour: int) -> NDArray[np.float64]:
    """Return about so many levels for contours, round ones on a linear scale."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import MaxNLocator

    assert paint.norm is not None
    low, high = float(paint.norm.vmin or 0.0), float(paint.norm.vmax or 0.0)
    if isinstance(paint.norm, LogNorm):
        levels = np.geomspace(low, high, n_contour + 2)
    else:
        levels = np.asarray(MaxNLocator(n_contour + 1).tick_values(low, high))
    return levels[(levels > low) & (levels < high)]


def name_facets(
    axes: Sequence[Axes], data: xr.Dataset, facets: Sequence[str], x_label: str, y_label: str
) -> None:
    """Label the outer axes, and each panel with its values of the facets."""
    n_column = data.sizes[facets[-1]] if facets else 1
    n_row = len(axes) // n_column
    for i, ax in enumerate(axes):
        row, column = divmod(i, n_column)
        if row == n_row - 1:
            ax.set_xlabel(x_label)
        if column == 0:
            ax.set_ylabel(y_label)
        places = (row, column)[-len(facets) :] if facets else ()
        names = [written_value(data[f][place]) for f, place in zip(facets, places, strict=True)]
        ax.set_title(textwrap.fill(", ".join(names), _TITLE_WIDTH // n_column), fontsize=7)


def _columns(lengths: list[int]) -> int:
    """Return the most columns in which a legend of labels of these lengths fits; it fills by column."""
    for n_column in range(len(lengths), 1, -1):
        columns = np.array_split(lengths, n_column)
        if sum(6 + int(column.max()) for column in columns) <= _LEGEND_WIDTH:
            return n_column
    return 1


def categories(variable: str, codes: NDArray[np.integer]) -> dict[int, tuple[str, Any]]:
    """Return name and colour of each code of a flag, or of each period, that occurs; those below 0 do not."""
    import matplotlib

    present = [int(c) for c in np.unique(codes) if c >= 0]
    if variable == "period":
        # The short ones have colours of their own, the longer ones darken, and 0, none, stands apart.
        longer = [c for c in present if c >= len(PERIOD_COLORS)]
        ramp = matplotlib.colormaps["Greys"](np.linspace(0.45, 1.0, max(len(longer), 2)))
        colors = {**dict(enumerate(PERIOD_COLORS)), **dict(zip(longer, ramp, strict=False))}
        return {c: ("none" if c == 0 else f"P{c}", colors[c]) for c in present}
    meanings, palette = (STATUS, STATUS_COLORS) if variable == "status" else (REGIME, REGIME_COLORS)
    return {c: (meanings[c].replace("_", "-" if c == 2 else " "), palette[c]) for c in present}
