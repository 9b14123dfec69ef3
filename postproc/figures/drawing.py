"""A figure before it is drawn: its data, how to draw it, and how it gets onto a page or into a notebook."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from postproc.figures.style import figure_size, house_style, new_figure, save
from postproc.store.units import caption
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    import xarray as xr
    from matplotlib.axes import Axes


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """A figure that is still to be drawn: what a figure function returns.

    Attributes
    ----------
    shown : Dataset
        The data of the figure, as `--data` writes them; coordinates of one value make the caption.
    draw : callable
        Draws on a list of axes, row by row.
    panels : (n_row, n_column), optional
        Of a figure of several axes; without, it has one.
    is_shared : bool
        Whether its axes have one abscissa, and those of a row one ordinate.
    height, width : float, optional
        mm; by default as in `postproc.figures.style.new_figure`.
    lines : tuple of str
        What the figure command prints before it draws.
    verdict : tuple of str
        What the caption says of a single case besides (`postproc.cases.maps.verdict_of`).
    files : mapping of Path to Dataset
        Further data that the options ask to write.
    """

    shown: xr.Dataset
    draw: Callable[[list[Axes]], Any]
    panels: tuple[int, int] | None = None
    is_shared: bool = True
    height: float | None = None
    width: float | None = None
    lines: tuple[str, ...] = ()
    verdict: tuple[str, ...] = ()
    files: Mapping[Path, xr.Dataset] = field(default_factory=dict)

    def save(self, path: str | Path) -> Path:
        """Draw the figure, write it as png, pdf or svg, and return its path; needs no display."""
        n_row, n_column = self.panels or (1, 1)
        with house_style():
            figure, axes = new_figure(n_row, self.height, self.width, n_column, self.is_shared)
            self.draw(axes)
            figure.suptitle(caption(self.shown, self.verdict), fontsize=7, x=0.02, ha="left")
            return save(figure, path)

    def show(self, ax: Axes | Sequence[Axes] | None = None) -> Axes | list[Axes]:
        """Draw on the axes given, or else on a new figure of pyplot, and return the axes.

        Raises
        ------
        InputError
            `ax` has another number of axes than the figure.
        """
        n_row, n_column = self.panels or (1, 1)
        if ax is None:
            axes = self._new_axes(n_row, n_column)
        else:
            axes = list(ax) if isinstance(ax, Iterable) else [ax]
            if len(axes) != n_row * n_column:
                raise InputError(f"ax: {len(axes)} axes for a figure of {n_row * n_column}; give as many")
        with house_style():
            self.draw(axes)
        return axes if self.panels else axes[0]

    def _new_axes(self, n_row: int, n_column: int) -> list[Axes]:
        from matplotlib import pyplot

        # Outside the style: what pyplot sets up in a notebook with its first figure would end with the style.
        size = figure_size(n_row, self.height, self.width)
        figure = pyplot.figure(figsize=size, dpi=150, layout="constrained")
        with house_style():
            made = figure.subplots(
                n_row,
                n_column,
                sharex=self.is_shared,
                sharey=self.is_shared and n_column > 1,
                squeeze=False,
            )
            figure.suptitle(caption(self.shown, self.verdict), fontsize=7, x=0.02, ha="left")
        return list(made.ravel())
