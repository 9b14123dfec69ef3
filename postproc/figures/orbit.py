"""The orbit of the disc: whirl in the plane of the bearings, with stators, keyphasor mark and section."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.options import spin_speed
from postproc.figures.overlay import overlaid
from postproc.figures.run_up_marks import title_speeds
from postproc.figures.small_multiples import legend_below
from postproc.signals.spectra import samples_per_revolution
from postproc.signals.waveforms import orbit_data
from postproc.store.rig_of_case import rig_of, stator_places
from postproc.store.units import short_name
from postproc.store.variables import require_results
from rubhpc.units import scale_for

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Axis, Count, Speed


def orbit(
    cases: xr.Dataset,
    *,
    revolutions: Count | None = None,
    at: Speed | None = None,
    over: Axis | None = None,
    probes: tuple[str, str] | None = None,
) -> Drawing:
    """Orbit of the disc, or of the place that two probes look at.

    With the orbit of the disc, the clearance, the stators and one point per revolution are drawn; with
    probes, their directions.

    Parameters
    ----------
    cases
        One case, or cases along the axis `over`.
    revolutions
        Only the last ones [default: all], or how many around the speed `at` [default: 4].
    at
        Spin speed of a run-up, such as "2000 rpm", around which its orbit is drawn.
    over
        Draw the cases along AXIS over one another.
    probes
        Names of two probes at one place, whose motion is drawn in place of the disc's.
    """
    speed = None if at is None else spin_speed(at, "--at")
    shown = orbit_data(cases, revolutions, over, probes, speed)

    def draw(axes: list[Axes]) -> None:
        draw_orbit(shown, axes[0])
        legend_below(axes[0], axes[0].get_legend_handles_labels()[0])

    return Drawing(shown=shown, draw=draw, height=80)


def draw_orbit(data: xr.Dataset, ax: Axes) -> Axes:
    """Draw an orbit, or those along one axis over one another; positive spin turns clockwise.

    One case also shows the clearance circle, its stators, the first sample (ring), one point a
    revolution (dots) and the sense of whirl (arrow); their labels make a legend.
    """
    vertical, horizontal = data["vertical"].load(), data["horizontal"].load()
    require_results(vertical, data)
    size = float(np.nanmax(np.abs([vertical.values, horizontal.values])))
    scale = scale_for(str(vertical.attrs.get("units", "m")), size)
    if "probes" in data.attrs:
        _draw_probes(data.attrs["probes"], ax, 1.25 * size * scale.factor)
    if vertical.ndim == 1:
        if "probes" not in data.attrs:
            draw_stators(data, ax, scale.factor, 1.15 * size * scale.factor)
        _draw_one(vertical, horizontal, ax, scale.factor)
    else:
        curves = zip(overlaid(vertical, "sample"), overlaid(horizontal, "sample"), strict=True)
        for (name, y), (_, z) in curves:
            ax.plot(z.values * scale.factor, y.values * scale.factor, linewidth=0.5, label=name)
    title_speeds(data, ax)
    ax.set_aspect("equal", adjustable="datalim")
    ax.locator_params(nbins=6)
    ax.set(xlabel=scale.label(_name(horizontal)), ylabel=scale.label(_name(vertical)))
    return ax


def _name(motion: xr.DataArray) -> str:
    """Name of a motion of the disc, or of the place that probes look at."""
    return short_name(motion.rename(None) if "of_probes" in motion.attrs else motion)


def _draw_probes(probes: list[tuple[str, float]], ax: Axes, reach: float) -> None:
    """Draw a triangle with its name where each probe looks at the shaft; `reach` is beyond the orbit."""
    for name, angle in probes:
        at = (reach * math.sin(angle), reach * math.cos(angle))
        marker = (3, 0, math.degrees(-angle) + 180.0)  # its tip points at the shaft
        ax.plot(*at, marker=marker, color="0.35", markersize=6, linestyle="none", zorder=4)
        ax.plot([0.0, at[0]], [0.0, at[1]], color="0.85", linewidth=0.6, zorder=0)
        side = "left" if at[0] < 0.0 else "right"  # towards the middle
        text = name.replace("_", " ")
        above: dict[str, Any] = {"textcoords": "offset points", "xytext": (0, 7), "ha": side, "va": "bottom"}
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8}  # over an orbit
        ax.annotate(text, at, fontsize=7, color="0.35", zorder=6, bbox=box, **above)
        ax.update_datalim([(at[0], at[1] + 0.25 * reach)])


def _draw_one(vertical: xr.DataArray, horizontal: xr.DataArray, ax: Axes, factor: float) -> None:
    n = samples_per_revolution(vertical)
    y, z = vertical.values * factor, horizontal.values * factor
    # A closed orbit is drawn closed: the last sample is one interval before the first.
    is_closed = np.hypot(y[-1] - y[0], z[-1] - z[0]) < 3 * np.hypot(y[1] - y[0], z[1] - z[0])
    path = np.append(np.arange(y.size), 0) if is_closed else np.arange(y.size)
    ax.plot(z[path], y[path], color="C0", linewidth=0.5, zorder=3)
    ax.plot(z[::n], y[::n], ".", color="C1", markersize=3, zorder=5, label="once a revolution")
    ring: dict[str, Any] = {"markerfacecolor": "none", "markersize": 5, "markeredgewidth": 0.8}
    ax.plot(z[0], y[0], "o", color="C1", zorder=5, label="first sample", **ring)
    start = n // 8  # an eighth of a turn past the mark, clear of it
    arrow = {"arrowstyle": "-|>", "color": "C0", "mutation_scale": 8, "linewidth": 0}
    ax.annotate("", (z[start + 2], y[start + 2]), xytext=(z[start], y[start]), arrowprops=arrow, zorder=4)


def draw_stators(data: xr.Dataset, ax: Axes, factor: float, reach: float) -> None:
    """Add the clearance circle and a stub of each stator; `reach` bounds what is worth showing.

    Stators on a carrier, which may move by more than the clearance, are drawn at its mean displacement.
    """
    from matplotlib.patches import Circle, Polygon

    clearance = float(data["clearance"].values) * factor
    if not 0 < clearance < 3 * reach:
        return
    edge = {"edgecolor": "0.6", "linestyle": ":", "linewidth": 0.7}
    places, is_moved = stator_places(data), "carrier_vertical" in data
    shifts = np.array([place[2:] for place in places]).reshape(-1, 2) * factor
    if is_moved:
        shifts += _shifts(data) * factor
    centre = shifts[0] if len(shifts) and (shifts == shifts[0]).all() else np.zeros(2)
    ax.add_patch(Circle((centre[0], centre[1]), clearance, fill=False, zorder=1, **edge))
    ax.plot([], [], color="0.6", linestyle=":", label="clearance")
    half_angle = math.pi / max(len(places), 3)  # the stators of a ring do not overlap
    for i, (angle, offset, *_) in enumerate(places):
        gap = clearance + offset * factor
        # Normal from the disc to the stator and tangent along its face; the plane is (horizontal, vertical).
        n, t = np.array([np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), -np.sin(angle)])
        half, deep = min(0.2 * reach, 0.8 * gap * math.tan(half_angle)) * t, 0.12 * reach * n
        face = np.array([gap * n - half, gap * n + half]) + shifts[i]
        block = Polygon([*face, *(face[::-1] + deep)], facecolor="0.85", edgecolor="none", zorder=1)
        name = "stator, mean position" if is_moved else "stator"
        block.set_label("_stator" if i else name)  # one of them is enough for a legend
        ax.add_patch(block)
        ax.plot(face[:, 0], face[:, 1], color="0.35", linewidth=0.9, zorder=2)


def _shifts(data: xr.Dataset) -> NDArray[np.float64]:
    """Mean displacement (n, 2), m, of what each stator at the disc stands on: horizontal, vertical."""
    stators = rig_of(data).stator
    at_disc = [i for i, stator in enumerate(stators) if stator.node == stators[0].node]
    return np.stack([data[f"carrier_{name}"].values[at_disc] for name in ("horizontal", "vertical")], axis=1)
