"""Several cases in one figure: over one another, or in panels with titles, a colour bar and a legend."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.store.units import written_value
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar

    from postproc.figures.palette import Paint

_TITLE_WIDTH = 90  # characters of the titles of a row of panels
_BAR_WIDTH = 40  # characters next to a colour scale
_DISTINCT = 5  # names of a scale that are always written: periods up to 4 have colours of their own
_MOST_NAMES = 16  # that fit next to a scale
_COLUMN = 3.46  # inches, width of a figure of one column
_LEGEND_WIDTH = 64  # characters that fit a column of a page, 6 of them taken by each handle
MOST = 7  # curves that have a colour of their own


def overlaid(own: str, *data: xr.DataArray) -> list[tuple[Any, ...]]:
    """Return the cases to draw over one another: its name for a legend, of one case None, and its data.

    `own` is the dimension of a curve; another of the first data, if there is one, is the axis of the study to
    spread over. InputError where there are more curves than can be distinguished.
    """
    first = data[0]
    over = next((d for d in first.dims if d != own), None)
    if over is None:
        return [(None, *data)]
    n_curve = first.sizes[over]
    if n_curve > MOST:
        hint = f"keep at most {MOST}, as in --select {over}=VALUE,VALUE"
        raise InputError(f"{over}: {n_curve} curves over one another cannot be distinguished; {hint}")
    return [
        (written_value(first[over][i]), *(one.isel({over: i}) if over in one.dims else one for one in data))
        for i in range(n_curve)
    ]


def color_bar(axes: Sequence[Axes], mesh: Any, paint: Paint) -> Colorbar:
    """Draw the colour scale next to all panels."""
    bar = axes[0].figure.colorbar(mesh, ax=list(axes), pad=0.02, aspect=25, ticks=paint.ticks)
    name, comma, rest = paint.label.rpartition(", ")
    if len(paint.label) <= _BAR_WIDTH:
        bar.set_label(paint.label)
    else:
        bar.set_label(f"{name},\n{rest}" if comma else textwrap.fill(paint.label, _BAR_WIDTH))
    if paint.names:
        bar.ax.set_yticklabels(color_names(paint.names))
        bar.ax.tick_params(which="both", length=0)
        if len(paint.names) > _MOST_NAMES:
            bar.ax.tick_params(labelsize=5.5)
    return bar


def write_over(ax: Axes, text: str) -> None:
    """Write a note over the middle of a panel."""
    box = {"facecolor": "white", "edgecolor": "none", "pad": 2.0}
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", bbox=box, fontsize=7, zorder=6)


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


def legend_below(ax: Axes, handles: list[Artist]) -> None:
    """Name what is marked, below all panels, in as many columns as fit."""
    if handles:
        box = ax.figure.bbox
        width = int(_LEGEND_WIDTH * box.width / (_COLUMN * ax.figure.dpi))
        labels = [textwrap.fill(str(handle.get_label()), width - 6) for handle in handles]
        n_column = _columns([max(map(len, label.splitlines())) for label in labels], width)
        ax.figure.legend(handles, labels, loc="outside lower center", ncols=n_column, fontsize=6.5)


def color_names(names: Sequence[str]) -> list[str]:
    """Return the names next to a colour scale: of many, the first five and some of the others."""
    step = -(-len(names) // _MOST_NAMES)
    last = len(names) - 1
    return [
        name if i < _DISTINCT or ((last - i) % step == 0 and i >= _DISTINCT + step - 1) else ""
        for i, name in enumerate(names)
    ]


def _columns(lengths: list[int], width: int = _LEGEND_WIDTH) -> int:
    """Return the most columns in which a legend of labels of these lengths fits; it fills by column."""
    for n_column in range(len(lengths), 1, -1):
        columns = np.array_split(lengths, n_column)
        if sum(6 + int(column.max()) for column in columns) <= width:
            return n_column
    return 1
