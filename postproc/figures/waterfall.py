"""The waterfall of a run-up: spectra at one speed after the other, or their amplitudes as colours."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from postproc.figures.cascade import waterfall as stack_spectra
from postproc.figures.cascade_lines import ABSCISSA_LABELS, draw_orders
from postproc.figures.drawing import Drawing
from postproc.figures.options import above_zero
from postproc.figures.run_up_marks import RPM, falling
from postproc.signals.places import signal_or_whirl
from postproc.signals.run_ups import run_up_spectra
from postproc.store.units import displayed, scale_of, short_name

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from postproc.figures.options import Count, Hertz

_HEIGHT = 0.3  # of the ordinate, that the highest line takes
_DECADES = 3.0
_ROWS = 200  # of a spectrogram
_MOST_ORDER = 4.0  # at the highest speed, where the abscissa ends by default
_LINES = (Fraction(1, 2), Fraction(1), Fraction(2), Fraction(3))  # orders that are drawn


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
    end = _end(shown, limit, orders)

    def draw(axes: list[Axes]) -> None:
        if is_map:
            draw_spectrogram(shown, name, axes[0], end, orders)
            return
        spectra, abscissa = as_cascade(shown, name), "order" if orders else "frequency"
        stack_spectra(spectra, axes[0], end, abscissa, _HEIGHT, np.inf)
        draw_orders(axes[0], spectra, _LINES, abscissa)
        axes[0].set_title(_title(shown, name), fontsize=8)

    return Drawing(shown=shown, draw=draw, height=90)


def as_cascade(data: xr.Dataset, signal: str) -> xr.DataArray:
    """Return the spectra of a run-up as those of a cascade: over the speed, or the revolution if it falls."""
    rpm = RPM * data["speed"].values
    spectra = data["amplitude"].rename(signal).assign_coords(spin_speed=data["speed"])
    if not falling(rpm).any():
        return spectra.swap_dims(place="speed")
    about = {"units": "1", "long_name": f"revolution, {rpm.min():.0f} to {rpm.max():.0f} rpm"}
    return spectra.assign_coords(place=("place", data["revolution"].values, about))


def draw_spectrogram(data: xr.Dataset, signal: str, ax: Axes, limit: float, orders: bool = False) -> Axes:
    """Draw amplitudes as colours over speed and frequency, up to a limit, Hz or orders."""
    from matplotlib.colors import LogNorm

    spectra = as_cascade(data, signal)
    at, label = displayed(spectra[spectra.dims[0]])
    rising = np.argsort(at, kind="stable")
    at, rpm = at[rising], RPM * data["speed"].values[rising]
    scale = scale_of(data["amplitude"])
    amplitude = data["amplitude"].values[rising] * scale.factor
    start = -limit if _is_full(data) else 0.0
    order = data["order"].values
    half = 0.5 * (order[1] - order[0])
    edges = np.append(order - half, order[-1] + half)
    heights = np.broadcast_to(edges, (rpm.size, edges.size))
    if not orders:
        heights = heights * rpm[:, np.newaxis] / 60.0
    top = float(amplitude.max()) or 1.0
    # A column for every spectrum, between the midpoints of the speeds.
    bounds = np.concatenate([at[:1], 0.5 * (at[1:] + at[:-1]), at[-1:]])
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
    ax.set(xlim=(at.min(), at.max()), ylim=(start, limit))
    for line in [*(-line for line in _LINES if start), *_LINES]:
        height = float(line) * (np.ones(rpm.size) if orders else rpm / 60.0)
        ax.plot(at, height, color="white", linewidth=0.4, linestyle=(0, (4, 4)))
        if start < height[-1] < limit:
            style: dict[str, Any] = {"xytext": (2, 0), "ha": "left", "va": "center", "fontsize": 6}
            name = f"{line}X".replace("-", "\N{MINUS SIGN}")
            ax.annotate(name, (at[-1], height[-1]), textcoords="offset points", **style)
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
