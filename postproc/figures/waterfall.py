"""The waterfall of a run-up: spectra at one speed after the other, or their amplitudes as colours."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from postproc.figures.cascade_lines import ABSCISSA_LABELS, name_senses
from postproc.figures.drawing import Drawing
from postproc.figures.options import above_zero
from postproc.figures.run_up_marks import RPM, falling
from postproc.signals.places import signal_or_whirl
from postproc.signals.run_ups import run_up_spectra
from postproc.store.units import plain_number, scale_of, short_name

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Count, Hertz

    Floats = NDArray[np.float64]

_HEIGHT = 0.3  # of the ordinate, that the highest line takes
_DECADES = 3.0
_ROWS = 200  # of a spectrogram
_MOST_ORDER = 4.0  # at the highest speed, where the abscissa ends by default
_APART = 0.07  # of the abscissa, between the names of two orders
_LINES = (0.5, 1.0, 2.0, 3.0)  # orders that are drawn


def waterfall(
    cases: xr.Dataset,
    signal: str | None = None,
    *,
    full: bool = False,
    probes: tuple[str, str] | None = None,
    node: Count | None = None,
    stator: Count | None = None,
    form: Literal["waterfall", "spectrogram"] = "waterfall",
    window: Count = 32,
    count: Count = 40,
    max: Hertz | None = None,  # noqa: A002 - the word of the command
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
        Which recorded signal [default: vertical].
    full
        Forward and backward whirl of the orbit instead of a signal.
    probes
        Names of two probes at one place, whose orbit is taken in place of the disc's.
    node
        Node of the rotor whose orbit is taken: the recorded one, or one with two probes.
    stator
        Number of a stator, at whose node the orbit is taken.
    form
        Spectra above one another, or colours.
    window
        Revolutions in a spectrum; at most half of the run-up.
    count
        How many spectra a waterfall has.
    max
        End of the abscissa, Hz, or a number of orders with `orders` [default: order 4 at the highest speed].
    orders
        Draw over orders instead of Hz.
    """
    is_map = form == "spectrogram"
    limit = above_zero(max, "" if orders else "Hz", "--max")
    cases, name = signal_or_whirl(cases, signal, "vertical", full, probes, node, stator)
    shown = run_up_spectra(cases, name, window, _ROWS if is_map else count)
    draw = draw_spectrogram if is_map else draw_waterfall
    return Drawing(shown=shown, draw=lambda axes: draw(shown, name, axes[0], limit, orders), height=90)


def draw_waterfall(
    data: xr.Dataset, signal: str, ax: Axes, limit: float | None = None, orders: bool = False
) -> Axes:
    """Draw spectra above one another, each at its speed; `limit` is the end of the abscissa, Hz or orders."""
    amplitude = data["amplitude"].values
    rpm = RPM * data["speed"].values
    at, label = _places(data, rpm)
    span = float(np.ptp(at)) or 1.0
    top = float(amplitude.max()) or 1.0
    end = _end(data, limit, orders)
    start = -end if _is_full(data) else 0.0
    for i in np.argsort(-at, kind="stable"):
        x = data["order"].values if orders else data["frequency"].values[i]
        inside = (x >= start) & (x <= end)
        height = at[i] + _HEIGHT * span * amplitude[i, inside] / top
        depth = 1.0 - 1e-3 * at[i] / at.max()
        ax.fill_between(x[inside], at[i], height, color="white", linewidth=0.0, zorder=depth)
        ax.plot(x[inside], height, color="C0", linewidth=0.6, zorder=depth)
    below = 0.1 * span if start else 0.0  # room for the senses of whirl
    ax.set(xlim=(start, end), ylim=(at.min() - below, at.max() + 1.05 * _HEIGHT * span))
    _draw_orders(ax, orders, None if at is rpm else (rpm, at))
    scale = scale_of(data["amplitude"])
    _bar(ax, _HEIGHT * span, f"{plain_number(top * scale.factor, 3)} {scale.unit}")
    ax.set(xlabel=ABSCISSA_LABELS["order" if orders else "frequency"], ylabel=label)
    ax.ticklabel_format(axis="y", style="plain", useOffset=False)
    ax.set_title(_title(data, signal), fontsize=8, pad=12)
    name_senses(ax)
    return ax


