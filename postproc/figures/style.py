"""Figures at column width in the house style, without a display; saved by the extension of their name."""

from __future__ import annotations

import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rubhpc.errors import InputError, writing

if TYPE_CHECKING:
    from collections.abc import Iterator

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
    """Return a figure with `n_panel` rows of axes that share their abscissa and, in columns, their ordinate.

    Without `is_shared` they share nothing.

    Width and height are in mm; by default it is one journal column wide and each row takes its share of the
    height. The axes come row by row. Call it within `house_style`.
    """
    # Made without pyplot: no display is looked for, and nothing is left open behind the caller's back.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=figure_size(n_panel, height, width))
    FigureCanvasAgg(figure)
    axes = figure.subplots(
        n_panel, n_column, sharex=is_shared, sharey=is_shared and n_column > 1, squeeze=False
    )
    return figure, list(axes.ravel())


def figure_size(n_panel: int, height: float | None, width: float | None) -> tuple[float, float]:
    """Return width and height of a figure, inches; given ones are in mm, the others as `new_figure` says."""
    default = 63 if n_panel == 1 else 10 + 27 * n_panel
    inches = (default if height is None else height) / 25.4
    return COLUMN_WIDTH if width is None else width / 25.4, inches


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
