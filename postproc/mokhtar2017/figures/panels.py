"""Pages of lettered panels, and the panels that several figures of the paper share."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.overlay import overlaid
from postproc.figures.spectrum import draw_spectrum
from postproc.figures.style import COLUMN_WIDTH
from postproc.figures.waveform import draw_waveform, shade_contacts
from postproc.signals.lines import strongest_lines
from postproc.signals.spectra import last_revolutions, samples_per_revolution, spectrum_data
from postproc.signals.waveforms import waveform_data
from postproc.store.units import scale_of, short_name
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE_WIDTH = 180 / 25.4  # inches, both columns
_PAD = 0.045  # inches about a panel, so that the labels of one keep clear of the next
_DOTS = 200  # an inch: what a screen shows of a page
LABEL_WIDTH = 22  # characters left of a panel
# Of overlaid curves, distinguishable without colour too.
STYLES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1, 1)))


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
    revolutions: int = 12,
    names: Sequence[str] | None = None,
    gap: float | None = None,
) -> None:
    """Draw one period of orbits over one another; a dotted line marks the gap (m) of the stator.

    Of an orbit that has no period, `revolutions` are shown. `names` are those of the legend, in place of the
    values of the axis.
    """
    motion = [every[n].load() for n in ("vertical", "horizontal")]
    scale = scale_for("m", float(max(abs(signal).max() for signal in motion)))
    periods = np.atleast_1d(every["period"].values)
    for i, (name, y, z) in enumerate(overlaid("sample", *motion)):
        # One period and no more: dashes that lie over one another make a full line.
        shown = [last_revolutions(s, int(periods[i]) or revolutions).values * scale.factor for s in (z, y)]
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

    Parameters
    ----------
    rows : str
        Rows of letters, as in "ab cc": panels a and b side by side over a wide panel c.
    height, width : float
        mm; by default, a page of one panel a row is one column wide, any other two.
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
