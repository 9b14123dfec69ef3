"""The spectrum: amplitudes over frequency or orders, the strongest lines named."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from postproc.figures.cascade_lines import ABSCISSA_LABELS, name_senses
from postproc.figures.drawing import Drawing
from postproc.figures.options import above_zero
from postproc.figures.small_multiples import overlaid, write_over
from postproc.signals.lines import SPIKE, spikes, strongest_lines
from postproc.signals.places import signal_or_whirl
from postproc.signals.run_ups import run_up_spectra
from postproc.signals.spectra import spectrum_data
from postproc.store.attributes import MEASURED
from postproc.store.rig_of_case import frequencies_at_speed
from postproc.store.select import narrow
from postproc.store.units import scale_of, short_name
from postproc.store.variables import require_results

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from matplotlib.axes import Axes

    from postproc.figures.options import Axis, Bounds, Count, Hertz, Speed

_LABEL_WIDTH = 38  # characters that fit next to a panel
_WINDOW = 32  # revolutions in a spectrum of a run-up
_FLOOR = 1e-5  # of the highest line, on a log scale


def spectrum(
    cases: xr.Dataset,
    signal: str | None = None,
    *,
    full: bool = False,
    probes: tuple[str, str] | None = None,
    node: Count | None = None,
    stator: Count | None = None,
    at: Speed | None = None,
    orders: bool = False,
    max: Hertz | None = None,  # noqa: A002 - the word of the command
    lines: Annotated[int, Bounds(least=0)] = 6,
    log: bool = False,
    over: Axis | None = None,
) -> Drawing:
    """Amplitude spectrum of a signal.

    Its strongest lines are named, and printed: as fractions of the spin speed where the period of the motion
    proves them, else by decimals and the natural frequency that is near.

    Parameters
    ----------
    cases
        One case, or cases along the axis `over`.
    signal
        Which recorded signal [default: torsion].
    at
        Spin speed of a run-up, such as "2000 rpm", around which a spectrum is taken over 32 revolutions,
        through Hann's window.
    orders
        Draw over orders instead of Hz.
    max
        End of the abscissa, Hz, or a number of orders with `orders`.
    lines
        How many lines are named.
    log
        Amplitudes on a logarithmic scale.
    """
    limit = above_zero(max, "" if orders else "Hz", "--max")
    cases, name = signal_or_whirl(cases, signal, "torsion", full, probes, node, stator)
    speed = above_zero(at, "rad/s", "--at")
    if speed is None:
        shown = spectrum_data(cases, name, over).compute()
        speed = float(narrow(cases, ["spin_speed"])["spin_speed"]) if over is None else None
    else:
        one = run_up_spectra(cases, name, _WINDOW, 1, speed).isel(place=0)
        shown = one["amplitude"].rename(name).drop_vars("revolution")
    abscissa = "order" if orders else "frequency"
    limit = limit or default_limit(shown, abscissa)
    natural = frequencies_at_speed(cases, speed) if "rig" in cases.attrs and speed is not None else None
    digits = 2 if MEASURED in cases.attrs else 3
    is_named = over is None and lines
    found = strongest_lines(shown, lines, natural=natural, digits=digits) if is_named else None
    return Drawing(
        shown=shown.to_dataset(name=str(shown.name)),
        draw=lambda axes: draw_spectrum(shown, axes[0], found, abscissa, limit, log),
        lines=() if found is None else tuple(_table(found, shown.attrs["units"])),
    )


def draw_spectrum(
    amplitude: xr.DataArray,
    ax: Axes,
    lines: xr.Dataset | None = None,
    abscissa: str = "frequency",
    limit: float | None = None,
    log: bool = False,
) -> Axes:
    """Draw a spectrum ([over,] order), or those of several cases over one another.

    Each of `lines`, from `strongest_lines`, is named at its peak; `limit` is the end of the abscissa, Hz or
    orders.
    """
    amplitude = amplitude.load()
    require_results(amplitude, amplitude.to_dataset())
    is_line = np.abs(amplitude["order"]) > 1e-9  # the mean is no line
    amplitude = amplitude.where(is_line)
    scale = scale_of(amplitude)
    end = float(np.nanmax(amplitude[abscissa].values)) if limit is None else limit
    for name, curve in overlaid("order", amplitude):
        ax.plot(
            *spikes(curve[abscissa].values, curve.fillna(0.0).values * scale.factor, SPIKE * end),
            label=name,
            linewidth=0.6,
        )
    is_full = bool((amplitude["order"].values < 0).any())
    ax.set_xlim(-end if is_full else 0.0, end)
    top = float(amplitude.max()) * scale.factor or 1.0
    if float(amplitude.max()) == 0.0:
        write_over(ax, "0 throughout")
    if log:
        ax.set_yscale("log")
        ax.set_ylim(top * _FLOOR, top * 6)
    else:
        ax.set_ylim(0, top * 1.15)
    if lines is not None:
        _name_lines(ax, lines, scale.factor, abscissa)
    if amplitude.ndim > 1:
        ax.legend(loc="upper right")
    ax.set_xlabel(ABSCISSA_LABELS[abscissa])
    ax.set_ylabel(fill(scale.label(f"{short_name(amplitude)} amplitude"), _LABEL_WIDTH))
    name_senses(ax, is_above=True)
    return ax


def default_limit(amplitude: xr.DataArray, abscissa: str = "frequency") -> float:
    """Return the default end of the abscissa: beyond the strongest lines, and not before 4X."""
    ends: list[float] = []
    for _, curve in overlaid("order", amplitude):
        first = float(curve[abscissa].values[-1] / curve["order"].values[-1])  # 1X
        lines = strongest_lines(curve)[abscissa].values
        least = 2.2 if curve["order"].values[0] < 0 else 4.2
        ends += [least * first, *(1.2 * np.abs(lines))]
    return min(max(ends), float(np.nanmax(amplitude[abscissa].values)))


def _name_lines(ax: Axes, lines: xr.Dataset, factor: float, abscissa: str) -> None:
    """Name the lines, the strongest first; one too near to a named one for its text to fit goes unnamed."""
    is_full = ax.get_xlim()[0] < 0
    to_axes = ax.transData + ax.transAxes.inverted()
    taken: list[tuple[float, float]] = []
    for i in range(lines.sizes["line"]):
        x, y = float(lines[abscissa].values[i]), float(lines["amplitude"].values[i]) * factor
        across, up = to_axes.transform((x, y))
        # Names of backward and forward lines are on their outer sides, clear of one another.
        across += 0.045 * np.sign(x) if is_full else 0.0
        if not 0 <= across <= 1 or any(abs(across - a) < 0.09 and abs(up - b) < 0.08 for a, b in taken):
            continue
        taken.append((across, up))
        side = ("right" if x < 0 else "left") if is_full else "center"
        text = str(lines["name"].values[i])
        if near := str(lines["near"].values[i]) if "near" in lines else "":
            text = f"{text}\n{near}"
        style: dict[str, Any] = {"ha": side, "va": "bottom", "fontsize": 6.5}
        ax.annotate(text, (x, y), xytext=(0, 1.5), textcoords="offset points", annotation_clip=True, **style)


def _table(lines: xr.Dataset, unit: str) -> Iterator[str]:
    columns = (lines[n].values for n in ("name", "frequency", "amplitude", "near"))
    for name, frequency, amplitude, near in zip(*columns, strict=True):
        remark = f"  near the {near}" if near else ""
        yield f"{name:>8} {frequency:10.3f} Hz  {amplitude:.4e} {unit}{remark}"
