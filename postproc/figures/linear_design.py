"""Figures of a linear design: Campbell diagram, unbalance response, and mode shapes at critical speeds."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.cells import degree_steps
from postproc.figures.drawing import Drawing
from postproc.figures.run_up_marks import RPM, Labels
from postproc.signals.orders import written_lag
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

MOST_SHAPES = 6
_ROOM = 0.12  # of the abscissa: that the name of a peak takes
_CIRCLE = 0.1  # of the square of an orbit's size: difference of those of its axes, below which it is a circle
_BAND: dict[str, Any] = {"color": "0.9", "zorder": 0, "linewidth": 0}
_MAJOR: dict[str, Any] = {"color": "0.7", "linewidth": 2.0}  # seen below those of a circle
_BEARING: dict[str, Any] = {"marker": "^", "markersize": 5, "color": "k", "markerfacecolor": "white"}
_PROBES: tuple[dict[str, Any], ...] = (
    {"color": "C0", "linestyle": "-"},
    {"color": "C1", "linestyle": (0, (4, 1.5))},
)
# Colour and dashes of each motion, distinct without colour as well.
STYLES: dict[str, dict[str, Any]] = {
    "forward": {"color": "C1", "linestyle": "-"},
    "backward": {"color": "C0", "linestyle": (0, (4, 4)), "zorder": 2.5},  # a forward mode shows between
    "mixed": {"color": "C4", "linestyle": (0, (6, 1.5))},
    "planar": {"color": "0.3", "linestyle": "-"},
    "torsional": {"color": "C2", "linestyle": (0, (4, 1.2, 1, 1.2))},
    "axial": {"color": "C3", "linestyle": (0, (1, 1.2))},
}
ORDERS = (1, 2)
_DIGIT, _LINE, _GAP = 3.8, 8.0, 3.0  # pt: width of a digit, height of a line, gap
_CRITICAL: dict[str, Any] = {
    "linestyle": "", "marker": "o", "markersize": 3, "color": "k", "markerfacecolor": "white", "zorder": 3,
}  # fmt: skip


def campbell_diagram(
    curves: xr.Dataset, ax: Axes, critical: Sequence[float] = (), limit: float | None = None
) -> Axes:
    """Draw the Campbell diagram: lateral modes by their whirl, torsional and axial ones, 1X and 2X.

    Parameters
    ----------
    curves : xarray.Dataset
        From `rubhpc.linear_design`.
    critical : sequence of float
        Critical speeds, rad/s, to be marked on the 1X line.
    limit : float, optional
        End of the ordinate, Hz; by default just above the highest curve.
    """
    rpm = RPM * curves["speed"].values
    # an overdamped mode and a rigid body's do not oscillate: their curves are broken
    oscillates = (abs(curves["damping_ratio"]) < 1.0) & (curves["frequency"] > 0.0)
    frequency = curves["frequency"].where(oscillates).values
    top = limit or 1.05 * float(np.nanmax(frequency))
    drawn = set()
    for i_mode, kind in enumerate(curves["kind"].values):
        words = [whirl if kind == "lateral" else kind for whirl in curves["whirl"].values[i_mode]]
        for word, part in _stretches(words):
            ax.plot(rpm[part], frequency[i_mode, part], **STYLES[word])
            at = frequency[i_mode, part]
            if np.any(np.minimum(at[:-1], at[1:]) < top):  # NaN, where it is overdamped, draws nothing
                drawn.add(word)
    ax.set(xlim=(rpm.min(), rpm.max()), ylim=(0, top))
    for order in ORDERS:
        _draw_order(ax, order)
    if critical:
        speeds = np.asarray(critical)
        ax.plot(RPM * speeds, speeds / (2 * math.pi), **_CRITICAL)
        _number(ax, speeds)
    ax.set(xlabel="Spin speed (rpm)", ylabel="Natural frequency (Hz)")
    ax.ticklabel_format(style="plain")
    ax.locator_params(axis="x", nbins=6)  # six digits of rpm take their room
    _legend(ax, [word for word in STYLES if word in drawn], bool(critical))
    return ax


def _stretches(words: list[str]) -> Iterator[tuple[str, slice]]:
    """Yield the parts of a curve that share a motion, each with the first point of the next.

    A lone planar point, such as that of equal modes at standstill, joins its right neighbour.
    """
    padded = ["", *words, "planar"]
    words = [
        right if word == "planar" and "planar" not in (left, right) else word
        for left, word, right in zip(padded, words, padded[2:], strict=False)
    ]
    starts = [0, *(i for i in range(1, len(words)) if words[i] != words[i - 1]), len(words)]
    for start, end in pairwise(starts):
        yield words[start], slice(start, end + 1)


def _number(ax: Axes, speeds: NDArray[np.float64]) -> None:
    """Write each critical speed, rpm, by its marker; those whose numbers would meet share a line."""
    left, right = ax.get_xlim()
    box = ax.get_window_extent()
    per_rpm, per_hertz = (  # points
        72.0 / ax.figure.dpi * size / span
        for size, span in ((box.width, right - left), (box.height, np.ptp(ax.get_ylim())))
    )
    lines: list[list[float]] = []
    for rpm in sorted(RPM * speeds):
        if not left <= rpm <= right:
            continue
        last = lines[-1] if lines else [-math.inf]
        is_beside = (rpm - last[-1]) * per_rpm < _DIGIT * len(_line(last)) + _GAP
        is_level = (rpm - last[-1]) / 60 * per_hertz < _LINE
        if is_beside and is_level:
            last.append(rpm)
        else:
            lines.append([rpm])
    curves = (np.asarray(curve.get_xydata(), dtype=float).T for curve in ax.lines)
    labels = Labels(ax, [(x, y) for x, y in curves if np.isfinite(x + y).any()])
    for line in lines:
        labels.write(_line(line), np.array([line[-1], line[-1] / 60]), np.array([1.0, -1.0]))


def _line(speeds: list[float]) -> str:
    return ", ".join(dict.fromkeys(f"{rpm:.0f}" for rpm in speeds))


def _draw_order(ax: Axes, order: int) -> None:
    """Add the line of `order` times the spin frequency, named where it leaves the axes."""
    right, top = ax.get_xlim()[1], ax.get_ylim()[1]
    end = min(right, 60 * top / order)
    height = order * end / 60
    ax.plot([0.0, end], [0.0, height], color="0.5", linewidth=0.5, zorder=1, scalex=False, scaley=False)
    side: dict[str, Any] = {"xytext": (2, 0), "ha": "left", "va": "center"}
    if end < right:
        side = {"xytext": (0, 2), "ha": "center", "va": "bottom"}
    ax.annotate(f"{order}X", (end, height), textcoords="offset points", color="0.35", **side)


def _legend(ax: Axes, words: list[str], has_critical: bool) -> None:
    from matplotlib.lines import Line2D

    styles = {word.capitalize(): STYLES[word] for word in words}
    if has_critical:
        styles["Critical (1X)"] = _CRITICAL
    handles = [Line2D([], [], label=label, **style) for label, style in styles.items()]
    # below the abscissa's label: no place among the curves is sure to be free
    ax.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
        ncols=4 if len(handles) <= 4 else 3,
        columnspacing=1.2,
        frameon=False,
    )


def unbalance_response(design: xr.Dataset, node: int) -> Drawing:
    """Return the Bode diagram of a node from `rubhpc.linear_design`, of two panels.

    Above, the major semi-axis of the orbit and the amplitudes at the probes, peaks with their speed and
    amplification factor, and the operating range as a band; below, the phase lag, which grows downwards as in
    `postproc.figures.bode` and as API RP 684 and machinery diagnostics draw it.
    """
    if node not in design["node"].values:
        raise InputError(
            f"node: {node} is not in the response; choose one of {_listed(design['node'].values)}"
        )
    shown = design[["major_axis", "minor_axis", "amplitude", "phase"]].sel(node=node)
    shown = shown.drop_vars("position", errors="ignore")
    peaks = design.isel(peak=np.flatnonzero(design["peak_node"].values == node))

    def draw(axes: list[Axes]) -> list[Axes]:
        amplitude, phase = axes
        rpm = RPM * shown["response_speed"].values
        if "operating" in design.attrs:
            ends = RPM * np.array(design.attrs["operating"])
            amplitude.axvspan(*ends, **_BAND, label="operating speeds")
            phase.axvspan(*ends, **_BAND)
        amplitude.plot(rpm, 1e6 * shown["major_axis"].values, label="major semi-axis", **_MAJOR)
        lags: list[np.ndarray[Any, Any]] = []
        for i, angle in enumerate(shown["probe"].values):
            style = _PROBES[i % len(_PROBES)]
            label = f"probe at {math.degrees(angle):.3g}\N{DEGREE SIGN}"
            seen = shown.sel(probe=angle)
            amplitude.plot(rpm, 1e6 * seen["amplitude"].values, label=label, **style)
            lags.append(written_lag(seen["phase"].values, rpm, (rpm, lags[-1]) if lags else None))
            phase.plot(rpm, lags[-1], **style)
        highest = 1e6 * float(shown["major_axis"].max()) or 1.0
        amplitude.set(ylabel="Amplitude (\N{MICRO SIGN}m)", ylim=(0, 1.25 * highest), xlim=(rpm[0], rpm[-1]))
        _name_peaks(amplitude, peaks)
        amplitude.legend(loc="best", fontsize=6)
        phase.set(xlabel="Spin speed (rpm)", ylabel="Phase lag (\N{DEGREE SIGN})")
        phase.invert_yaxis()
        phase.yaxis.set_major_locator(degree_steps(phase))
        phase.ticklabel_format(axis="x", style="plain")
        phase.locator_params(axis="x", nbins=6)  # five digits of rpm take their room
        return axes

    return Drawing(shown=shown, draw=draw, panels=(2, 1), height=90)


def mode_shapes(design: xr.Dataset) -> Drawing:
    """Return the mode shapes at the critical speeds of a linear design, the lowest six, along the shaft.

    Each is drawn at the instant of its greatest displacement, which is 1, with the size of its orbits around;
    triangles are bearings and seals.
    """
    n_critical = min(design.sizes["critical"], MOST_SHAPES)
    if not n_critical:
        low, high = (RPM * speed for speed in design.attrs["speed_range"])
        raise InputError(f"shapes: no critical speed from {low:.6g} to {high:.6g} rpm; widen the range")
    names = [name for name in design.data_vars if str(name).startswith(("critical_", "shape_"))]
    shown = design[[*names, "is_excited"]].isel(critical=slice(n_critical))

    def draw(axes: list[Axes]) -> list[Axes]:
        place, label = _along(design)
        bearings = place[np.isin(design["node"].values, design.attrs["bearing_nodes"])]
        for i, ax in enumerate(axes):
            _draw_shape(ax, place, shown.isel(critical=i))
            ax.plot(
                bearings, np.zeros(bearings.size), linestyle="", label="bearing", clip_on=False, **_BEARING
            )
            ax.set(ylim=(-1.15, 1.15), ylabel="Shape")
        axes[-1].legend(loc="upper center", bbox_to_anchor=(0.5, -0.28), ncols=4, fontsize=6, frameon=False)
        axes[-1].set(xlabel=label, xlim=(place.min(), place.max()))
        return axes

    return Drawing(shown=shown, draw=draw, panels=(n_critical, 1), height=18 + 27 * n_critical)


def _draw_shape(ax: Axes, place: np.ndarray[Any, Any], one: xr.Dataset) -> None:
    v, w = (
        one[f"shape_{direction}"].sel(part="real").values
        + 1j * one[f"shape_{direction}"].sel(part="imaginary").values
        for direction in ("vertical", "horizontal")
    )
    size = (np.abs(v + 1j * w) + np.abs(v - 1j * w)) / 2
    largest = int(size.argmax())
    # when the largest orbit is on its major axis; on a circle, which has none, when it is vertical
    major = v[largest] ** 2 + w[largest] ** 2
    is_circle = abs(major) < _CIRCLE * size[largest] ** 2
    turn = np.exp(-1j * (np.angle(v[largest]) if is_circle else np.angle(major) / 2)) / (size[largest] or 1.0)
    v, w, size = np.real(v * turn), np.real(w * turn), size / (size[largest] or 1.0)
    ax.fill_between(place, -size, size, **_BAND, label="orbit")
    ax.axhline(0.0, color="0.6", linewidth=0.4)
    ax.plot(place, v, marker=".", label="vertical", **_PROBES[0])
    ax.plot(place, w, marker=".", label="horizontal", **_PROBES[1])
    rpm = RPM * float(one["critical_speed"])
    excited = "" if bool(one["is_excited"]) else ", not excited"
    ax.set_title(f"{rpm:.0f} rpm, {one['critical_whirl'].item()}{excited}", fontsize=6, pad=2)


def _name_peaks(ax: Axes, peaks: xr.Dataset) -> None:
    """Write speed (rpm) and amplification factor at each peak, from the highest, where there is room."""
    taken: list[float] = []
    for i in np.argsort(-peaks["peak_amplitude"].values):
        peak = peaks.isel(peak=i)
        rpm = RPM * float(peak["peak_speed"])
        if any(abs(rpm - other) < _ROOM * ax.get_xlim()[1] for other in taken):
            continue
        taken.append(rpm)
        factor = float(peak["amplification_factor"])
        words = f"{rpm:.0f}" + (f"\nAF {factor:.3g}" if math.isfinite(factor) else "")
        at = rpm, 1e6 * float(peak["peak_amplitude"])
        ax.annotate(
            words, at, xytext=(0, 2), textcoords="offset points", ha="center", va="bottom", fontsize=6
        )


def _along(design: xr.Dataset) -> tuple[np.ndarray[Any, Any], str]:
    """Abscissa of the nodes and its label: positions, or numbers where a rotor of matrices has none."""
    positions = design["position"].values
    if np.isfinite(positions).all():
        return positions, "Position along the shaft (m)"
    return design["node"].values, "Node"


def _listed(nodes: np.ndarray[Any, Any]) -> str:
    return ", ".join(str(node) for node in nodes[:12]) + (", ..." if len(nodes) > 12 else "")
