"""Figures of a linear design: unbalance response over the speed, and mode shapes at critical speeds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.ticks import degree_steps
from postproc.signals.orders import written_lag
from rubhpc.errors import InputError

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

MOST_SHAPES = 6
_ROOM = 0.12  # of the abscissa: that the name of a peak takes
_CIRCLE = 0.1  # of the square of an orbit's size: difference of those of its axes, below which it is a circle
_RPM = 30 / math.pi
_BAND: dict[str, Any] = {"color": "0.9", "zorder": 0, "linewidth": 0}
_MAJOR: dict[str, Any] = {"color": "0.7", "linewidth": 2.0}  # seen below those of a circle
_BEARING: dict[str, Any] = {"marker": "^", "markersize": 5, "color": "k", "markerfacecolor": "white"}
_PROBES: tuple[dict[str, Any], ...] = (
    {"color": "C0", "linestyle": "-"},
    {"color": "C1", "linestyle": (0, (4, 1.5))},
)


def unbalance_response(design: xr.Dataset, node: int) -> Drawing:
    """Return the Bode diagram of a node: amplitude and phase of its unbalance response over the speed.

    Parameters
    ----------
    design : xarray.Dataset
        From `rubhpc.linear_design`.
    node : int

    Returns
    -------
    Drawing
        Of two panels. Above, the major semi-axis of the orbit and the amplitudes at the probes, peaks with
        their speed and amplification factor, and the operating range as a band; below, the phase lag, which
        grows downwards as in `postproc.figures.bode` and as API RP 684 and machinery diagnostics draw it.
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
        rpm = _RPM * shown["response_speed"].values
        if "operating" in design.attrs:
            ends = _RPM * np.array(design.attrs["operating"])
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
    """Return the mode shapes at the critical speeds, the lowest six, along the shaft.

    Each is drawn at the instant of its greatest displacement, which is 1, with the size of its orbits around;
    triangles are bearings and seals.

    Parameters
    ----------
    design : xarray.Dataset
        From `rubhpc.linear_design`.
    """
    n_critical = min(design.sizes["critical"], MOST_SHAPES)
    if not n_critical:
        low, high = (_RPM * speed for speed in design.attrs["speed_range"])
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
    rpm = _RPM * float(one["critical_speed"])
    excited = "" if bool(one["is_excited"]) else ", not excited"
    ax.set_title(f"{rpm:.0f} rpm, {one['critical_whirl'].item()}{excited}", fontsize=6, pad=2)


def _name_peaks(ax: Axes, peaks: xr.Dataset) -> None:
    """Write speed (rpm) and amplification factor at each peak, from the highest, where there is room."""
    taken: list[float] = []
    for i in np.argsort(-peaks["peak_amplitude"].values):
        peak = peaks.isel(peak=i)
        rpm = _RPM * float(peak["peak_speed"])
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
