"""Figures: the house style, data and drawing before they are drawn, and how they get onto a page."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.store.units import caption
from rubhpc.errors import InputError, writing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLE = Path(__file__).with_name("rub.mplstyle")
FORMATS = ("png", "pdf", "svg")
COLUMN_WIDTH = 88 / 25.4  # inches


@contextmanager
def house_style() -> Iterator[None]:
    """Hold the house style while a figure is made, drawn and saved."""
    import matplotlib.style

    with matplotlib.style.context(STYLE):
        yield


def new_figure(
    n_panel: int = 1,
    height: float | None = None,
    width: float | None = None,
    n_column: int = 1,
    is_shared: bool = True,
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its axes, row by row; call it within `house_style`.

    They share their abscissa and, in columns, their ordinate, or nothing without `is_shared`. Width and
    height are in mm; by default it is one journal column wide and each row takes its share of the height.
    """
    # Made without pyplot: no display is looked for, and nothing is left open behind the caller's back.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_size(n_panel, height, width))
    FigureCanvasAgg(figure)
    return figure, _panels(figure, n_panel, n_column, is_shared)


def _size(n_panel: int, height: float | None, width: float | None) -> tuple[float, float]:
    """Width and height of a figure, inches; given ones are in mm."""
    default = 63 if n_panel == 1 else 10 + 27 * n_panel
    return COLUMN_WIDTH if width is None else width / 25.4, (default if height is None else height) / 25.4


def _panels(figure: Figure, n_row: int, n_column: int, is_shared: bool) -> list[Axes]:
    axes = figure.subplots(
        n_row, n_column, sharex=is_shared, sharey=is_shared and n_column > 1, squeeze=False
    )
    return list(axes.ravel())


def check_figure_path(path: str | Path) -> Path:
    """Return `path` where a figure can be written to it; InputError where it cannot."""
    path = Path(path)
    if path.suffix.lstrip(".").lower() not in FORMATS:
        raise InputError(
            f"{path}: a figure is one of {', '.join('.' + f for f in FORMATS)}; name it {path.stem}.png"
        )
    if not path.parent.is_dir():
        raise InputError(f"{path}: no directory {path.parent}; make it first")
    return path


def save(figure: Figure, path: str | Path) -> Path:
    """Write the figure as png, pdf or svg, by its extension, and return its path."""
    path = check_figure_path(path)
    with writing(path, "--figure"), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "constrained_layout not applied")  # labels of very long numbers
        figure.savefig(path)
    return path


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """A figure that is still to be drawn: what a figure function returns."""

    shown: xr.Dataset  # as `--data` writes it; coordinates of one value make the caption
    draw: Callable[[list[Axes]], Any]  # on a list of axes, row by row
    panels: tuple[int, int] | None = None  # rows and columns of a figure of several axes
    is_shared: bool = True  # whether its axes have one abscissa, and those of a row one ordinate
    height: float | None = None  # mm; by default as in `new_figure`
    width: float | None = None
    lines: tuple[str, ...] = ()  # what the figure command prints before it draws
    verdict: tuple[str, ...] = ()  # what the caption says besides
    files: Mapping[Path, xr.Dataset] = field(default_factory=dict)  # further data that options ask to write

    def save(self, path: str | Path) -> Path:
        """Draw the figure, write it as png, pdf or svg, and return its path; needs no display."""
        n_row, n_column = self.panels or (1, 1)
        with house_style():
            figure, axes = new_figure(n_row, self.height, self.width, n_column, self.is_shared)
            self.draw(axes)
            self._write_caption(figure)
            return save(figure, path)

    def show(self, ax: Axes | Sequence[Axes] | None = None) -> Axes | list[Axes]:
        """Draw on the axes given, or else on a new figure of pyplot, and return the axes.

        InputError where `ax` has another number of axes than the figure.
        """
        n_row, n_column = self.panels or (1, 1)
        if ax is None:
            from matplotlib import pyplot

            # Outside the style: what pyplot sets up in a notebook with its first figure would end with it.
            size = _size(n_row, self.height, self.width)
            figure = pyplot.figure(figsize=size, dpi=150, layout="constrained")
            with house_style():
                axes = _panels(figure, n_row, n_column, self.is_shared)
                self._write_caption(figure)
        else:
            axes = list(ax) if isinstance(ax, Iterable) else [ax]
            if len(axes) != n_row * n_column:
                raise InputError(f"ax: {len(axes)} axes for a figure of {n_row * n_column}; give as many")
        with house_style():
            self.draw(axes)
        return axes if self.panels else axes[0]

    def _write_caption(self, figure: Figure) -> None:
        figure.suptitle(caption(self.shown, self.verdict), fontsize=7, x=0.02, ha="left")
