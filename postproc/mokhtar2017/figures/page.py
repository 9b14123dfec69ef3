"""A page of lettered panels in the house style, one or two columns wide."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.figures.style import COLUMN_WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE_WIDTH = 180 / 25.4  # inches, both columns
_PAD = 0.045  # inches about a panel, so that the labels of one keep clear of the next
_DOTS = 200  # an inch: what a screen shows of a page


def page(rows: str, height: float, width: float | None = None) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure and its panels by letter.

    Parameters
    ----------
    rows : str
        Rows of letters, as in "ab cc": panels a and b side by side over a wide panel c.
    height, width : float
        mm; by default, a page of one panel a row is one column wide, any other two.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    mosaic = rows.split()
    inches = width / 25.4 if width else (PAGE_WIDTH if len(mosaic[0]) > 1 else COLUMN_WIDTH)
    figure = Figure(figsize=(inches, height / 25.4), dpi=_DOTS)
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=_PAD, h_pad=_PAD)  # type: ignore[union-attr, call-arg]
    panels = figure.subplot_mosaic("\n".join(mosaic))
    for letter, ax in panels.items():
        ax.set_title(f"({letter})")
    return figure, panels


def title(ax: Axes, text: str) -> None:
    """Add text after the letter of a panel."""
    ax.set_title(f"{ax.get_title(loc='left')} {text}")
