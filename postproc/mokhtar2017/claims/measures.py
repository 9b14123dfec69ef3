"""Sizes and lines of recorded motion that claims compare, and how they are written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.signals.lines import strongest_lines
from postproc.signals.spectra import spectrum_data

if TYPE_CHECKING:
    from collections.abc import Iterable
    from fractions import Fraction

    import xarray as xr

MICRO = 1e6


def peak_to_peak(signal: xr.DataArray) -> xr.DataArray:
    """Return the peak-to-peak value of a signal, in its unit."""
    found: xr.DataArray = signal.max("sample") - signal.min("sample")
    return found.compute()


def orbit_size(cases: xr.Dataset) -> xr.DataArray:
    """Return how far the orbit of the disc reaches from its centre, m."""
    vertical, horizontal = (cases[n] - cases[n].mean("sample") for n in ("vertical", "horizontal"))
    found: xr.DataArray = (vertical**2 + horizontal**2).max("sample").compute()
    return found**0.5


def spectrum(case: xr.Dataset, signal: str) -> xr.DataArray:
    """Return the spectrum of a signal over whole periods, with its frequencies in Hz."""
    return spectrum_data(case, signal).compute()


def height(spectrum: xr.DataArray, order: float | Fraction) -> float:
    """Return the amplitude of the line at an order; the record holds a whole number of its cycles.

    Raises
    ------
    KeyError
        There is no line at that order.
    """
    return float(spectrum.sel(order=float(order), method="nearest", tolerance=1e-6))


def strongest(spectrum: xr.DataArray, n_line: int = 1) -> list[tuple[str, float, float]]:
    """Return name, frequency (Hz) and amplitude of the strongest lines, the strongest first."""
    lines = strongest_lines(spectrum, n_line)
    found = [lines[n].values for n in ("name", "frequency", "amplitude")]
    return [(str(n), float(f), float(a)) for n, f, a in zip(*found, strict=True)]


def rises(values: Any) -> bool:
    """Return whether each of some values is above the one before."""
    return bool((np.diff(np.asarray(values, dtype=float)) > 0).all())


def falls(values: Any) -> bool:
    """Return whether each of some values is below the one before."""
    return bool((np.diff(np.asarray(values, dtype=float)) < 0).all())


def within(value: float, low: float, high: float) -> bool:
    """Return whether a number lies between two others, ends included."""
    return bool(low <= value <= high)


def written(values: Any, unit: str, factor: float = 1.0) -> str:
    """Write values in a row, with three digits or all before the point, and one unit."""
    numbers: Iterable[float] = np.atleast_1d(np.asarray(values, dtype=float)) * factor
    digits = (f"{number:.3g}" if abs(number) < 1000 else f"{number:.0f}" for number in numbers)
    return f"{', '.join(digits)} {unit}".rstrip()


def percent(part: float, whole: float) -> str:
    """Write a part of a whole in per cent."""
    return f"{100 * part / whole:.3g} %"
