"""The waterfall of a run-up: spectra at one speed after the other, or their amplitudes as colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.run_up_marks import RPM, falling
from postproc.signals.run_up_spectra import run_up_spectra
from postproc.store.units import scale_of, short_name

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Count, Positive

    Floats = NDArray[np.float64]

_HEIGHT = 0.3  # of the ordinate, that the highest line takes
_DECADES = 3.0
_ROWS = 200  # of a spectrogram
_LINES = (0.5, 1.0, 2.0, 3.0)  # orders that are drawn


def waterfall(
    cases: xr.Dataset,
    signal: str = "vertical",
    *,
    form: Literal["waterfall", "spectrogram"] = "waterfall",
    window: Count = 32,
    count: Count = 40,
    max_order: Positive = 4.0,
    orders: bool = False,
) -> Drawing:
    """Waterfall, or spectrogram, of a run-up: spectra over the speed.

    Each spectrum is of a few revolutions, seen through Hann's window. Where the speed rises and falls, they
    are drawn over the revolutions.

    Parameters
    ----------
    cases
        One case of a study with [run_up].
    signal
        Which recorded signal.
    form
        Spectra above one another, or colours.
    window
        Revolutions in a spectrum; at most half of the run-up.
    count
        How many spectra a waterfall has.
    max_order
        End of the orders drawn, at the highest speed.
    orders
        Draw over orders instead of Hz.
    """
    is_map = form == "spectrogram"
    shown = run_up_spectra(cases, signal, window, _ROWS if is_map else count)
    draw = draw_spectrogram if is_map else draw_waterfall
    return Drawing(shown=shown, draw=lambda axes: draw(shown, signal, axes[0], max_order, orders), height=90)


def draw_waterfall(
    data: xr.Dataset, signal: str, ax: Axes, max_order: float = 4.0, orders: bool = False
) -> Axes:
    """Draw spectra above one another, each at its speed."""
    amplitude = data["amplitude"].values
    rpm = RPM * data["speed"].values
    at, label = _places(data, rpm)
    span = float(np.ptp(at)) or 1.0
    top = float(amplitude.max()) or 1.0
    max_order = min(max_order, float(data["order"].values[-1]))
    end = max_order if orders else max_order * float(rpm.max()) / 60.0
    for i in np.argsort(-at, kind="stable"):
        x = data["order"].values if orders else data["frequency"].values[i]
        inside = x <= end
        height = at[i] + _HEIGHT * span * amplitude[i, inside] / top
        depth = 1.0 - 1e-3 * at[i] / at.max()
        ax.fill_between(x[inside], at[i], height, color="white", linewidth=0.0, zorder=depth)
        ax.plot(x[inside], height, color="C0", linewidth=0.6, zorder=depth)
    ax.set(xlim=(0.0, end), ylim=(at.min(), at.max() + 1.05 * _HEIGHT * span))
    _draw_orders(ax, orders, end, None if at is rpm else (rpm, at))
    scale = scale_of(data["amplitude"])
    _bar(ax, _HEIGHT * span, scale.label(f"{top * scale.factor:.3g}").replace("(", "").replace(")", ""))
    ax.set(xlabel=_abscissa(orders), ylabel=label)
    ax.ticklabel_format(axis="y", style="plain", useOffset=False)
    ax.set_title(f"{short_name(data['amplitude'].rename(signal))}, 0\N{EN DASH}peak", fontsize=8, pad=12)
    return ax


def draw_spectrogram(
    data: xr.Dataset, signal: str, ax: Axes, max_order: float = 4.0, orders: bool = False
) -> Axes:
    """Draw amplitudes as colours over speed and frequency."""
    from matplotlib.colors import LogNorm

    at, label = _places(data, RPM * data["speed"].values)
    rising = np.argsort(at, kind="stable")
    at, rpm = at[rising], RPM * data["speed"].values[rising]
    scale = scale_of(data["amplitude"])
    amplitude = data["amplitude"].values[rising] * scale.factor
    max_order = min(max_order, float(data["order"].values[-1]))
    end = max_order if orders else max_order * float(rpm.max()) / 60.0
    order = data["order"].values
    half = 0.5 * (order[1] - order[0])
    edges = np.append(order - half, order[-1] + half)
    heights = np.broadcast_to(edges, (rpm.size, edges.size))
    if not orders:
        heights = heights * rpm[:, np.newaxis] / 60.0
    top = float(amplitude.max()) or 1.0
    # A column for every spectrum, between the midpoints of the speeds.
    middle = 0.5 * (at[1:] + at[:-1]) if at.size > 1 else np.zeros(0)
    bounds = np.concatenate([at[:1], middle, at[-1:]])
    mesh: Any = None
    for i in range(rpm.size):
        mesh = ax.pcolormesh(
            bounds[i : i + 2],
            heights[i],
            np.maximum(amplitude[i], top * 10.0**-_DECADES)[:, np.newaxis],
            norm=LogNorm(top * 10.0**-_DECADES, top),
            cmap="viridis",
            rasterized=True,
        )
    ax.set(xlim=(at.min(), at.max()), ylim=(0.0, end))
    for line in _LINES:
        if line < max_order:
            height = np.full(rpm.size, line) if orders else line * rpm / 60.0
            ax.plot(at, height, color="white", linewidth=0.4, linestyle=(0, (4, 4)))
            if height[-1] < end:
                style: dict[str, Any] = {"xytext": (2, 0), "ha": "left", "va": "center", "fontsize": 6}
                ax.annotate(_named(line), (at[-1], height[-1]), textcoords="offset points", **style)
    name = f"{short_name(data['amplitude'].rename(signal))}, 0\N{EN DASH}peak"
    ax.figure.colorbar(mesh, ax=ax, label=scale.label(name), pad=0.06)
    ax.set(xlabel=label, ylabel=_abscissa(orders))
    ax.ticklabel_format(axis="x", style="plain", useOffset=False)
    return ax


def _places(data: xr.Dataset, rpm: Floats) -> tuple[Floats, str]:
    """Where spectra are drawn: at their speeds, `rpm` itself, or where these rise and fall at revolutions."""
    if not falling(rpm).any():
        return rpm, "Spin speed (rpm)"
    return data["revolution"].values, f"Revolution, {rpm.min():.0f} to {rpm.max():.0f} rpm"


def _draw_orders(ax: Axes, orders: bool, end: float, turns: tuple[Floats, Floats] | None = None) -> None:
    """Lines of the orders, named at their upper ends; `turns`: speeds (rpm) and places, if not the speeds."""
    low, high = ax.get_ylim()
    style: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": 6}
    for line in _LINES:
        ends = np.array([line, line]) if orders else line * np.array([low, high]) / 60.0
        if turns is not None and not orders:
            x = line * turns[0] / 60.0
            ax.plot(x, turns[1], color="0.5", linewidth=0.5, linestyle=(0, (4, 4)), zorder=0.5)
            near = int(np.argmax(turns[1]))
            place = (x[near], turns[1][near])
            if place[0] <= end:
                ax.annotate(_named(line), place, xytext=(0, 1), textcoords="offset points", **style)
        elif ends[1] <= end:
            ax.plot(ends, [low, high], color="0.5", linewidth=0.5, linestyle=(0, (4, 4)), zorder=0.5)
            place = (ends[1], high)
            ax.annotate(_named(line), place, xytext=(0, 1), textcoords="offset points", **style)


def _bar(ax: Axes, height: float, text: str) -> None:
    """A bar as high as the highest line, with its amplitude."""
    low, high = ax.get_xlim()
    x, bottom = high - 0.04 * (high - low), ax.get_ylim()[1] - 1.08 * height
    ax.plot([x, x], [bottom, bottom + height], color="k", linewidth=1.2, zorder=5)
    ax.text(
        x - 0.01 * (high - low), bottom + 0.5 * height, text, ha="right", va="center", fontsize=6, zorder=5
    )


def _abscissa(orders: bool) -> str:
    return "Order (multiples of spin speed)" if orders else "Frequency (Hz)"


def _named(order: float) -> str:
    return "1/2X" if order == 0.5 else f"{order:.0f}X"
