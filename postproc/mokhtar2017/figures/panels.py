"""Pages of lettered panels, what figures of the paper share, and the markers on its cascade."""

from __future__ import annotations

import math
from fractions import Fraction
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from postproc.figures.drawing import COLUMN_WIDTH
from postproc.figures.hht import energy_time_frequency
from postproc.figures.small_multiples import overlaid
from postproc.figures.spectrum import draw_spectrum
from postproc.figures.waveform import draw_waveform, shade_contacts
from postproc.mokhtar2017.claims.quantities import at_speed, crest, strongest
from postproc.signals.hilbert_huang import hilbert_huang
from postproc.signals.lines import strongest_lines
from postproc.signals.spectra import last_revolutions, samples_per_revolution, spectrum_data
from postproc.signals.waveforms import waveform_data
from postproc.store.rig_of_case import natural_frequencies, stator_frequencies
from postproc.store.units import scale_of, short_name
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE_WIDTH = 180 / 25.4  # inches, both columns
_PAD = 0.045  # inches about a panel, so that the labels of one keep clear of the next
_SHOWN = 12  # revolutions of an orbit without a period
_DOTS = 200  # an inch: what a screen shows of a page
LABEL_WIDTH = 22  # characters left of a panel
# Of overlaid curves, distinguishable without colour too.
STYLES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1, 1)))
ORDERS = [Fraction(*f) for f in ((1, 3), (1, 2), (2, 3), (1, 1), (4, 3), (3, 2), (2, 1), (3, 1))]
HEIGHT = 0.16  # of the highest line, as a part of the ordinate


def over_time(
    every: xr.Dataset,
    ax: Mapping[str, Axes],
    signals: Mapping[str, str],
    revolutions: int = 4,
    over: str | None = None,
    is_shaded: bool = True,
) -> None:
    """Draw the last revolutions of signals of one case, or of several along an axis, each in its panel.

    `signals` are names and the letters of their panels. Contact is shaded where there is one case.
    """
    data = waveform_data(every, [*signals, "contact_force"], revolutions + 1, over)
    start = between_contacts(data["contact_force"])
    n_sample = revolutions * samples_per_revolution(data["contact_force"])
    data = data.isel(sample=slice(start, start + n_sample)).load()
    data = from_zero(data, float(data["time"][0]))
    for signal, panel in ((name, ax[letter]) for name, letter in signals.items()):
        draw_waveform(data[signal], panel)
        tidy(panel)
        if over is None and is_shaded:
            shade_contacts(data["contact_force"], panel)
        if over is not None:
            for line, style in zip(panel.get_lines(), STYLES, strict=False):
                line.set_linestyle(style)


