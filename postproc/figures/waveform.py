"""Waveforms: the recorded signals in stacked panels, over time or revolutions."""

from __future__ import annotations

import re
from textwrap import fill
from typing import TYPE_CHECKING

from postproc.figures.drawing import Drawing
from postproc.figures.options import above_zero
from postproc.figures.run_up_marks import title_of_speeds
from postproc.figures.small_multiples import legend_below, overlaid
from postproc.signals.contacts import runs_of
from postproc.signals.waveforms import default_signals, waveform_data
from postproc.store.units import displayed, scale_of, short_name
from postproc.store.variables import require_results

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.axes import Axes

    from postproc.figures.options import Axis, Count, Speed

_LABEL_WIDTH = 14  # characters that fit next to a low panel
_UNIT = re.compile(r"\(.*\)$")


def waveform(
    cases: xr.Dataset,
    signal: str | Sequence[str] = (),
    *,
    revolutions: Count = 4,
    at: Speed | None = None,
    over: Axis | None = None,
) -> Drawing:
    """Waveforms of some signals over the last revolutions.

    They are drawn in panels above one another; contact is shaded.

    Parameters
    ----------
    cases
        One case, or cases along the axis `over`.
    signal
        May be repeated [default: motion and contact force, or all that was measured].
    revolutions
        The last ones, or those around the speed `at`.
    at
        Spin speed of a run-up, such as "2000 rpm".
    """
    named = (signal,) if isinstance(signal, str) else signal
    signals = tuple(dict.fromkeys(named)) or default_signals(cases)
    speed = above_zero(at, "rad/s", "--at")
    shown = waveform_data(cases, signals, revolutions, over, speed)
    return Drawing(shown=shown, draw=lambda axes: draw_panels(shown, axes), panels=(len(signals), 1))


def draw_waveform(signal: xr.DataArray, ax: Axes) -> Axes:
    """Draw one signal, or that of several cases over one another, over time or else revolutions."""
    signal = signal.load()
    require_results(signal, signal.to_dataset())
    scale = scale_of(signal)
    abscissa = _abscissa(signal)
    x, x_label = displayed(abscissa)
    if abscissa.name == "revolution" and x[0] < 0.0:
        x_label = str(abscissa.attrs["long_name"]).capitalize()
    for name, curve in overlaid("sample", signal):
        ax.plot(x, curve.values * scale.factor, label=name)
    ax.set(xlim=(x[0], x[-1]), xlabel=x_label, ylabel=scale.label(short_name(signal)))
    if signal.name == "contact_force" and not signal.any():  # a force has no negative part
        ax.set_ylim(bottom=0.0)
    return ax


def draw_panels(data: xr.Dataset, axes: Sequence[Axes]) -> list[Axes]:
    """Draw every signal of `waveform_data` in its own panel; contact is shaded where it was recorded."""
    signals = [str(n) for n, v in data.data_vars.items() if "sample" in v.dims]
    for ax, name in zip(axes, signals, strict=True):
        draw_waveform(data[name], ax)
        label = _UNIT.sub(lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), ax.get_ylabel())
        ax.set_ylabel(fill(label, _LABEL_WIDTH), fontsize=7)
        ax.label_outer()
        ax.locator_params(axis="y", nbins=4)
        ax.locator_params(axis="x", nbins=5)
    axes[0].figure.align_ylabels(list(axes))
    if "contact_force" in data and data["contact_force"].ndim == 1:
        for ax in axes:
            shade_contacts(data["contact_force"], ax)
    axes[0].set_title("".join(title_of_speeds(data)), fontsize=7)
    legend_below(axes[0], axes[0].get_legend_handles_labels()[0])
    return list(axes)


def shade_contacts(force: xr.DataArray, ax: Axes) -> None:
    """Shade the spans of contact behind a waveform, by the force of one stator."""
    x, _ = displayed(_abscissa(force))
    half = (x[1] - x[0]) / 2  # a sample is a mean over its interval
    for first, end in zip(*runs_of(force.values > 0), strict=True):
        ax.axvspan(x[first] - half, x[end - 1] + half, color="0.9", linewidth=0, zorder=0)


def _abscissa(signal: xr.DataArray) -> xr.DataArray:
    return signal["time"] if "time" in signal.coords else signal["revolution"]