def draw_spectrogram(
    data: xr.Dataset, signal: str, ax: Axes, limit: float | None = None, orders: bool = False
) -> Axes:
    """Draw amplitudes as colours over speed and frequency."""
    from matplotlib.colors import LogNorm

    at, label = _places(data, RPM * data["speed"].values)
    rising = np.argsort(at, kind="stable")
    at, rpm = at[rising], RPM * data["speed"].values[rising]
    scale = scale_of(data["amplitude"])
    amplitude = data["amplitude"].values[rising] * scale.factor
    end = _end(data, limit, orders)
    start = -end if _is_full(data) else 0.0
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
    ax.set(xlim=(at.min(), at.max()), ylim=(start, end))
    for line in _orders_within(start):
        height = np.full(rpm.size, line) if orders else line * rpm / 60.0
        ax.plot(at, height, color="white", linewidth=0.4, linestyle=(0, (4, 4)))
        if start < height[-1] < end:
            style: dict[str, Any] = {"xytext": (2, 0), "ha": "left", "va": "center", "fontsize": 6}
            ax.annotate(_named(line), (at[-1], height[-1]), textcoords="offset points", **style)
    ax.figure.colorbar(mesh, ax=ax, label=scale.label(_title(data, signal)), pad=0.08 if start else 0.06)
    ax.set(xlabel=label, ylabel=ABSCISSA_LABELS["order" if orders else "frequency"])
    if start:
        for y, side, place in ((0.02, "backward", "bottom"), (0.98, "forward", "top")):
            ax.text(0.02, y, side, color="white", va=place, transform=ax.transAxes)
    ax.ticklabel_format(axis="x", style="plain", useOffset=False)
    return ax


def _end(data: xr.Dataset, limit: float | None, orders: bool) -> float:
    """End of the abscissa, Hz or orders, no farther than the lines of the fastest spectrum."""
    unit = 1.0 if orders else float(data["speed"].max()) * RPM / 60.0
    return min(_MOST_ORDER * unit if limit is None else limit, float(data["order"].values[-1]) * unit)


def _is_full(data: xr.Dataset) -> bool:
    return bool(data["order"].values[0] < 0.0)


def _title(data: xr.Dataset, signal: str) -> str:
    name = short_name(data["amplitude"].rename(signal))
    return f"{name} amplitude" if _is_full(data) else f"{name}, 0\N{EN DASH}peak"


def _orders_within(start: float) -> list[float]:
    """Orders that are drawn, backward ones too where the abscissa has them."""
    return [*(-line for line in _LINES if start), *_LINES]


def _places(data: xr.Dataset, rpm: Floats) -> tuple[Floats, str]:
    """Where spectra are drawn: at their speeds, `rpm` itself, or where these rise and fall at revolutions."""
    if not falling(rpm).any():
        return rpm, "Spin speed (rpm)"
    return data["revolution"].values, f"Revolution, {rpm.min():.0f} to {rpm.max():.0f} rpm"


def _draw_orders(ax: Axes, orders: bool, turns: tuple[Floats, Floats] | None = None) -> None:
    """Lines of the orders, named at their upper ends; `turns`: speeds (rpm) and places, if not the speeds."""
    low, high = ax.get_ylim()
    start, end = ax.get_xlim()
    named: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": 6}
    style: dict[str, Any] = {"color": "0.5", "linewidth": 0.5, "linestyle": (0, (4, 4)), "zorder": 0.5}
    rpm, places = (np.array([low, high]),) * 2 if turns is None else turns
    taken: list[float] = []
    for line in sorted(_orders_within(start), key=lambda order: (order % 1.0, abs(order))):
        x = np.full(rpm.size, line) if orders else line * rpm / 60.0
        ax.plot(x, places, scalex=False, scaley=False, **style)
        last = int(np.argmax(places))
        if start <= x[last] <= end and all(abs(x[last] - at) > _APART * (end - start) for at in taken):
            taken.append(float(x[last]))
            place = (x[last], places[last])
            ax.annotate(_named(line), place, xytext=(0, 1), textcoords="offset points", **named)


def _bar(ax: Axes, height: float, text: str) -> None:
    """A bar as high as the highest line, with its amplitude."""
    low, high = ax.get_xlim()
    x, bottom = high - 0.04 * (high - low), ax.get_ylim()[1] - 1.08 * height
    ax.plot([x, x], [bottom, bottom + height], color="k", linewidth=1.2, zorder=5)
    ax.text(
        x - 0.01 * (high - low), bottom + 0.5 * height, text, ha="right", va="center", fontsize=6, zorder=5
    )


def _named(order: float) -> str:
    return f"{Fraction(order)}X".replace("-", "\N{MINUS SIGN}")
