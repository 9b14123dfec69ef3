"""The cascade as a figure: stacked spectra (waterfall) or an intensity picture, with orders and modes."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.cells import cell_edges, is_geometric
from postproc.signals.cascade import below, hold_peaks, hold_rows
from postproc.signals.lines import SPIKE, spikes
from postproc.store.units import displayed, scale_of, short_name
from postproc.store.variables import require_results

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

ORDERS = tuple(Fraction(*f) for f in ((1, 3), (1, 2), (2, 3), (1, 1), (3, 2), (2, 1), (3, 1)))
_ROWS = 60  # of a waterfall: more overlap at column width
_PIXELS = (800, 500)  # of an intensity picture at column width and 300 dpi
_CHARACTER = 0.018  # of the axes, for a letter of a name
_DECADES = 3.0
_NAMES = {"frequency": "Frequency (Hz)", "order": "Order (multiples of spin speed)"}


def waterfall(
    spectra: xr.DataArray, ax: Axes, limit: float, abscissa: str = "frequency", height: float = 0.22
) -> Axes:
    """Draw the spectra of a cascade above one another, each on the value of its axis.

    Parameters
    ----------
    spectra : (along, order)
        From `cascade`; only what is drawn is loaded.
    limit : float
        End of the abscissa, Hz or orders.
    abscissa : {"frequency", "order"}
    height : float
        Of the highest line, as a part of the ordinate.
    """
    spectra = hold_rows(below(spectra, limit, abscissa), _ROWS).compute()
    require_results(spectra, spectra.to_dataset(name="spectra"))
    rows, label = _ordinate(spectra)
    spectra = spectra.where(np.abs(spectra["order"]) > 1e-9)  # the mean is no line
    peak = float(spectra.max())
    span = float(np.ptp(rows)) or 1.0
    gain = height * span / (peak or 1.0)
    x = np.broadcast_to(spectra[abscissa].values, spectra.shape)
    for i in np.argsort(-rows):  # from the back to the front: each hides what lies behind it
        if not np.isfinite(spectra.values[i]).any():
            continue
        at, line = spikes(x[i], gain * np.nan_to_num(spectra.values[i]), SPIKE * limit)
        order = 3 + (rows.max() - rows[i]) / span
        ax.fill_between(at, rows[i], rows[i] + line, color="white", linewidth=0, zorder=order)
        ax.plot(at, rows[i] + line, color="C0", linewidth=0.5, zorder=order)
    ax.set(xlim=(_start(spectra, limit), limit), xlabel=_NAMES[abscissa], ylabel=label)
    below_rows = 0.1 if _start(spectra, limit) < 0 else 0.04  # room for the senses of whirl
    ax.set_ylim(rows.min() - below_rows * span, rows.max() + (height + 0.02) * span)
    ax.set_yticks([t for t in ax.get_yticks() if abs(t - rows.mean()) <= 0.55 * span])
    _name_decades(ax, spectra)
    _scale_bar(spectra, ax, peak, gain)
    _name_senses(ax)
    return ax


def intensity(spectra: xr.DataArray, ax: Axes, limit: float, abscissa: str = "frequency") -> Axes:
    """Draw a cascade as a picture, its amplitudes as colours over three decades; arguments as of `waterfall`.

    Peaks are held down to the figure's resolution chunk by chunk, for stores larger than memory.
    """
    from matplotlib.colors import LogNorm

    lines = spectra.where(np.abs(spectra["order"]) > 1e-9, 0.0).where(
        spectra.notnull()
    )  # the mean is no line
    held = hold_rows(hold_peaks(lines, limit, _PIXELS[0], abscissa), _PIXELS[1]).compute()
    require_results(held, held.to_dataset(name="spectra"))
    rows, label = _ordinate(held)
    scale = scale_of(held)
    values = held.values * scale.factor
    peak = float(np.nanmax(values)) or 1.0
    ascending = np.argsort(rows)
    mesh = ax.pcolormesh(
        np.linspace(_start(spectra, limit), limit, values.shape[1] + 1),
        cell_edges(rows[ascending]),
        np.ma.masked_invalid(np.maximum(values[ascending], peak * 10 ** (-_DECADES - 1))),
        norm=LogNorm(peak * 10**-_DECADES, peak),
        cmap="magma",
        rasterized=True,
    )
    ax.set_facecolor("0.85")  # shows where a case is missing
    ax.set(xlim=(_start(spectra, limit), limit), xlabel=_NAMES[abscissa], ylabel=label)
    _name_decades(ax, held)
    _name_senses(ax, "0.9")
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02, aspect=30, extend="min")
    bar.set_label(scale.label(f"{short_name(held)} amplitude"))
    return ax


def draw_orders(
    ax: Axes,
    spectra: xr.DataArray,
    orders: Sequence[Fraction] = ORDERS,
    abscissa: str = "frequency",
    color: str = "0.35",
) -> Axes:
    """Add the lines on which multiples of the spin speed lie, named at their upper ends.

    In full spectra each has its twin on the backward side.
    """
    rows, rate = _rows_and_rate(spectra)
    left, right = ax.get_xlim()
    style: dict[str, Any] = {"color": color, "linewidth": 0.4, "linestyle": (0, (4, 3)), "zorder": 2.5}
    tagged: list[float] = []
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
                _tag(ax, float(x[-1]), float(rows[-1]), f"{order}X", color, "center")
                tagged.append(float(x[-1]))
        else:
            end, side = (right, "right") if order > 0 else (left, "left")
            _tag(ax, end, float(np.interp(abs(end), np.abs(x), rows)), f"{order}X", color, side)
    return ax


def draw_frequencies(
    ax: Axes,
    spectra: xr.DataArray,
    frequencies: Mapping[str, xr.DataArray | float],
    abscissa: str = "frequency",
    color: str = "C1",
) -> Axes:
    """Add natural frequencies (Hz) as dashed lines named beside; they may vary along it.

    In full spectra each has its twin, without a name, on the backward side.
    """
    rows, rate = _rows_and_rate(spectra)
    left, right = ax.get_xlim()
    ends = ax.get_ylim()
    style: dict[str, Any] = {"color": color, "linewidth": 0.7, "linestyle": "--", "zorder": 5}
    named: list[tuple[float, float]] = []  # ends of the names that stand above the axes
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
            label = f"{name} {values[-1]:.4g} Hz"
            half = 0.5 * _CHARACTER * len(label) * (right - left)
            level = sum(at - half < end and at + half > start for start, end in named)  # the next line up
            named.append((at - half, at + half))
            text |= {"xytext": (0, 2 + 8 * level), "ha": "center", "va": "bottom", "annotation_clip": False}
            ax.annotate(label, (at, 1.0), xycoords=("data", "axes fraction"), **text)
        else:  # over orders the curves meet at the top and part towards slow rotation
            side, shift = ("right", -2) if x[0] > left + 0.6 * (right - left) else ("left", 2)
            text |= {"xytext": (shift, 1), "ha": side, "va": "bottom"}
            text["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.3, "alpha": 0.8}
            ax.annotate(f"{name} {values[0]:.4g} Hz", (float(x[0]), ends[0]), **text)
    return ax


def default_limit(spectra: xr.DataArray, frequencies: Mapping[str, xr.DataArray | float]) -> float:
    """Return where a cascade ends unless told, Hz: past the modes named and the highest spin speed."""
    modes = [2 * float(np.max(f)) for f in frequencies.values()]
    fastest = float(np.nanmax(spectra["spin_speed"].values)) / (2 * math.pi)
    limit = max(*modes, 1.25 * fastest) if modes else 4 * fastest
    return min(math.ceil(limit / 10) * 10, float(np.nanmax(spectra["frequency"].values)))


def _start(spectra: xr.DataArray, limit: float) -> float:
    """Return where the abscissa begins: at 0, or as far backward as forward for full spectra."""
    return -limit if float(spectra["order"].min()) < 0 else 0.0


def _name_senses(ax: Axes, color: str = "k") -> None:
    """Say which side of full spectra whirls backward, at the lower ends of the axes."""
    if ax.get_xlim()[0] < 0:
        style: dict[str, Any] = {"va": "bottom", "transform": ax.transAxes, "color": color, "zorder": 7}
        ax.text(0.02, 0.02, "backward", ha="left", **style)
        ax.text(0.98, 0.02, "forward", ha="right", **style)


def _rows_and_rate(spectra: xr.DataArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the displayed ordinates, ascending, and the spin rate (Hz) at each."""
    rows, _ = _ordinate(spectra)
    ascending = np.argsort(rows)
    rate = np.broadcast_to(spectra["spin_speed"].values, rows.shape) / (2 * math.pi)
    return rows[ascending], rate[ascending]


