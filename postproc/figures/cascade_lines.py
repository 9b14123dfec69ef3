"""Lines over a cascade: orders of the spin speed and natural frequencies, with their names."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.cells import is_geometric
from postproc.store.units import displayed, plain_number

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

ABSCISSA_LABELS = {"frequency": "Frequency (Hz)", "order": "Order (multiples of spin speed)"}
ORDERS = tuple(Fraction(*f) for f in ((1, 3), (1, 2), (2, 3), (1, 1), (3, 2), (2, 1), (3, 1)))
_CHARACTER = 0.018  # of the axes, for a letter of a name
_CORNER = 0.24  # of the ordinate, above which the bar that shows the size of spectra may be


def draw_orders(
    ax: Axes,
    spectra: xr.DataArray,
    orders: Sequence[Fraction] = ORDERS,
    abscissa: str = "frequency",
    color: str = "0.35",
    ground: str = "white",
) -> Axes:
    """Add the lines on which multiples of the spin speed lie, named at their upper ends.

    In full spectra each has its twin on the backward side. `ground` is the colour behind their names.
    """
    rows, rate = _to_the_top(*_rows_and_rate(spectra), ax.get_ylim()[1])
    left, right = ax.get_xlim()
    style: dict[str, Any] = {"color": color, "linewidth": 0.4, "linestyle": (0, (4, 3)), "zorder": 2.5}
    tagged: list[float] = []
    bottom, top = ax.get_ylim()
    highest = top - _CORNER * (top - bottom)
    # Whole multiples first, so that they keep their names where there is no room for all.
    signed = [*orders, *(-o for o in orders)] if left < 0 else list(orders)
    for order in sorted(signed, key=lambda o: (o.denominator, abs(o))):
        x = float(order) * (rate if abscissa == "frequency" else np.ones_like(rate))
        inside = np.flatnonzero((x >= left) & (x <= right))
        if inside.size < max(2, 0.08 * rows.size):
            continue  # it would cut a corner only
        ax.plot(x, rows, scalex=False, scaley=False, **style)
        if inside[-1] == rows.size - 1:
            if all(abs(x[-1] - t) > 0.07 * (right - left) for t in tagged):
                _tag(ax, float(x[-1]), float(rows[-1]), f"{order}X", color, ground, "center")
                tagged.append(float(x[-1]))
        else:
            at, side = (right, "right") if order > 0 else (left, "left")
            (x_in, x_out), (y_in, y_out) = (
                values[inside[-1] : inside[-1] + 2].tolist() for values in (x, rows)
            )
            y = y_in + (at - x_in) / (x_out - x_in) * (y_out - y_in)
            if y > highest:
                at, y = float(np.interp(highest, rows, x)), highest
            _tag(ax, at, y, f"{order}X", color, ground, side)
    return ax


def draw_frequencies(
    ax: Axes,
    spectra: xr.DataArray,
    frequencies: Mapping[str, xr.DataArray | float],
    abscissa: str = "frequency",
    color: str = "C1",
) -> Axes:
    """Add natural frequencies (Hz) as dashed, named lines; they may vary along the axis.

    In full spectra each has its twin, without a name, on the backward side.
    """
    rows, rate = _rows_and_rate(spectra)
    left, right = ax.get_xlim()
    ends = ax.get_ylim()
    style: dict[str, Any] = {"color": color, "linewidth": 0.7, "linestyle": "--", "zorder": 5}
    named: list[tuple[float, float]] = []  # ends of the names above the axes
    for name, frequency in frequencies.items():
        values = np.broadcast_to(np.asarray(frequency, dtype=float), rows.shape)
        x = values if abscissa == "frequency" else values / rate
        if not ((x >= left) & (x <= right)).any():
            continue
        y = np.concatenate((ends[:1], rows, ends[1:]))
        curve = np.concatenate((x[:1], x, x[-1:]))
        for twin in (curve, -curve) if left < 0 else (curve,):
            ax.plot(twin, y, scalex=False, scaley=False, **style)
        text: dict[str, Any] = {"textcoords": "offset points", "fontsize": 6.5, "color": color, "zorder": 6}
        if abscissa == "frequency":
            at = float(np.clip(x[-1], left + 0.1 * (right - left), right - 0.14 * (right - left)))
            label = f"{name} {plain_number(values[-1])} Hz"
            half = 0.5 * _CHARACTER * len(label) * (right - left)
            level = sum(at - half < end and at + half > start for start, end in named)  # the next line up
            named.append((at - half, at + half))
            text |= {"xytext": (0, 2 + 8 * level), "ha": "center", "va": "bottom", "annotation_clip": False}
            ax.annotate(label, (at, 1.0), xycoords=("data", "axes fraction"), **text)
        else:  # over orders the curves meet at the top and part towards slow rotation
            side, shift = ("right", -2) if x[0] > left + 0.6 * (right - left) else ("left", 2)
            above = 10 if left < 0 else 1  # the senses of full spectra
            text |= {"xytext": (shift, above), "ha": side, "va": "bottom"}
            text["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.3, "alpha": 0.8}
            ax.annotate(f"{name} {plain_number(values[0])} Hz", (float(x[0]), ends[0]), **text)
    return ax


def name_senses(ax: Axes, color: str = "k", is_above: bool = False) -> None:
    """Say which side of full spectra whirls backward, at the lower or upper ends of the axes."""
    if ax.get_xlim()[0] < 0:
        y, place = (0.98, "top") if is_above else (0.02, "bottom")
        style: dict[str, Any] = {"va": place, "transform": ax.transAxes, "color": color, "zorder": 7}
        ax.text(0.02, y, "backward", ha="left", **style)
        ax.text(0.98, y, "forward", ha="right", **style)


def ordinate(spectra: xr.DataArray) -> tuple[NDArray[np.float64], str]:
    """Return the ordinates of the rows and the label; the logarithm of values that are spaced by a ratio."""
    rows, label = displayed(spectra[spectra.dims[0]])
    return np.log10(rows) if is_geometric(np.sort(rows)) else rows, label


def _rows_and_rate(spectra: xr.DataArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the displayed ordinates, ascending, and the spin rate (Hz) at each."""
    rows, _ = ordinate(spectra)
    ascending = np.argsort(rows)
    rate = np.broadcast_to(spectra["spin_speed"].values, rows.shape) / (2 * math.pi)
    return rows[ascending], rate[ascending]


def _to_the_top(
    rows: NDArray[np.float64], rate: NDArray[np.float64], top: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ordinates and spin rates with one more at the top of the axes, beyond the spectra, for names.

    The rate goes on as between the last two rows, or as it is where it falls there: the lines would meet.
    """
    if rows.size < 2 or not top > rows[-1]:
        return rows, rate
    slope = max(0.0, (rate[-1] - rate[-2]) / (rows[-1] - rows[-2]))
    return np.append(rows, top), np.append(rate, rate[-1] + slope * (top - rows[-1]))


def _tag(ax: Axes, x: float, y: float, text: str, color: str, ground: str, ha: str) -> None:
    from matplotlib.patheffects import withStroke

    bottom, top = ax.get_ylim()
    has_room = top - y > 0.05 * (top - bottom)
    ax.annotate(
        text,
        (x, y),
        xytext=({"left": 2, "right": -1}.get(ha, 0 if has_room else -1), 1 if has_room else -1),
        textcoords="offset points",
        ha=ha if has_room or ha == "left" else "right",
        va="bottom" if has_room else "top",
        fontsize=6,
        color=color,
        zorder=6,
        clip_on=True,
        path_effects=[withStroke(linewidth=2.0, foreground=ground)],  # readable over lines and spectra
    )
