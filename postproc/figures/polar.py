"""The polar plot: amplitude and phase lag of an order as a vector that the speed leads along a curve."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.bode import signal_name, written_order
from postproc.figures.drawing import Drawing
from postproc.figures.run_up_marks import critical_speeds, draw_rotation, name_speeds, written_speeds
from postproc.figures.small_multiples import overlaid
from postproc.signals.orders import order_over_speed
from postproc.signals.spectra import default_signal
from postproc.store.run_ups import is_run_up
from postproc.store.variables import probe_of, probes_of, require_results
from rubhpc.errors import InputError
from rubhpc.schema import PROBE
from rubhpc.units import scale_for

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Axis, Positive

_LAGS = range(0, 360, 30)  # degrees


def polar(
    cases: xr.Dataset, signal: str | None = None, *, order: Positive = 1.0, over: Axis | None = None
) -> Drawing:
    """Polar plot: amplitude and phase lag of an order over the speed.

    Of a run-up by revolution, or of the cases of a study along its speeds. Lag 0 lies where the probe looks
    from, and the lag grows against the rotation.

    Parameters
    ----------
    cases
        All axes but the speed and `over` are of one value, or selected.
    signal
        A displacement or a probe [default: vertical].
    order
        Multiple of the spin speed; 1 is 1X.
    """
    signal = signal or default_signal(cases, "vertical")
    shown = order_over_speed(cases, (signal,), order, over)
    require_results(shown[f"amplitude_{signal}"], cases)
    if not shown[f"phase_{signal}"].notnull().any():
        problem = f"{written_order(order)} is none, or lost in other motion, and has no phase"
        raise InputError(f"{signal}: {problem}; draw its amplitude with rubhpc bode")
    critical = critical_speeds(cases, shown["speed"])
    angle = _seen_from(cases, signal)
    return Drawing(
        shown=shown,
        draw=lambda axes: draw_polar(shown, signal, axes[0], order, angle, critical),
        height=95,
    )


def draw_polar(
    data: xr.Dataset,
    signal: str,
    ax: Axes,
    order: float = 1.0,
    angle: float = 0.0,
    critical: list[float] | None = None,
) -> Axes:
    """Draw the polar plot of a signal seen from an `angle` (rad, from straight up in the sense of spin)."""
    along = "revolution" if is_run_up(data) else "speed"
    amplitude, phase, speeds = data[f"amplitude_{signal}"], data[f"phase_{signal}"], data["speed"]
    scale = scale_for(str(amplitude.attrs.get("units", "1")), float(np.nanmax(amplitude.values)))
    reach = 1.12 * float(np.nanmax(amplitude.values)) * scale.factor or 1.0
    _draw_grid(ax, reach, angle, _emptiest(amplitude.values, phase.values))
    curves, n_curve = [], 0
    for case, height, lead, own in overlaid(along, amplitude, phase, speeds):
        # Drawn as seen from the drive end: clockwise is the sense of spin, and a lead turns with it.
        turned = angle + lead.values
        x, y = (
            height.values * scale.factor * np.sin(turned),
            height.values * scale.factor * np.cos(turned),
        )
        ax.plot(x, y, label=case, linewidth=0.9)
        n_curve += 1
        if np.isfinite(x).any():
            curves.append((x, y, own.values))
    curves_by_reach = sorted(curves, key=lambda curve: -float(np.nanmax(np.hypot(curve[0], curve[1]))))
    name_speeds(ax, [(x, y) for x, y, _ in curves_by_reach], curves_by_reach[0][2])
    style: dict[str, Any] = {"marker": "D", "markersize": 4, "linestyle": "", "color": "k"}
    passed: set[float] = set()
    for x, y, at in curves:
        for speed in critical or []:
            if np.nanmin(at) <= speed <= np.nanmax(at):
                i = int(np.nanargmin(np.abs(at - speed)))
                if np.isfinite(x[i]):
                    ax.plot(x[i], y[i], markerfacecolor="white", **style)
                    passed.add(speed)
    if passed:
        ax.plot([], [], label=written_speeds(passed), markerfacecolor="white", **style)
    if n_curve > 1 or passed:
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.01), ncols=2, frameon=False, fontsize=6)
    draw_rotation(ax)
    ax.set_title(
        scale.label(f"{signal_name(amplitude)}, {written_order(order)}, 0\N{EN DASH}peak"), fontsize=8
    )
    return ax


def _seen_from(cases: xr.Dataset, signal: str) -> float:
    """Angle from which a signal is seen, rad, from straight up in the sense of spin; 0 of a twist."""
    if signal.startswith(PROBE) and signal.removeprefix(PROBE) in probes_of(cases):
        return float(probe_of(cases, signal).get("angle") or 0.0)
    return 0.5 * np.pi if signal == "horizontal" else 0.0


def _emptiest(amplitude: NDArray[np.float64], phase: NDArray[np.float64]) -> float:
    """Lag, degrees, between two rays where the curves keep nearest to the middle."""
    lag = np.degrees(-phase) % 360.0
    highest = [np.nanmax(np.where(lag // 30 == i, amplitude, 0.0)) for i in range(12)]
    return 30.0 * int(np.argmin(highest)) + 15.0


def _draw_grid(ax: Axes, reach: float, angle: float, free: float) -> None:
    """Circles of amplitude, named at the lag `free` (degrees), and rays of lag."""
    from matplotlib.ticker import MaxNLocator

    grid: dict[str, Any] = {"color": "0.8", "linewidth": 0.5, "zorder": 0}
    around = np.linspace(0.0, 2.0 * np.pi, 361)
    radii = [r for r in MaxNLocator(4).tick_values(0.0, reach) if 0.0 < r <= reach]
    for radius in (*radii, reach):
        ax.plot(radius * np.cos(around), radius * np.sin(around), **grid)
    for radius in radii:
        at = angle - np.radians(free)
        ax.text(
            radius * np.sin(at), radius * np.cos(at), f"{radius:g}", fontsize=6, color="0.35", ha="center"
        )
    for lag in _LAGS:
        at = angle - np.radians(lag)  # against the rotation, which is drawn clockwise
        x, y = np.sin(at), np.cos(at)
        ax.plot([0.0, reach * x], [0.0, reach * y], **grid)
        text = f"{lag}\N{DEGREE SIGN} lag" if lag == 0 else f"{lag}\N{DEGREE SIGN}"
        away = (1.14 if lag == 0 else 1.09) * reach  # clear of the probe's mark
        ax.text(away * x, away * y, text, ha="center", va="center", fontsize=6)
    ax.plot(1.0 * reach * np.sin(angle), 1.0 * reach * np.cos(angle), marker="s", color="0.3", markersize=4)
    ax.set(xlim=(-1.2 * reach, 1.2 * reach), ylim=(-1.2 * reach, 1.2 * reach), aspect="equal")
    ax.axis("off")
