"""Figures at column width in the house style, without a display; saved by the extension of their name."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rubhpc.errors import InputError

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


def new_figure(n_panel: int = 1, height: float | None = None) -> tuple[Figure, list[Axes]]:
    """Return a figure of column width with `n_panel` axes above one another, sharing their abscissa.

    `height` is in mm; by default each panel takes its share. Call it within `house_style`.
    """
    # Made without pyplot: no display is looked for, and nothing is left open behind the caller's back.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    inches = (height if height is not None else (63 if n_panel == 1 else 10 + 27 * n_panel)) / 25.4
    figure = Figure(figsize=(COLUMN_WIDTH, inches))
    FigureCanvasAgg(figure)
    axes = figure.subplots(n_panel, 1, sharex=True, squeeze=False)
    return figure, list(axes[:, 0])


def check_figure_path(path: str | Path) -> Path:
    """Return `path` where a figure can be written to it; InputError with the mend where not."""
    path = Path(path)
    if path.suffix.lstrip(".").lower() not in FORMATS:
        raise InputError(
            f"{path}: a figure is one of {', '.join('.' + f for f in FORMATS)}; name it {path.stem}.png"
        )
    if not path.parent.is_dir():
        raise InputError(f"{path}: no directory {path.parent}; make it first")
    return path


def save(figure: Figure, path: str | Path) -> Path:
    """Write the figure as png, pdf or svg, by its extension, and return where it lies."""
    path = check_figure_path(path)
    try:
        figure.savefig(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written: {error.strerror or error}; choose another --figure"
        ) from error
    return path
