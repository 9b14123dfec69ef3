"""Hilbert spectra in panels of the paper's figures, with the natural frequency that each should show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from postproc.figures.hht import energy_time_frequency
from postproc.figures.waveform import shade_contacts
from postproc.mokhtar2017.figures.panels import legend, tidy
from postproc.signals.hilbert_huang import hilbert_huang
from postproc.store.rig_of_case import natural_frequencies, stator_frequencies
from postproc.store.units import scale_of, short_name
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.axes import Axes


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
