"""The cascade: spectra stacked along an axis (waterfall), or their amplitudes as colours (intensity)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from postproc.figures.cascade_lines import (
    ABSCISSA_LABELS,
    draw_frequencies,
    draw_orders,
    name_senses,
    ordinate,
)
from postproc.figures.cells import cell_edges, is_geometric, tick_levels
from postproc.figures.drawing import Drawing
from postproc.figures.options import above_zero
from postproc.signals.cascade import below, default_axis, hold_peaks, hold_rows
from postproc.signals.cascade import cascade as cascade_data
from postproc.signals.lines import SPIKE, parse_orders, spikes
from postproc.signals.places import signal_or_whirl
from postproc.store.axes import find_axis
from postproc.store.rig_of_case import natural_frequencies
from postproc.store.select import first_of_rest
from postproc.store.units import displayed, scale_of, short_name
from postproc.store.variables import require_results

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from matplotlib.axes import Axes

    from postproc.figures.options import Axis, Count, Hertz, Metavar

_ROWS = 60  # of a waterfall: more overlap at column width
_PIXELS = (800, 500)  # of an intensity picture at column width and 300 dpi
_DECADES = 3.0
_MOST_ORDER = 5.0  # of the abscissa over orders, by default
_NAMES_HIGH = 0.07  # of the rows' span, above the highest line, for the names of orders


def cascade(
    cases: xr.Dataset,
    signal: str | None = None,
    *,
    full: bool = False,
    probes: tuple[str, str] | None = None,
    node: Count | None = None,
    stator: Count | None = None,
    along: Axis | None = None,
    form: Literal["waterfall", "intensity"] = "waterfall",
    max: Hertz | None = None,  # noqa: A002 - the word of the command
    orders: bool = False,
    order_lines: Annotated[str, Metavar("LIST")] = "1/3,1/2,2/3,1,3/2,2,3",
    mark: Mapping[str, Hertz] | None = None,
) -> Drawing:
    """Spectrum cascade of a signal along an axis.

    Order lines and the rotor's natural frequencies are marked.

    Parameters
    ----------
    cases
        Other axes are taken at their first value.
    signal
        Which recorded signal [default: torsion].
    along
        The axis of the cascade [default: the speed].
    form
        Stacked spectra, or amplitudes as colours.
    max
        End of the abscissa, Hz, or a number of orders with `orders` [default: beyond modes and 1X; order 5].
    orders
        Draw over orders instead of Hz.
    order_lines
        Multiples of the spin speed whose lines are drawn.
    mark
        Mark one more frequency; may be repeated.
    """
    lines = parse_orders(order_lines, "--order-lines")
    along = find_axis(cases, along) if along else default_axis(cases)
    given = above_zero(max, "" if orders else "Hz", "--max")
    cases, notes = first_of_rest(cases, [along, "stator"], "status")
    cases, name = signal_or_whirl(cases, signal, "torsion", full, probes, node, stator)
    spectra = cascade_data(cases, name, along)
    frequencies: dict[str, Any] = dict(natural_frequencies(cases, str(spectra.dims[0])))
    if full:  # lateral motion alone
        frequencies.pop("torsional", None)
    for marked, value in (mark or {}).items():
        frequencies[marked] = above_zero(value, "Hz", f"--mark {marked}")
    abscissa = "order" if orders else "frequency"
    limit = given or (_MOST_ORDER if orders else default_limit(spectra, frequencies))

    def draw(axes: list[Axes]) -> None:
        is_waterfall = form == "waterfall"
        if is_waterfall:
            waterfall(hold_rows(below(spectra, limit, abscissa), _ROWS), axes[0], limit, abscissa)
        else:
            intensity(spectra, axes[0], limit, abscissa)
        colors = ("0.35", "white") if is_waterfall else ("0.8", "0.1")
        draw_orders(axes[0], spectra, lines, abscissa, *colors)
        draw_frequencies(axes[0], spectra, frequencies, abscissa, "C1" if is_waterfall else "#56B4E9")

    shown = below(spectra, limit, abscissa).to_dataset(name=str(spectra.name))
    return Drawing(shown=shown, draw=draw, height=80, lines=tuple(notes))


def waterfall(
    spectra: xr.DataArray,
    ax: Axes,
    limit: float,
    abscissa: str = "frequency",
    height: float = 0.22,
    spike: float = SPIKE,
) -> Axes:
    """Draw the spectra of a cascade above one another, each on the value of its axis.

    `spectra` (along, order) are those of `cascade`, of which only what is drawn is loaded; `limit` is the end
    of the abscissa, Hz or orders, `height` that of the highest line, as a part of the ordinate, and `spike`
    half the width of each line, as a part of the abscissa.
    """
    spectra = below(spectra, limit, abscissa).compute()
    require_results(spectra, spectra.to_dataset(name="spectra"))
    rows, label = ordinate(spectra)
    spectra = spectra.where(np.abs(spectra["order"]) > 1e-9)  # the mean is no line
    peak = float(spectra.max())
    span = float(np.ptp(rows)) or 1.0
    gain = height * span / (peak or 1.0)
    x = np.broadcast_to(spectra[abscissa].values, spectra.shape)
    has_result = np.isfinite(spectra.values).any(axis=1)
    for i in np.argsort(-rows):  # from the back to the front: each hides what lies behind it
        if not has_result[i]:
            ax.axhline(rows[i], color="0.6", linewidth=0.5, linestyle=(0, (1, 2)), zorder=2)
            continue
        at, line = spikes(x[i], gain * np.nan_to_num(spectra.values[i]), spike * limit)
        order = 3 + (rows.max() - rows[i]) / span
        ax.fill_between(at, rows[i], rows[i] + line, color="white", linewidth=0, zorder=order)
        ax.plot(at, rows[i] + line, color="C0", linewidth=0.5, zorder=order)
    ax.set(xlim=(_start(spectra, limit), limit), xlabel=ABSCISSA_LABELS[abscissa], ylabel=label)
    below_rows = 0.1 if _start(spectra, limit) < 0 else 0.04  # room for the senses of whirl
    ax.set_ylim(rows.min() - below_rows * span, rows.max() + (height + 0.02 + _NAMES_HIGH) * span)
    ax.set_yticks([t for t in ax.get_yticks() if abs(t - rows.mean()) <= 0.55 * span])
    _name_decades(ax, spectra)
    tick_levels(ax, "y", spectra[spectra.dims[0]], rows)
    _scale_bar(spectra, ax, peak, gain)
    if not has_result.all():
        style: dict[str, Any] = {"color": "0.4", "fontsize": 6.0, "ha": "right", "va": "bottom", "zorder": 7}
        ax.text(0.95 * limit, rows[~has_result].max(), "no result", **style)  # of all dotted ones
    name_senses(ax)
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
    rows, label = ordinate(held)
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
    ax.set(xlim=(_start(spectra, limit), limit), xlabel=ABSCISSA_LABELS[abscissa], ylabel=label)
    _name_decades(ax, held)
    tick_levels(ax, "y", held[held.dims[0]], rows)
    name_senses(ax, "0.9")
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02, aspect=30, extend="min")
    bar.set_label(scale.label(f"{short_name(held)} amplitude"))
    return ax


def default_limit(spectra: xr.DataArray, frequencies: Mapping[str, xr.DataArray | float]) -> float:
    """Return the default end of a cascade, Hz: past the modes named and the highest spin speed."""
    modes = [2 * float(np.max(f)) for f in frequencies.values()]
    fastest = float(np.nanmax(spectra["spin_speed"].values)) / (2 * math.pi)
    limit = max(*modes, 1.25 * fastest) if modes else 4 * fastest
    return min(math.ceil(limit / 10) * 10, float(np.nanmax(spectra["frequency"].values)))


def _start(spectra: xr.DataArray, limit: float) -> float:
    """Return where the abscissa begins: at 0, or as far backward as forward for full spectra."""
    return -limit if float(spectra["order"].min()) < 0 else 0.0


def _name_decades(ax: Axes, spectra: xr.DataArray) -> None:
    """Have round values name an ordinate that shows their logarithm."""
    rows, _ = displayed(spectra[spectra.dims[0]])
    if is_geometric(np.sort(rows)):
        low, high = 0.99 * rows.min(), 1.01 * rows.max()
        decades = 10.0 ** np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        named = [v for v in np.outer(decades, (1, 2, 5)).ravel() if low <= v <= high]
        ax.set_yticks(np.log10(named), [f"{value:g}" for value in named])


def _scale_bar(spectra: xr.DataArray, ax: Axes, peak: float, gain: float) -> None:
    """Add a bar of a round amplitude in the upper right corner."""
    if not peak > 0:
        return
    scale = scale_of(spectra)
    shown = peak * scale.factor
    decade = 10 ** math.floor(math.log10(shown))
    size = max(m for m in (1, 2, 5) if m * decade <= shown) * decade
    top = ax.get_ylim()[1] - 0.06 * float(np.ptp(ax.get_ylim()))  # below the names of orders
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