def between_contacts(force: xr.DataArray) -> int:
    """Return the sample of the first revolution that is farthest from contact in all cases and revolutions.

    A panel that begins there cuts no contact at its edges.
    """
    touches = (force > 0).values.reshape(-1, samples_per_revolution(force)).any(axis=0)
    if not touches.any():
        return 0
    at, n = np.flatnonzero(touches), touches.size
    gaps = np.diff(np.append(at, at[0] + n))
    longest = int(np.argmax(gaps))
    return int(at[longest] + gaps[longest] // 2) % n


def closeup(
    case: xr.Dataset, signal: str, ax: Axes, first: int, end: int, before: float, after: float
) -> None:
    """Draw a signal about one contact, which lasts from sample `first` to `end`, and mark both.

    `before` and `after` (s) are what is shown before the touch and after it.
    """
    data = waveform_data(case, [signal, "contact_force"], None).load()
    step = float(data["time"][1])
    data = data.isel(sample=slice(first - round(before / step), first + round(after / step)))
    data = from_zero(data, float(data["time"][0]) + before)
    draw_waveform(data[signal], ax)
    tidy(ax)
    shade_contacts(data["contact_force"], ax)
    scale = scale_for("s", float(data["time"][-1]))
    for name, at, side in (("touch", 0, "right"), ("release", end - first, "left")):
        shift = -2 if side == "right" else 2
        ax.annotate(
            name, (at * step * scale.factor, 0.95), xycoords=("data", "axes fraction"), ha=side,
            xytext=(shift, 0), textcoords="offset points", va="top",
        )  # fmt: skip


def orbits(
    every: xr.Dataset,
    ax: Axes,
    over: str | None = None,
    names: Sequence[str] | None = None,
    gap: float | None = None,
) -> None:
    """Draw one period of orbits over one another; a dotted line marks the gap (m) of the stator.

    Of an orbit without a period, twelve revolutions are shown. `names` are those of the legend, in place of
    the values of the axis.
    """
    motion = [every[n].load() for n in ("vertical", "horizontal")]
    scale = scale_for("m", float(max(abs(signal).max() for signal in motion)))
    periods = np.atleast_1d(every["period"].values)
    for i, (name, y, z) in enumerate(overlaid("sample", *motion)):
        # One period and no more: dashes that lie over one another make a full line.
        shown = [last_revolutions(s, int(periods[i]) or _SHOWN).values * scale.factor for s in (z, y)]
        is_closed = periods[i] > 0
        path = [np.append(s, s[:1]) if is_closed else s for s in shown]
        ax.plot(*path, linestyle=STYLES[i], label=names[i] if names else name)
    if gap is not None:
        ax.axhline(gap * scale.factor, color="0.4", linewidth=0.6, linestyle=(0, (1, 1)), zorder=1)
    ax.set_aspect("equal", adjustable="datalim")
    ax.locator_params(nbins=5)
    ax.set(xlabel=scale.label("Horizontal"), ylabel=scale.label("Vertical"))


def lines(case: xr.Dataset, signal: str, ax: Axes, limit: float, n_line: int = 5) -> None:
    """Draw a spectrum over Hz; its strongest line is named with its frequency, others by their order."""
    amplitude = spectrum_data(case, signal).compute()
    named = strongest_lines(amplitude, n_line)
    scale = scale_of(amplitude)
    names = [str(name) for name in named["name"].values]
    names[0] = f"{names[0]}, {float(named['frequency'][0]):.1f} Hz"
    draw_spectrum(amplitude, ax, named.assign(name=("line", names)), limit=limit)
    ax.set_ylim(0, 1.25 * float(named["amplitude"][0]) * scale.factor)  # room for the name
    ax.set_ylabel(scale.label(f"{short_name(amplitude).removesuffix(' displacement')} amplitude"))
    tidy(ax)


def legend(ax: Axes, **where: Any) -> None:
    """Add a legend above the curves of a panel, in a row."""
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.22 * (high - low))
    ax.legend(**({"loc": "upper right", "ncols": len(ax.get_lines()), "columnspacing": 0.8} | where))


def from_zero(data: xr.Dataset, start: float) -> xr.Dataset:
    """Return waveforms with their time counted from `start`, s."""
    time = data["time"]
    return data.assign_coords(time=(time - start).assign_attrs(time.attrs))


def tidy(ax: Axes) -> None:
    """Break the label of the ordinate and thin out its ticks, for a low panel."""
    ax.set_ylabel(fill(ax.get_ylabel(), LABEL_WIDTH))
    ax.locator_params(axis="y", nbins=5)


def page(rows: str, height: float, width: float | None = None) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure and its panels by letter.

    Rows are as in "ab cc": panels a and b side by side over a wide panel c. Sizes are in mm; by default, a
    page of one panel a row is one column wide, any other two.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    mosaic = rows.split()
    inches = width / 25.4 if width else (PAGE_WIDTH if len(mosaic[0]) > 1 else COLUMN_WIDTH)
    figure = Figure(figsize=(inches, height / 25.4), dpi=_DOTS)
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=_PAD, h_pad=_PAD)  # type: ignore[union-attr, call-arg]
    panels = figure.subplot_mosaic("\n".join(mosaic))
    for letter, ax in panels.items():
        ax.set_title(f"({letter})")
    return figure, panels


def title(ax: Axes, text: str) -> None:
    """Add text after the letter of a panel."""
    ax.set_title(f"{ax.get_title(loc='left')} {text}")


