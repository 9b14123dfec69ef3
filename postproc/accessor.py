"""`store.rub`: the figures of a store, one call each, for notebooks; `rubhpc.open` brings it along.

Every method takes the values that choose cases as keywords, as `postproc.selection.select` does (a dotted rig
key with underscores), draws on `ax` or on a new figure of pyplot, and returns the Axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import xarray as xr

from postproc.load import find_axis
from postproc.selection import first_of_rest, select
from postproc.style import COLUMN_WIDTH, house_style
from postproc.units import caption

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes

_HEIGHT = 75.0  # mm


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
        along: str | None = None,
        form: str = "waterfall",
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the spectra of a signal, or of the "whirl", along an axis; `form` may be "intensity"."""
        from postproc.bench import natural_frequencies
        from postproc.cascade import cascade
        from postproc.cascade_figure import default_limit, draw_frequencies, draw_orders, intensity, waterfall

        cases = self.select(**choice)
        spectra = cascade(cases, signal, along)
        frequencies = dict(natural_frequencies(cases, str(spectra.dims[0])))
        if signal == "whirl":  # lateral motion alone
            frequencies.pop("torsional", None)
        limit = default_limit(spectra, frequencies)
        is_waterfall = form == "waterfall"
        with _drawing(ax, spectra) as (ax,):
            (waterfall if is_waterfall else intensity)(spectra, ax, limit)
            draw_orders(ax, spectra, color="0.35" if is_waterfall else "0.8")
            return draw_frequencies(ax, spectra, frequencies, color="C1" if is_waterfall else "#56B4E9")

    def map(
        self,
        value: str = "peak_contact_force",
        *,
        x: str | None = None,
        y: str | None = None,
        log: bool = False,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw a measure, the regime or the status over two axes, the others at their first value."""
        from postproc.map_figure import value_map
        from postproc.maps import default_axes, map_data

        cases = self.select(**choice)
        across, up = default_axes(cases, x, y)
        cases, _ = first_of_rest(cases, [across, up], value)
        shown = map_data(cases, value, across, up)
        with _drawing(ax, shown) as (ax,):
            return value_map(shown, value, ax, log)

    def orbit(
        self,
        *,
        revolutions: int | None = None,
        over: str | None = None,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the orbit of the disc with the clearance and the stators, or those along the axis `over`."""
        from postproc.orbits import orbit, orbit_data

        shown = orbit_data(self.select(**choice), revolutions, over)
        with _drawing(ax, shown) as (ax,):
            return orbit(shown, ax)

    def spectrum(
        self,
        signal: str = "torsion",
        *,
        over: str | None = None,
        abscissa: str = "frequency",
        log: bool = False,
        ax: Axes | None = None,
        **choice: Any,
    ) -> Axes:
        """Draw the spectrum of a signal, or of the "whirl", its strongest lines named."""
        from postproc.lines import strongest_lines
        from postproc.spectra import spectrum_data
        from postproc.spectrum_figure import default_limit, spectrum

        shown = spectrum_data(self.select(**choice), signal, over).compute()
        lines = strongest_lines(shown) if over is None else None
        with _drawing(ax, shown) as (ax,):
            return spectrum(shown, ax, lines, abscissa, default_limit(shown, abscissa), log)

    def waveform(
        self,
        signals: str | Sequence[str] = ("vertical", "horizontal", "torsion", "contact_force"),
        *,
        revolutions: int = 4,
        over: str | None = None,
        axes: Sequence[Axes] | None = None,
        **choice: Any,
    ) -> list[Axes]:
        """Draw the last revolutions of some signals in panels above one another; contact is shaded."""
        from postproc.waveforms import panels, waveform_data

        names = [signals] if isinstance(signals, str) else list(signals)
        shown = waveform_data(self.select(**choice), names, revolutions, over)
        with _drawing(axes, shown, len(names)) as found:
            return panels(shown, found)

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
        from postproc.bifurcation import bifurcation, bifurcation_data
        from postproc.sections import plane, section_data

        cases = self.select(**choice)
        shown = bifurcation_data(cases, y, find_axis(cases, over)) if over else section_data(cases, [x, y])
        with _drawing(ax, shown) as (ax,):
            return bifurcation(shown, y, ax, color=None) if over else plane(shown, x, y, ax)


@contextmanager
def _drawing(
    axes: Axes | Sequence[Axes] | None, shown: xr.DataArray | xr.Dataset, n_panel: int = 1
) -> Iterator[list[Axes]]:
    """Yield, in the house style, the axes to draw on: those given, or new ones under what holds for all."""
    if axes is None:
        from matplotlib import pyplot

        # Before the style: what pyplot sets up in a notebook with its first figure would end with the style.
        height = _HEIGHT if n_panel == 1 else 10 + 27 * n_panel
        figure = pyplot.figure(figsize=(COLUMN_WIDTH, height / 25.4), dpi=150, layout="constrained")
        with house_style():
            made = figure.subplots(n_panel, 1, sharex=True, squeeze=False)
            figure.suptitle(caption(shown), fontsize=7, x=0.02, ha="left")
            yield list(made[:, 0])
    else:
        with house_style():
            yield list(axes) if isinstance(axes, Sequence) else [axes]