def _ordinate(spectra: xr.DataArray) -> tuple[NDArray[np.float64], str]:
    """Return where the rows stand, and the label; the logarithm of values that are spaced by a ratio."""
    rows, label = displayed(spectra[spectra.dims[0]])
    return np.log10(rows) if is_geometric(np.sort(rows)) else rows, label


def _name_decades(ax: Axes, spectra: xr.DataArray) -> None:
    """Have round values name an ordinate that shows their logarithm."""
    rows, _ = displayed(spectra[spectra.dims[0]])
    if is_geometric(np.sort(rows)):
        low, high = 0.99 * rows.min(), 1.01 * rows.max()
        decades = 10.0 ** np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        named = [v for v in np.outer(decades, (1, 2, 5)).ravel() if low <= v <= high]
        ax.set_yticks(np.log10(named), [f"{value:g}" for value in named])


def _tag(ax: Axes, x: float, y: float, text: str, color: str, ha: str) -> None:
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
    )


def _scale_bar(spectra: xr.DataArray, ax: Axes, peak: float, gain: float) -> None:
    """Add a bar of a round amplitude in the upper right corner."""
    if not peak > 0:
        return
    scale = scale_of(spectra)
    shown = peak * scale.factor
    decade = 10 ** math.floor(math.log10(shown))
    size = max(m for m in (1, 2, 5) if m * decade <= shown) * decade
    top = ax.get_ylim()[1] - 0.02 * float(np.ptp(ax.get_ylim()))
    x = 0.975 * ax.get_xlim()[1]
    ends = [top - gain * size / scale.factor, top]
    ax.plot([x, x], ends, color="k", linewidth=1.2, zorder=7, solid_capstyle="butt")
    ax.annotate(
        f"{short_name(spectra)} {size:g} {scale.unit}",
        (x, top),
        xytext=(-3, 0),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=6.5,
        zorder=7,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
    )
