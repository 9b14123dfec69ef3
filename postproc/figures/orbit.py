"""The orbit of the disc: whirl in the plane of the bearings, with stators, keyphasor mark and section."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.options import above_zero
from postproc.figures.run_up_marks import draw_rotation, title_of_speeds
from postproc.figures.small_multiples import legend_below, overlaid
from postproc.signals.places import moved_at
from postproc.signals.spectra import samples_per_revolution
from postproc.signals.waveforms import orbit_data
from postproc.store.rig_of_case import bores_around, stator_places, stators_around
from postproc.store.units import short_name
from postproc.store.variables import require_results
from rubhpc.units import scale_for

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Axis, Count, Speed
    from rubhpc.units import Scale

_MARGIN = 1.15  # of the size of an orbit or a clearance, around it
_NEAR = 5.0  # times the size of the orbit, within which the clearance is drawn
_WHOLE = 3.5  # the same, up to which all of the clearance is, or the centre without loads
RIMS = ("rim_vertical", "rim_horizontal")
_ASIDE = 0.25  # of the size of the orbit, by which its middle is off the centre where that is marked


def orbit(
    cases: xr.Dataset,
    *,
    revolutions: Count | None = None,
    at: Speed | None = None,
    over: Axis | None = None,
    probes: tuple[str, str] | None = None,
    node: Count | None = None,
    stator: Count | None = None,
    frame: Literal["orbit", "clearance", "mean"] = "orbit",
) -> Drawing:
    """Orbit of the disc, or of another place whose motion is recorded.

    The clearance, the stators, the directions of the probes and one point per revolution are drawn with it.

    Parameters
    ----------
    cases
        One case, or cases along the axis `over`.
    revolutions
        Only the last ones [default: all], or how many around the speed `at` [default: 4].
    at
        Spin speed of a run-up, such as "2000 rpm", around which its orbit is drawn.
    frame
        Follow the orbit, with the clearance and the centre without loads where they are near; show all of the
        clearance; or take the mean position off.
    """
    speed = above_zero(at, "rad/s", "--at")
    shown = orbit_data(moved_at(cases, probes, node, stator), revolutions, over, speed)

    def draw(axes: list[Axes]) -> None:
        draw_orbit(shown, axes[0], frame)
        legend_below(axes[0], axes[0].get_legend_handles_labels()[0])

    return Drawing(shown=shown, draw=draw, height=80)


def draw_orbit(data: xr.Dataset, ax: Axes, frame: str = "orbit") -> Axes:
    """Draw an orbit, or those along one axis over one another; positive spin turns clockwise.

    One case also shows the clearance circle, its stators, the first sample (ring), one point a revolution
    (dots) and the sense of whirl (arrow); their labels make a legend. In view is what the `frame` names: the
    "orbit" and what is near it, all of the "clearance", or the orbit about its "mean".
    """
    vertical, horizontal = data["vertical"].load(), data["horizontal"].load()
    require_results(vertical, data)
    title = title_of_speeds(data)
    is_one, is_mean = vertical.ndim == 1, frame == "mean"
    mean = np.array([float(horizontal.mean()), float(vertical.mean())]) if is_one else np.zeros(2)
    if is_mean:
        vertical, horizontal = (
            (motion - motion.mean("sample")).assign_attrs(motion.attrs) for motion in (vertical, horizontal)
        )
    size = float(np.nanmax(np.abs([vertical.values, horizontal.values])))
    scale = scale_for(str(vertical.attrs.get("units", "m")), size)
    if is_one:
        _draw_one(vertical, horizontal, ax, scale.factor)
        view = _view(horizontal.values * scale.factor, vertical.values * scale.factor)
        centre = -mean * scale.factor if is_mean else np.zeros(2)
        is_seen = _draw_around(data, ax, scale.factor, view, centre, frame == "clearance")
        if is_mean or not is_seen:
            title.append(f"mean {_written(mean[1], scale)} vertical, {_written(mean[0], scale)} horizontal")
    else:
        for name, y, z in overlaid("sample", vertical, horizontal):
            ax.plot(z.values * scale.factor, y.values * scale.factor, linewidth=0.5, label=name)
    if title:
        ax.set_title("; ".join(title), fontsize=7)
    ax.set_aspect("equal", adjustable="datalim")
    ax.locator_params(nbins=6)
    ax.ticklabel_format(style="plain", useOffset=False)
    from_mean = " \N{MINUS SIGN} mean" if is_mean else ""
    ax.set(
        xlabel=scale.label(_name(horizontal, data) + from_mean),
        ylabel=scale.label(_name(vertical, data) + from_mean),
    )
    draw_rotation(ax)
    return ax


def _name(motion: xr.DataArray, data: xr.Dataset) -> str:
    """Name of a motion of the disc, or of the place that probes look at."""
    return short_name(motion.rename(None) if "probes" in data.attrs else motion)


def _written(position: float, scale: Scale) -> str:
    return f"{round(position * scale.factor, 1) + 0.0:g} {scale.unit}"  # no -0


class _View(NamedTuple):
    """The middle of an orbit, across and up, and half of its size, as they are displayed."""

    middle: NDArray[np.float64]
    half: float


def _view(across: NDArray[np.float64], up: NDArray[np.float64]) -> _View:
    ends = np.array([[f(across), f(up)] for f in (np.nanmin, np.nanmax)])
    half = 0.5 * float(np.ptp(ends, axis=0).max())
    return _View(ends.mean(axis=0), half or 0.05 * float(np.abs(ends).max()) or 1.0)


def _draw_around(
    data: xr.Dataset, ax: Axes, factor: float, view: _View, centre: NDArray[np.float64], is_whole: bool
) -> bool:
    """Draw what is around an orbit, and bring into view what is near it; return whether the centre is.

    `centre` is that of the shaft without loads. All of the clearance is in view where `is_whole`, or where it
    is not much larger than the orbit and near it.
    """
    reach = _MARGIN * view.half
    is_of_gap = (
        "clearance" in data and bool(stators_around(data)) and data["vertical"].attrs.get("units", "m") == "m"
    )
    gap, ring = float(data["clearance"].values) * factor if is_of_gap else 0.0, centre
    if "carrier_vertical" in data:
        ring = ring + _shifts(data).mean(axis=0) * factor
    if is_of_gap and bores_around(data):
        _, offsets, across, up = zip(*(p for p in stator_places(data) if p[0] is None), strict=True)
        gap, ring = gap + factor * max(offsets), ring + factor * np.array([np.mean(across), np.mean(up)])
    toward = view.middle - ring
    away = float(np.hypot(*toward))
    apart = abs(gap - away)  # of the circle from the middle of the orbit
    is_whole = is_whole or (gap < _WHOLE * reach and apart < _NEAR * reach)
    is_near = is_whole or (apart < _NEAR * reach and away > view.half)
    corners = [view.middle - reach, view.middle + reach]
    if is_near and gap > 0.0:
        draw_stators(data, ax, factor, max(reach, 0.8 * gap if is_whole else 0.4 * apart), centre)
        _draw_contact_points(data, ax, factor, centre)
        beyond = ring + (gap + 0.1 * apart) * toward / (away or 1.0)
        corners += [ring - _MARGIN * gap, ring + _MARGIN * gap] if is_whole else [beyond]
    off = view.middle - centre
    is_seen = is_whole or float(np.hypot(*off)) < _WHOLE * reach
    if is_seen and float(np.hypot(*off)) > _ASIDE * view.half:
        corners.append(centre - 0.1 * off)
        ax.plot(*centre, "+", color="0.4", markersize=6, markeredgewidth=0.8, label="centre without loads")
    for name, angle in data.attrs.get("probes", []):
        corners.append(_draw_probe(name, angle, ax, view))
    ax.dataLim.set_points(np.array([np.min(corners, axis=0), np.max(corners, axis=0)]))
    ax.margins(0.0)
    return is_seen


def _draw_contact_points(data: xr.Dataset, ax: Axes, factor: float, centre: NDArray[np.float64]) -> None:
    """Draw where the disc touches bores: the positions of its centre at which it touches there."""
    rims = (data[name].values for name in RIMS) if RIMS[0] in data else ((), ())
    for i, (up, across) in enumerate(zip(*rims, strict=True)):
        y, z = up * factor + centre[1], across * factor + centre[0]
        ax.plot(z, y, ".", color="C3", markersize=2, zorder=2, label="_contact" if i else "contact point")


def _draw_probe(name: str, angle: float, ax: Axes, view: _View) -> NDArray[np.float64]:
    """Draw a triangle with its name where a probe looks at the orbit; return how far these reach."""
    toward = np.array([math.sin(angle), math.cos(angle)])
    at = view.middle + 1.35 * view.half * toward
    marker = (3, 0, math.degrees(-angle) + 180.0)  # its tip points at the shaft
    ax.plot(*at, marker=marker, color="0.35", markersize=6, linestyle="none", zorder=4)
    ax.plot(*zip(view.middle, at, strict=True), color="0.85", linewidth=0.6, zorder=0)
    side = "left" if toward[0] < 0.0 else "right"  # towards the middle
    above: dict[str, Any] = {"textcoords": "offset points", "xytext": (0, 7), "ha": side, "va": "bottom"}
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8}  # over an orbit
    ax.annotate(name, tuple(at), fontsize=7, color="0.35", zorder=6, bbox=box, **above)
    return at + np.array([0.1 * toward[0], 0.35]) * view.half


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


def draw_stators(
    data: xr.Dataset, ax: Axes, factor: float, reach: float, centre: NDArray[np.float64] | None = None
) -> None:
    """Add the clearance circle about the `centre` and a stub of each stator; `reach` is that of the orbit.

    Stators on a carrier, which may move by more than the clearance, are drawn at its mean displacement, and
    so are bores, each a circle of its own.
    """
    from matplotlib.patches import Circle, Polygon

    clearance = float(data["clearance"].values) * factor
    edge = {"edgecolor": "0.6", "linestyle": ":", "linewidth": 0.7}
    places, is_moved = stator_places(data), "carrier_vertical" in data
    shifts = np.array([place[2:] for place in places]).reshape(-1, 2) * factor
    if centre is not None:
        shifts = shifts + centre
    if is_moved:
        shifts = shifts + _shifts(data) * factor
    stubs = [(i, angle, offset) for i, (angle, offset, *_) in enumerate(places) if angle is not None]
    if len(stubs) < len(places):
        wall: dict[str, Any] = {"edgecolor": "0.35", "linewidth": 0.9, "fill": False}
        for (angle, offset, *_), at in zip(places, shifts, strict=True):
            if angle is None:
                ax.add_patch(Circle((at[0], at[1]), clearance + offset * factor, **wall))
        ax.plot([], [], color="0.35", linewidth=0.9, label="bore, mean position" if is_moved else "bore")
        if not stubs:
            return
    middle = shifts[[i for i, *_ in stubs]].mean(axis=0) if stubs else np.zeros(2)
    ax.add_patch(Circle((middle[0], middle[1]), clearance, fill=False, zorder=1, **edge))
    ax.plot([], [], color="0.6", linestyle=":", label="clearance")
    half_angle = math.pi / max(len(stubs), 3)  # the stators of a ring do not overlap
    for k, (i, angle, offset) in enumerate(stubs):
        gap = clearance + offset * factor
        # Normal from the disc to the stator and tangent along its face; the plane is (horizontal, vertical).
        n, t = np.array([np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), -np.sin(angle)])
        half, deep = min(0.2 * reach, 0.8 * gap * math.tan(half_angle)) * t, 0.12 * reach * n
        face = np.array([gap * n - half, gap * n + half]) + shifts[i]
        block = Polygon([*face, *(face[::-1] + deep)], facecolor="0.85", edgecolor="none", zorder=1)
        name = "stator, mean position" if is_moved else "stator"
        block.set_label("_stator" if k else name)  # one of them is enough for a legend
        ax.add_patch(block)
        ax.plot(face[:, 0], face[:, 1], color="0.35", linewidth=0.9, zorder=2)


def _shifts(data: xr.Dataset) -> NDArray[np.float64]:
    """Mean displacement (n, 2), m, of what each stator around stands on: horizontal, vertical."""
    around = stators_around(data)
    return np.stack([data[f"carrier_{name}"].values[around] for name in ("horizontal", "vertical")], axis=1)
