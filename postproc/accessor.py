"""`store.rub`: the figures of a store, one call each, for notebooks; `rubhpc.open` brings it along.

A method draws what the command of its name draws, and takes its options as keywords of the same names and
defaults (`postproc.figures`). Further keywords choose cases, as `postproc.store.select` does (a dotted
rig key with underscores). It draws on `ax`, a list of them where the figure has several, or on a new figure
of pyplot, and returns what it drew on.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import xarray as xr

from postproc.figures import catalogue as figures
from postproc.figures.style import figure_size, house_style
from postproc.store.open import open_store
from postproc.store.select import select
from postproc.store.units import caption
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from postproc.figures.catalogue import Drawing


@xr.register_dataset_accessor("rub")  # type: ignore[no-untyped-call]  # xarray leaves it untyped
class Rub:
    """Figures of a store.

    Examples
    --------
    >>> cases = rubhpc.open("quickstart.zarr")  # doctest: +SKIP
    >>> cases.rub.orbit(speed_ratio=1.7, clearance_ratio=0.7)  # doctest: +SKIP
    """

    def __init__(self, store: xr.Dataset) -> None:
        self._store = store

    def select(self, **choice: Any) -> xr.Dataset:
        """Return the cases whose axes have these values: numbers in SI, text with a unit, lists or slices.

        Raises
        ------
        InputError
            No such axis, or no such value on it; the message names what is near.
        """
        return select(self._store, choice)

    def cascade(
        self,
        signal: str = "torsion",
        *,
        full: bool = False,
        along: str | None = None,
        form: str = "waterfall",
        max_frequency: float | str | None = None,
        max_order: float = 5.0,
        orders: bool = False,
        order_lines: str = "1/3,1/2,2/3,1,3/2,2,3",
        mark: Mapping[str, float | str] | None = None,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the spectra of a signal along an axis; `form` may be "intensity", `mark` names more Hz."""
        drawing = figures.cascade(
            self.select(**choice),
            signal,
            full=full,
            along=along,
            form=form,
            max_frequency=max_frequency,
            max_order=max_order,
            orders=orders,
            order_lines=order_lines,
            mark=mark,
        )
        return _draw(drawing, ax)[0]

    def map(
        self,
        value: str = "peak_contact_force",
        *,
        x: str | None = None,
        y: str | None = None,
        facet: str | Sequence[str] = (),
        contours: int | None = None,
        log: bool = False,
        ax: Axes | Sequence[Axes] | None = None,
        **choice: Any,
    ) -> Axes | list[Axes]:
        """Draw a measure, the regime or the status over two axes; with `facet`, a map for each of its values.

        `facet` is one axis or two, and makes a list of what is returned. Axes that are neither spread over
        nor chosen are taken at their first value.
        """
        cases = self.select(**choice)
        drawing = figures.map_of(cases, value, x=x, y=y, facet=facet, contours=contours, log=log)
        drawn = _draw(drawing, ax)
        return drawn if facet else drawn[0]

    def orbit(
        self,
        *,
        revolutions: int | None = None,
        over: str | None = None,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the orbit of the disc with the clearance and the stators, or those along the axis `over`."""
        return _draw(figures.orbit(self.select(**choice), revolutions=revolutions, over=over), ax)[0]

    def spectrum(
        self,
        signal: str = "torsion",
        *,
        full: bool = False,
        orders: bool = False,
        max: float | None = None,  # noqa: A002 - the word of the command
        lines: int = 6,
        log: bool = False,
        over: str | None = None,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the spectrum of a signal, or of the whirl (`full`), its strongest lines named."""
        drawing = figures.spectrum(
            self.select(**choice),
            signal,
            full=full,
            orders=orders,
            max=max,
            lines=lines,
            log=log,
            over=over,
        )
        return _draw(drawing, ax)[0]

    def waveform(
        self,
        signal: str | Sequence[str] = (),
        *,
        revolutions: int = 4,
        over: str | None = None,
        ax: Axes | Sequence[Axes] | None = None,
        **choice: Any,
    ) -> list[Axes]:
        """Draw the last revolutions of some signals in panels above one another; contact is shaded."""
        cases = self.select(**choice)
        return _draw(figures.waveform(cases, signal, revolutions=revolutions, over=over), ax)

    def section(
        self,
        x: str = "horizontal",
        y: str = "vertical",
        *,
        over: str | None = None,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the Poincaré section in the plane of two signals, or signal `y` along the axis `over`."""
        return _draw(figures.section(self.select(**choice), x, y, over=over), ax)[0]

    def bifurcation(
        self,
        signal: str = "vertical",
        *,
        along: str | None = None,
        color: str | None = None,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the section points of a signal over an axis, coloured by "regime", "period" or "direction".

        By default by direction where an axis was swept both ways, else by regime.
        """
        return _draw(figures.bifurcation(self.select(**choice), signal, along=along, color=color), ax)[0]

    def hht(
        self,
        signal: str = "torsion",
        *,
        contact: str | None = None,
        revolutions: int = 4,
        mode: int = 1,
        max_frequency: float | str | None = None,
        ax: Sequence[Axes] | None = None,
        **choice: Any,
    ) -> list[Axes]:
        """Draw a signal with its intrinsic mode, and its energy over time and frequency."""
        drawing = figures.hht(
            self.select(**choice),
            signal,
            contact=contact,
            revolutions=revolutions,
            mode=mode,
            max_frequency=max_frequency,
        )
        return _draw(drawing, ax)

    def indicators(
        self,
        *,
        noise: Sequence[float] = (),
        draws: int = 3,
        false_alarms: float = 0.05,
        seed: int = 1,
        ax: Sequence[Axes] | None = None,
        **choice: Any,
    ) -> list[Axes]:
        """Draw how often the vibration tells rub from no rub, over the level of measurement noise."""
        cases = self.select(**choice)
        drawing = figures.indicators(cases, noise=noise, draws=draws, false_alarms=false_alarms, seed=seed)
        return _draw(drawing, ax)

    def sensitivity(
        self,
        scalar: str = "peak_contact_force",
        *,
        confidence: float = 0.95,
        draws: int = 500,
        seed: int = 1,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the Sobol indices of a measure over the axes of the study, with their intervals."""
        cases = self.select(**choice)
        drawing = figures.sensitivity(cases, scalar, confidence=confidence, draws=draws, seed=seed)
        return _draw(drawing, ax)[0]


def _draw(drawing: Drawing, ax: Axes | Sequence[Axes] | None) -> list[Axes]:
    with _drawing_on(drawing, ax) as axes:
        drawing.draw(axes)
    return axes


@contextmanager
def _drawing_on(drawing: Drawing, given: Axes | Sequence[Axes] | None) -> Iterator[list[Axes]]:
    """Yield, in the house style, the axes to draw on: those given, or new ones under what holds for all."""
    n_row, n_column = drawing.n_row, drawing.n_column
    if given is None:
        from matplotlib import pyplot

        # Before the style: what pyplot sets up in a notebook with its first figure would end with the style.
        size = figure_size(n_row, drawing.height, drawing.width)
        figure = pyplot.figure(figsize=size, dpi=150, layout="constrained")
        with house_style():
            made = figure.subplots(n_row, n_column, sharex=True, sharey=n_column > 1, squeeze=False)
            figure.suptitle(caption(drawing.shown), fontsize=7, x=0.02, ha="left")
            yield list(made.ravel())
        return
    axes = list(given) if isinstance(given, Iterable) else [given]
    if len(axes) != n_row * n_column:
        raise InputError(f"ax: {len(axes)} of them for a figure that has {n_row * n_column}; give as many")
    with house_style():
        yield axes


def open(path: str | Path) -> xr.Dataset:  # noqa: A001 - the public name
    """Return a store as a lazy, dask-backed dataset with the figures of `Rub` as its attribute `rub`.

    See `postproc.store.open.open_store`.
    """
    return open_store(path)
