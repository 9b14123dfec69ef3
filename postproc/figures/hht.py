"""The Hilbert-Huang analysis of a signal: the signal, and its energy over time and frequency."""

from __future__ import annotations

import math
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.options import above_zero
from postproc.signals.contacts import runs_of
from postproc.signals.hilbert_huang import (
    contact_bandwidth,
    energy_picture,
    hilbert_huang,
    median_frequency,
    span_frequencies,
)
from postproc.signals.spectra import default_signal
from postproc.store.attributes import MEASURED
from postproc.store.rig_of_case import natural_frequencies, stator_frequencies
from postproc.store.select import at_most_loaded_stator
from postproc.store.units import plain_number, scale_of, short_name
from rubhpc.errors import InputError
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable

    from postproc.figures.options import Bounds, Count, Hertz

_DECIBELS = 40.0  # of energy below its peak that are shown
_BLUR = 0.006  # of the ordinate: the half width of a line
_LABEL_WIDTH = 20  # characters that fit next to a panel
_SHADE = "0.9"


def hht(
    cases: xr.Dataset,
    signal: str | None = None,
    *,
    contact: Literal["masked", "kept"] | None = None,
    revolutions: Count = 4,
    mode: Annotated[int, Bounds(least=1, most=8)] = 1,
    max: Hertz | None = None,  # noqa: A002 - the word of the command
) -> Drawing:
    """Hilbert-Huang analysis of a signal.

    Its energy over time and frequency is drawn, with contact shaded. The amplitude-weighted median frequency
    between contacts is printed, of all spans and of each.

    Parameters
    ----------
    cases
        One case.
    signal
        Which recorded signal [default: torsion].
    contact
        Leave out spans in contact, with windows over the others, or keep them [default: kept for a stator's
        signals, and where contact was not measured].
    revolutions
        The last ones.
    mode
        Intrinsic mode, the fastest first.
    max
        End of the ordinate, Hz [default: twice the natural frequency].
    """
    limit = above_zero(max, "Hz", "--max")
    signal = signal or default_signal(cases, "torsion")
    if signal in cases and "stator" in cases[signal].dims:  # its contacts and natural frequency too
        cases = at_most_loaded_stator(cases)
    shown = hilbert_huang(cases, signal, contact=contact, revolutions=revolutions, n_mode=mode)
    natural: dict[str, Any] = {}
    if signal == "stator_lateral":
        own = stator_frequencies(cases)
        natural = {"stator": own["lateral"]} if "lateral" in own else {}  # a wall has none
    elif not signal.startswith(("stator", "contact")):
        kind = "torsional" if signal.startswith("torsion") else "lateral"
        natural = {name: f for name, f in natural_frequencies(cases).items() if name == kind}
    known = {name: float(f) for name, f in natural.items()}
    return Drawing(
        shown=shown,
        draw=lambda axes: draw_panels(shown, axes, limit, known, mode),
        panels=(2, 1),
        height=85,
        lines=tuple(_medians(shown, mode)),
    )


def energy_time_frequency(
    hht: xr.Dataset,
    ax: Axes,
    limit: float | None = None,
    natural: Mapping[str, float] | None = None,
    colorbar: bool = True,
) -> Axes:
    """Draw the energy of the first intrinsic mode over time and frequency; contact is shaded.

    The ordinate ends at `limit`, Hz, by default twice the median frequency: out of contact, or else in it.
    Natural frequencies, Hz, are marked by their names.
    """
    mesh = _draw_energy(hht, ax, limit, natural or {}, 1)
    if colorbar:
        _add_bar(ax, [ax], mesh)
    return ax


def draw_panels(
    hht: xr.Dataset,
    axes: Sequence[Axes],
    limit: float | None = None,
    natural: Mapping[str, float] | None = None,
    mode: int = 1,
) -> list[Axes]:
    """Draw the signal with its intrinsic mode in the upper axes, its energy in the lower ones."""
    upper, lower = axes
    scale = scale_of(hht["signal"])
    time = scale_for("s", float(hht["time"].values[-1]))
    x = hht["time"].values * time.factor
    upper.plot(x, hht["signal"].values * scale.factor, color="0.55", linewidth=0.7, label="recorded")
    name = f"mode {mode}" + (", windowed" if hht.attrs["contact"] == "masked" else "")
    upper.plot(x, hht["imf"].sel(mode=mode).values * scale.factor, color="C0", label=name)
    label = scale.label(short_name(hht["signal"].rename(hht.attrs["signal"])))
    upper.set_ylabel(fill(label, _LABEL_WIDTH))
    upper.locator_params(axis="y", nbins=5)
    low, high = upper.get_ylim()
    upper.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    upper.legend(loc="upper right", ncols=2)
    _shade(hht, upper, time.factor)
    mesh = _draw_energy(hht, lower, limit, natural or {}, mode)
    upper.label_outer()
    upper.figure.align_ylabels([upper, lower])
    _add_bar(lower, [upper, lower], mesh)
    return [upper, lower]


