"""The shaft centreline: where the shaft's mean position goes while the speed changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.run_up_marks import APART, draw_rotation, name_speeds
from postproc.signals.places import moved_at
from postproc.signals.run_ups import mean_positions
from postproc.store.attributes import MEASURED
from postproc.store.rig_of_case import bores_around, stator_places, stators_around
from rubhpc.units import scale_for

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from postproc.figures.options import Count

FAR = 5.0  # times the farthest position: a clearance beyond is not drawn
RING = 3  # stators around the place at least


def centreline(
    cases: xr.Dataset,
    *,
    probes: tuple[str, str] | None = None,
    node: Count | None = None,
    stator: Count | None = None,
) -> Drawing:
    """Shaft centreline of a run-up: the mean position over the speed.

    Of a disc in a ring it is drawn in the ring's clearance.

    Parameters
    ----------
    cases
        One case of a study with [run_up].
    """
    cases = moved_at(cases, probes, node, stator)
    shown = mean_positions(cases, ["vertical", "horizontal"])
    _, is_named, where = str(cases["vertical"].attrs.get("place", "")).partition("motion at ")
    if not is_named:
        where = "the probes" if MEASURED in cases.attrs else "the disc"
    clearance = _clearance(cases)
    return Drawing(
        shown=shown, draw=lambda axes: draw_centreline(shown, axes[0], where, clearance), height=85
    )


def draw_centreline(
    data: xr.Dataset,
    ax: Axes,
    where: str = "the disc",
    clearance: tuple[float, ...] | None = None,
) -> Axes:
    """Draw the mean position, vertical over horizontal; positive spin turns clockwise.

    A `clearance` is a circle, unless it is far beyond: radius, and horizontal and vertical position, m.
    """
    x, y, speed = (data[name].values for name in ("horizontal", "vertical", "speed"))
    scale = scale_for("m", float(np.nanmax(np.hypot(x, y))))
    x, y = x * scale.factor, y * scale.factor
    reach = 0.62 * max(float(np.ptp(x)), float(np.ptp(y)), 1e-3 * float(np.abs([x, y]).max()))
    middle = 0.5 * (x.max() + x.min()), 0.5 * (y.max() + y.min())
    radius, *at = (scale.factor * size for size in clearance or (0.0, 0.0, 0.0))
    if 0.0 < radius < FAR * float(np.hypot(x, y).max()):
        middle = at[0], at[1]
        reach = 1.08 * max(radius, float(np.abs([x - middle[0], y - middle[1]]).max()))
        around = np.linspace(0.0, 2.0 * np.pi, 361)
        across, up = middle[0] + radius * np.cos(around), middle[1] + radius * np.sin(around)
        ax.plot(across, up, color="0.5", linewidth=0.7, label="clearance")
        ax.plot(*middle, "+", color="0.5", markersize=5, markeredgewidth=0.7)
        ax.legend(loc="lower right", fontsize=6, frameon=False)
    ax.set(
        xlim=(middle[0] - reach, middle[0] + reach),
        ylim=(middle[1] - reach, middle[1] + reach),
        aspect="equal",
        xlabel=scale.label("Horizontal mean position"),
        ylabel=scale.label("Vertical mean position"),
    )
    ax.plot(x, y, linewidth=0.9)
    extent = np.hypot(np.nanmax(x) - np.nanmin(x), np.nanmax(y) - np.nanmin(y)) / (2.0 * np.sqrt(2.0) * reach)
    name_speeds(ax, [(x, y)], speed, min(APART, 0.5 * extent))  # two at least in a large clearance
    draw_rotation(ax)
    ax.set_title(f"Centreline of {where}, speeds in rpm", fontsize=8)
    return ax


def _clearance(cases: xr.Dataset) -> tuple[float, ...] | None:
    """Clearance of a ring or bore around the place, as a circle, m; None without one, or where unknown."""
    is_known = "clearance" in cases.coords and cases["clearance"].size == 1
    if not is_known or (len(stators_around(cases)) < RING and not bores_around(cases)):
        return None
    places = stator_places(cases)
    angle, offset, *centre = next((place for place in places if place[0] is None), places[0])
    return (float(cases["clearance"].item()) + (offset if angle is None else 0.0), *centre)
