"""The map as a figure: colours for values and regimes, hatching for what is missing or out of range."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.cells import cell_edges, hatch_cells, is_geometric
from postproc.maps import VALIDITY
from postproc.units import displayed, scale_of, short_name
from rubhpc.errors import InputError
from rubhpc.schema import DIVERGED, DONE, FAILED, MISSING, REGIME, STATUS, VARIABLES

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Edges = tuple[NDArray[np.float64], NDArray[np.float64]]

# Cases without a result: name, grey, hatch.
_NOT_DONE = {
    MISSING: ("missing", "0.93", "...."),
    FAILED: ("failed", "0.8", "xxxx"),
    DIVERGED: ("diverged", "0.6", "////"),
}
REGIME_COLORS = ("#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7")
PERIOD_COLORS = ("#D55E00", "#56B4E9", "#0072B2", "#009E73", "#CC79A7")  # none, P1 to P4
_WARNING = "#D55E00"  # seen on the dark and on the light end of the colour bar
_LEGEND_WIDTH = 64  # characters that fit a column of a page, 6 of them taken by each handle
_CATEGORIES = ("status", "regime", "period")
STATUS_COLORS = ("#ededed", "#009E73", "#000000", "#D55E00")


def value_map(data: xr.Dataset, value: str, ax: Axes, log: bool = False) -> Axes:
    """Draw a map from `map_data`: flags and periods as distinct colours, other scalars with a colour bar.

    Cells without a result are grey and hatched by their status; out of the model's range, by lines.
    """
    y_name, x_name = data[value].dims
    data = data.sortby([str(y_name), str(x_name)])
    x, x_label = displayed(data[x_name])
    y, y_label = displayed(data[y_name])
    edges = cell_edges(x), cell_edges(y)
    status = data["status"].values
    is_known = value == "status" or VARIABLES[value].role == "setting"  # before any case is done
    done = np.ones_like(status, dtype=bool) if is_known else status == DONE
    handles = []
    if value in _CATEGORIES:
        handles += _draw_categories(ax, data[value], done, edges)
    else:
        _draw_scalar(ax, data[value], done, edges, log)
    if not is_known:
        for code, (name, color, hatch) in _NOT_DONE.items():
            handles += hatch_cells(ax, edges, ~done & (status == code), name, hatch, facecolor=color)
        empty = done & np.isnan(
            np.asarray(data[value].values, dtype=float)
        )  # such as durations without contact
        handles += hatch_cells(ax, edges, empty, "no value", "", facecolor="white")
        validity = np.where(done, data["validity"].values, 0)
        reasons = [text for bit, text, _ in VALIDITY.values() if (validity & bit).any()]
        color = "k" if value in _CATEGORIES else _WARNING
        invalid = f"out of range: {', '.join(reasons)}"
        handles += hatch_cells(ax, edges, validity > 0, invalid, "\\\\\\\\", color=color)
    for values, name in ((x, "x"), (y, "y")):
        if is_geometric(values):
            getattr(ax, f"set_{name}scale")("log")
    ax.set(xlabel=x_label, ylabel=y_label, xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
    if handles:
        n_column = _columns([len(str(h.get_label())) for h in handles])
        ax.figure.legend(handles=handles, loc="outside lower center", ncols=n_column, fontsize=6.5)
    return ax


def _columns(lengths: list[int]) -> int:
    """Return the most columns in which a legend of labels of these lengths fits; it fills by column."""
    for n_column in range(len(lengths), 1, -1):
        columns = np.array_split(lengths, n_column)
        if sum(6 + int(column.max()) for column in columns) <= _LEGEND_WIDTH:
            return n_column
    return 1


def _draw_scalar(
    ax: Axes,
    data: xr.DataArray,
    done: NDArray[np.bool_],
    edges: Edges,
    log: bool,
) -> None:
    from matplotlib.colors import LogNorm

    shown = data.where(xr.DataArray(done, dims=data.dims))
    scale = scale_of(shown)
    values = np.ma.masked_invalid(np.asarray(shown.values, dtype=float) * scale.factor)
    if values.count() == 0:
        raise InputError(
            f"map: no case of this selection has a {data.name}; run the study first, or select others"
        )
    norm = None
    if log:
        values = np.ma.masked_less_equal(values, 0.0)
        if values.count() == 0:
            raise InputError(f"map: {data.name} is nowhere positive; draw it without --log")
        norm = LogNorm(float(values.min()), float(values.max()))
    mesh = ax.pcolormesh(*edges, values, norm=norm, cmap="cividis", rasterized=True)
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02, aspect=25)
    bar.set_label(scale.label(short_name(data)))


def _draw_categories(
    ax: Axes,
    data: xr.DataArray,
    done: NDArray[np.bool_],
    edges: Edges,
) -> list[Artist]:
    """Draw codes in colours of their own and return handles of those that occur."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    codes = np.where(done, np.nan_to_num(np.asarray(data.values, dtype=float), nan=-1), -1).astype(int)
    known = categories(str(data.name), codes)
    if known:
        present = list(known)
        index = np.searchsorted(present, codes).clip(max=len(present) - 1)
        cells = np.ma.masked_where(codes < 0, index)
        cmap = ListedColormap([color for _, color in known.values()])
        ax.pcolormesh(*edges, cells, cmap=cmap, vmin=-0.5, vmax=len(present) - 0.5, rasterized=True)
    return [
        Patch(facecolor=color, edgecolor="0.4", linewidth=0.3, label=name) for name, color in known.values()
    ]


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
