"""The speed over the time: of run-ups, and of driven rotors with the torques that drive and brake them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.run_up_marks import RPM, critical_speeds
from postproc.figures.small_multiples import overlaid
from postproc.signals.run_ups import spin_over_time
from postproc.store.variables import require_results
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Axis


_LABEL = 0.35  # of the axis: width of a label
_NEAR = 0.07  # of the axis: critical speeds that share a label


def speed(cases: xr.Dataset, *, over: Axis | None = None) -> Drawing:
    """Spin speed over the time, with the torques of a driven rotor.

    Parameters
    ----------
    cases
        A study with [run_up] or [drive], all axes but `over` of one value, or selected.
    """
    shown = spin_over_time(cases, over)
    require_results(shown["speed"], cases)
    critical = critical_speeds(cases, shown["speed"])
    is_driven = "driving_torque" in shown

    def draw(axes: list[Axes]) -> None:
        draw_speed(shown, axes, critical)

    return Drawing(
        shown=shown, draw=draw, panels=(2, 1) if is_driven else (1, 1), height=90 if is_driven else 60
    )


def draw_speed(data: xr.Dataset, axes: list[Axes], critical: Sequence[float] = ()) -> None:
    """Draw the speed, with critical speeds (rad/s), and below it the torques, where there are any."""
    top, bottom = axes[0], axes[-1]
    curves = overlaid("revolution", data["speed"], data["time"])
    for name, speeds, time in curves:
        top.plot(time.values, RPM * speeds.values, label=name)
    top.set(ylabel="Spin speed (rpm)", xlim=(0.0, float(np.nanmax(data["time"].values))))
    top.ticklabel_format(axis="y", style="plain", useOffset=False)
    if len(curves) > 1:
        top.legend(loc="best", fontsize=6)
    _draw_critical(top, RPM * np.array(sorted(critical)))
    if "driving_torque" in data:
        _draw_torques(data, bottom)
    bottom.set_xlabel("Time (s)")
    top.figure.align_ylabels(axes)


def _draw_critical(ax: Axes, speeds: NDArray[np.float64]) -> None:
    """Draw critical speeds, rpm, over the curves; those too close together for a label each share one."""
    curves = np.concatenate([np.asarray(line.get_xydata()) for line in ax.lines])
    share = curves[:, 0] / ax.get_xlim()[1]
    at_left, at_right = (curves[there, 1] for there in (share < _LABEL, share > 1.0 - _LABEL))
    near = _NEAR * float(np.ptp(ax.get_ylim()))
    for value in speeds:
        ax.axhline(value, color="0.6", linewidth=0.6, linestyle=(0, (4, 3)), zorder=0.5)
    for group in np.split(speeds, np.flatnonzero(np.diff(speeds) > near) + 1) if speeds.size else []:
        from_left, from_right = (
            np.nanmin(abs(speed - group[-1]), initial=np.inf) for speed in (at_left, at_right)
        )
        is_left = bool(from_left > from_right)  # where the curves are far
        ax.annotate(
            f"critical, {', '.join(f'{value:.0f}' for value in group)} rpm",
            (0.0 if is_left else 1.0, group[-1]),
            xycoords=("axes fraction", "data"),
            xytext=(7 if is_left else -7, 1),
            textcoords="offset points",
            ha="left" if is_left else "right",
            va="bottom",
            fontsize=6,
            color="0.35",
        )


def _draw_torques(data: xr.Dataset, ax: Axes) -> None:
    """Draw what brakes the spin, and dashed what drives it."""
    from matplotlib.lines import Line2D

    drawn = [data[name] for name in ("driving_torque", "braking_torque", "time")]
    scale = scale_for("N m", max(float(np.nanmax(np.abs(torque.values))) for torque in drawn[:2]))
    for i, (_, drive, brake, time) in enumerate(overlaid("revolution", *drawn)):
        ax.plot(time, brake.values * scale.factor, color=f"C{i}", linewidth=0.8)
        ax.plot(time, drive.values * scale.factor, color=f"C{i}", linewidth=0.8, linestyle=(0, (4, 2)))
    ax.set_ylabel(scale.label("Torque"))
    ax.axhline(0.0, color="0.6", linewidth=0.6, zorder=0.5)
    black: dict[str, Any] = {"color": "k", "linewidth": 0.8}
    lines = [Line2D([], [], linestyle=(0, (4, 2)), **black), Line2D([], [], **black)]
    ax.legend(lines, ["drive", "rub and whirl"], loc="best", fontsize=6)