def energy(case: xr.Dataset, signal: str, ax: Axes, revolutions: int, limit: float) -> None:
    """Draw the Hilbert spectrum of the first intrinsic mode over the last revolutions, up to `limit` Hz."""
    is_stator = signal.startswith("stator")
    own = stator_frequencies(case)["lateral"] if is_stator else natural_frequencies(case)["torsional"]
    name = "stator, lateral" if is_stator else "torsional"
    found = hilbert_huang(case, signal, revolutions=revolutions)
    energy_time_frequency(found, ax, limit, {name: float(own)}, colorbar=False)


def share_bar(axes: Sequence[Axes], location: Literal["bottom", "right"] = "bottom") -> None:
    """Add one bar for the colours of several Hilbert spectra."""
    drawn = axes[0].collections[0]
    bar = axes[0].figure.colorbar(drawn, ax=list(axes), location=location, pad=0.02, aspect=60)
    bar.set_label("Energy (dB of its peak)")


def windowed(case: xr.Dataset, signal: str, ax: Axes, revolutions: int) -> None:
    """Draw the first intrinsic mode under its windows, over the signal that it was taken from."""
    found = hilbert_huang(case, signal, revolutions=revolutions)
    scale, time = scale_of(found["signal"]), scale_for("s", float(found["time"][-1]))
    x = found["time"].values * time.factor
    ax.plot(x, found["signal"].values * scale.factor, color="0.6", label="recorded")
    ax.plot(x, found["imf"].sel(mode=1).values * scale.factor, label="first mode, windowed")
    label = scale.label(short_name(case[signal]))
    ax.set(xlim=(0, x[-1]), xlabel=time.label("Time"), ylabel=label)
    legend(ax)
    tidy(ax)
    force = found["contact"].astype(float).rename("contact")
    shade_contacts(force, ax)


def mark_lines(ax: Axes, spectra: xr.DataArray, torsional: float, bending: float) -> None:
    """Mark the lines that the paper names, at the torsional and the pseudo-critical frequency, Hz."""
    highest = float(spectra.where(spectra["order"] > 0).max())
    for letter, speed, frequency, amplitude in _markers(spectra, torsional, bending):
        _mark(ax, letter, frequency, speed, amplitude / highest)


def _markers(
    spectra: xr.DataArray, torsional: float, bending: float
) -> Iterator[tuple[str, float, float, float]]:
    """Yield the paper's markers with speed ratio, frequency (Hz) and amplitude of the lines they stand at.

    a, b, c: 1X, 1/2X and 1/3X crest at the pseudo-critical frequency; d, e, g: 2X, 3X and 1X crest at the
    torsional one; h, i: multiples of 1/3X beside c; j, k: multiples of 1/2X beside b; f: r = 5.7. What does
    not crest is not marked.
    """
    crests = {
        letter: (Fraction(*order), crest(spectra, Fraction(*order), frequency))
        for letter, order, frequency in (
            ("a", (1, 1), bending),
            ("b", (1, 2), bending),
            ("c", (1, 3), bending),
            ("d", (2, 1), torsional),
            ("e", (3, 1), torsional),
            ("g", (1, 1), torsional),
        )
    }
    at = crests | {
        "h": (Fraction(1), crests["c"][1]),
        "i": (Fraction(4, 3), crests["c"][1]),
        "j": (Fraction(3, 2), crests["b"][1]),
        "k": (Fraction(2), crests["b"][1]),
    }
    for letter, (order, speed) in at.items():
        if math.isnan(speed):
            continue
        line = at_speed(spectra, speed).sel(order=float(order), method="nearest")
        yield letter, speed, float(line["frequency"]), float(line)
    (highest,) = strongest(at_speed(spectra, 5.7))
    yield "f", 5.7, highest.hertz, highest.amplitude


def _mark(ax: Axes, letter: str, frequency: float, speed: float, share: float) -> None:
    """Add a marker next to a line whose height is `share` of the highest."""
    low, high = ax.get_ylim()
    span = (high - low) / (1 + HEIGHT + 0.06)  # that of the rows, of which `waterfall` takes heights
    at = frequency, speed + 0.5 * share * HEIGHT * span
    style: dict[str, Any] = {"fontsize": 8, "fontweight": "bold", "color": "C1", "va": "center", "zorder": 8}
    ax.annotate(letter, at, xytext=(3, 0), textcoords="offset points", **style)
