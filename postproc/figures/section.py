"""The Poincaré section: one point a revolution, in a plane of two signals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.figures.bifurcation import draw_bifurcation
from postproc.figures.drawing import Drawing
from postproc.signals.sections import section_data, sections_along
from postproc.store.axes import find_axis
from postproc.store.units import displayed
from postproc.store.variables import require_results

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Axis


def section(
    cases: xr.Dataset, x: str = "horizontal", y: str = "vertical", *, over: Axis | None = None
) -> Drawing:
    """Poincaré section of two signals.

    It has one point per revolution, in the plane of both signals or of one signal along an axis. Where
    waveforms are stored, vertical_velocity, horizontal_velocity and torsion_velocity count as signals.

    Parameters
    ----------
    cases
        One case, or cases along the axis `over`.
    x
        Signal or velocity across.
    y
        Signal or velocity up.
    over
        Draw signal Y of the cases along AXIS: a bifurcation diagram.
    """
    if over:
        along = sections_along(cases, y, find_axis(cases, over))
        return Drawing(shown=along, draw=lambda axes: draw_bifurcation(along, y, axes[0], None))
    plane = section_data(cases, [x, y])
    return Drawing(shown=plane, draw=lambda axes: draw_section(plane, x, y, axes[0]))


def draw_section(data: xr.Dataset, x: str, y: str, ax: Axes) -> Axes:
    """Draw the section of one case in the plane of two signals, its points darkening as revolutions pass."""
    across, up = data[f"section_{x}"].load(), data[f"section_{y}"].load()
    require_results(across, data)
    xs, x_label = displayed(across)
    ys, y_label = displayed(up)
    dots = ax.scatter(xs, ys, c=np.arange(xs.size), cmap="viridis_r", s=9, linewidths=0, zorder=3)
    ax.figure.colorbar(dots, ax=ax, pad=0.02, aspect=25).set_label("Revolution")
    _widen(ax, xs, ys)
    ax.locator_params(axis="x", nbins=4)  # four digits and a sign take their room
    ax.set(xlabel=x_label, ylabel=y_label)
    return ax


def _widen(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Keep the points of a periodic motion, which differ by rounding, from filling the axes."""
    for values, set_limits in ((x, ax.set_xlim), (y, ax.set_ylim)):
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        least = 0.02 * max(abs(low), abs(high), 1e-30)
        middle, half = (low + high) / 2, max(0.58 * (high - low), least)
        set_limits(middle - half, middle + half)