def _draw_energy(
    hht: xr.Dataset, ax: Axes, limit: float | None, natural: Mapping[str, float], mode: int
) -> ScalarMappable:
    import matplotlib
    from scipy.ndimage import gaussian_filter1d

    middle = next(filter(math.isfinite, (f for _, f in _middles(hht, mode))), None)
    if middle is None:
        raise InputError(f"hht: {hht.attrs['signal']} {_refusal(hht, mode)}")
    limit = limit or 2.0 * max(middle, *natural.values(), 0.0)
    picture = energy_picture(hht, limit, n_frequency=200, mode=mode)
    time = scale_for("s", float(hht["time"].values[-1]))
    energy = gaussian_filter1d(picture.values, _BLUR * picture.sizes["frequency"], axis=0, mode="constant")
    with np.errstate(divide="ignore"):
        level = 10 * np.log10(energy / (energy.max() or 1.0))
    _shade(hht, ax, time.factor)
    cmap = matplotlib.colormaps["viridis_r"].copy()
    mesh: ScalarMappable = ax.pcolormesh(
        picture["time"].values * time.factor,
        picture["frequency"].values,
        np.ma.masked_less(level, -_DECIBELS),
        cmap=cmap,
        vmin=-_DECIBELS,
        vmax=0.0,
        rasterized=True,
        zorder=2,
    )
    ax.set(xlim=(0, float(hht["time"].values[-1]) * time.factor), ylim=(0, limit))
    ax.set(xlabel=time.label("Time"), ylabel=fill("Instantaneous frequency (Hz)", _LABEL_WIDTH))
    for name, frequency in natural.items():
        if 0 < frequency < limit:
            label = f"{name} {plain_number(frequency)} Hz"
            ax.axhline(frequency, color="C1", linewidth=0.7, linestyle="--", zorder=1, label=label)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper right", handlelength=2.2)
    return mesh


def _shade(hht: xr.Dataset, ax: Axes, factor: float) -> None:
    time = hht["time"].values
    dt = time[1] - time[0]
    for first, end in zip(*runs_of(hht["contact"].values), strict=True):
        ax.axvspan(first * dt * factor, end * dt * factor, color=_SHADE, linewidth=0, zorder=0)


def _add_bar(ax: Axes, beside: list[Axes], mesh: ScalarMappable) -> None:
    bar = ax.figure.colorbar(mesh, ax=beside, pad=0.02, aspect=30)
    bar.set_label("Energy (dB of its peak)")


def _middles(hht: xr.Dataset, mode: int) -> Iterator[tuple[str, float]]:
    """Yield the median frequency out of contact and in it, Hz."""
    yield "out of contact", float(median_frequency(hht, mode))
    yield "in contact", float(median_frequency(hht, mode, contact=True))


def _refusal(hht: xr.Dataset, mode: int) -> str:
    """Say why a signal has no frequency, and what to do."""
    if not hht["signal"].any():
        return "is zero throughout; select another stator or signal"
    if hht["contact"].all() and hht.attrs["contact"] == "masked":
        return (
            "is in contact throughout these revolutions; keep contact (--contact kept) or select one stator"
        )
    where = "between contacts" if hht.attrs["contact"] == "masked" else "between contacts, nor in them"
    return (
        f"has no mode {mode} in these spans: it does not oscillate {where}; use more samples a revolution, "
        "or another signal"
    )


def _medians(shown: xr.Dataset, mode: int) -> Iterator[str]:
    (_, middle), (where, touching) = _middles(shown, mode)
    if not math.isfinite(middle):  # where no span oscillates the drawing refuses, with the reason
        if math.isfinite(touching):
            yield f"median frequency {where} {touching:.2f} Hz; no span out of contact oscillates"
        return
    each = ", ".join(f"{f:.1f}" for f in span_frequencies(shown, mode).dropna("span").values)
    is_unknown = MEASURED in shown.attrs and not shown["contact"].any()
    where = "" if is_unknown else " out of contact"
    yield f"median frequency{where} {middle:.2f} Hz (span by span: {each})"
    spread = {str(name): float(width) for name, width in contact_bandwidth(shown, mode).items()}
    if math.isfinite(spread["contact"]):
        yield f"interquartile spread {spread['contact']:.0f} Hz in contact, {spread['free']:.0f} Hz free"
