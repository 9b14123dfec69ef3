"""Poincaré sections: one point a revolution, in a plane of two signals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.store.select import narrow
from postproc.store.units import displayed
from postproc.store.variables import require_results, require_variables
from rubhpc.schema import SECTION_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray


def section_of(store: xr.Dataset, signal: str) -> xr.DataArray:
    """Return the section of a signal: the stored one, or else every sample at a whole revolution; lazy.

    Raises
    ------
    InputError
        The signal is unknown, or neither its section nor its waveform is stored.
    """
    check_signal(signal)
    if f"section_{signal}" in store:
        return store[f"section_{signal}"]
    if signal not in store:
        require_variables(store, [f"section_{signal}" if signal in SECTION_NAMES else signal])
    waveform = store[signal]
    points = waveform.isel(sample=slice(None, None, samples_per_revolution(waveform)))
    points = points.rename(sample="section").drop_vars("revolution", errors="ignore")
    points.name = f"section_{signal}"
    return points


def section_data(store: xr.Dataset, signals: Sequence[str]) -> xr.Dataset:
    """Return the sections of some signals of one case; lazy."""
    found = {f"section_{s}": section_of(store, s) for s in signals}
    return narrow(store.assign(found), list(found))


def plane(data: xr.Dataset, x: str, y: str, ax: Axes) -> Axes:
    """Draw the section of one case in the plane of two signals, its points darkening as revolutions pass."""
    across, up = data[f"section_{x}"].load(), data[f"section_{y}"].load()
    require_results(across, data)
    xs, x_label = displayed(across)
    ys, y_label = displayed(up)
    dots = ax.scatter(xs, ys, c=np.arange(xs.size), cmap="viridis_r", s=9, linewidths=0, zorder=3)
    ax.figure.colorbar(dots, ax=ax, pad=0.02, aspect=25).set_label("Revolution")
    _widen(ax, xs, ys)
    ax.set(xlabel=x_label, ylabel=y_label)
    return ax


def _widen(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Keep the points of a periodic motion, which differ by rounding, from filling the axes."""
    for values, set_limits in ((x, ax.set_xlim), (y, ax.set_ylim)):
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        least = 0.02 * max(abs(low), abs(high), 1e-30)
        middle, half = (low + high) / 2, max(0.58 * (high - low), least)
        set_limits(middle - half, middle + half)
