"""The quantities of stored cases that claims are about, and how they are written."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from postproc.mokhtar2017.claims.loops import loops_of
from postproc.signals.cascade import cascade
from postproc.signals.contacts import contact_spans, event_jumps, free_decay
from postproc.signals.hilbert_huang import (
    contact_bandwidth,
    hilbert_huang,
    median_frequency,
    span_frequencies,
)
from postproc.signals.lines import strongest_lines
from postproc.signals.spectra import samples_per_revolution, spectrum_data

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from fractions import Fraction

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

STATOR = 803.0  # Hz, printed in Table 1
_REVOLUTIONS = 24  # of the records at r = 0.75 that a Hilbert spectrum takes; the motion repeats after two
_CYCLES = 5
_EVERY_OTHER = slice(0, None, 2)  # the cascade of the paper takes every other speed of the store
_NEAR = 0.25  # of the pseudo-critical frequency; a line further off does not pass it


class Line(NamedTuple):
    """A line of a spectrum: name, frequency (Hz), amplitude (the unit of the signal) and order."""

    name: str
    hertz: float
    amplitude: float
    order: float


# Sizes and orbits


def sizes(cases: xr.Dataset, *signals: str) -> tuple[Floats, ...]:
    """Return the peak-to-peak values of some signals, in their units."""
    ranges = (cases[name].max("sample") - cases[name].min("sample") for name in signals)
    return tuple(found.values.astype(float) for found in ranges)


def orbit_size(cases: xr.Dataset) -> xr.DataArray:
    """Return how far the orbit of the disc reaches from its centre, m."""
    vertical, horizontal = (cases[n] - cases[n].mean("sample") for n in ("vertical", "horizontal"))
    found: xr.DataArray = (vertical**2 + horizontal**2).max("sample").compute()
    return found**0.5


def compression(cases: xr.Dataset) -> Floats:
    """Return the peak compression of the stator, m."""
    return np.asarray(cases["stator_axial"].max("sample").values, dtype=float)


def period(case: xr.Dataset) -> int:
    """Return the period of a case, revolutions; 0 of none."""
    return int(case["period"])


def repetition(case: xr.Dataset) -> tuple[int, int]:
    """Return the period of a case and the number of loops of its orbit."""
    return period(case), loops_of(case)


def tilt(case: xr.Dataset) -> float:
    """Return how far the long axis of an orbit leans from the vertical, rad, positive with the spin."""
    path = case["vertical"].values + 1j * case["horizontal"].values
    return float(np.angle(np.mean((path - path.mean()) ** 2))) / 2


def unevenness(signal: xr.DataArray) -> float:
    """Return how far the peak-to-peak values of single revolutions range, over their mean."""
    of_turns = np.ptp(signal.values.reshape(-1, samples_per_revolution(signal)), axis=1)
    return float(np.ptp(of_turns) / of_turns.mean())


# Over speed


def largest_orbit(cases: xr.Dataset) -> xr.Dataset:
    """Return the case with the largest orbit of those over speed."""
    return cases.sel(speed_ratio=float(orbit_size(cases).idxmax("speed_ratio"))).load()


def resonance(cases: xr.Dataset) -> tuple[float, float, int, int]:
    """Return speed ratio, spin frequency (Hz), period and loops of the largest orbit."""
    case = largest_orbit(cases)
    return float(case["speed_ratio"]), spin_frequency(case), *repetition(case)


def spin_frequency(case: xr.Dataset) -> float:
    """Return the spin frequency of a case, Hz."""
    return float(case["spin_speed"]) / (2 * math.pi)


def torsional_cascade(cases: xr.Dataset) -> xr.DataArray:
    """Return the spectra of the torsion at the speeds of the paper's cascade."""
    return cascade(cases.isel(speed_ratio=_EVERY_OTHER)).compute()


def at_speed(spectra: xr.DataArray, ratio: float) -> xr.DataArray:
    """Return the spectrum of a cascade nearest to a speed ratio."""
    return spectra.sel(speed_ratio=ratio, method="nearest")


def dominating(cases: xr.Dataset, *ratios: float) -> tuple[Any, ...]:
    """Return the resolution of the torsional cascade, orders, and its strongest line at some speed ratios."""
    spectra = torsional_cascade(cases)
    resolution = float(spectra["order"][1]) * (1 + 1e-9)
    return resolution, *(strongest(at_speed(spectra, ratio))[0] for ratio in ratios)


def multiples(cases: xr.Dataset, orders: Mapping[float, Fraction]) -> dict[float, list[float]]:
    """Return the first four multiples of an order over the strongest torsion line at each speed ratio."""
    spectra = torsional_cascade(cases)
    found = {}
    for ratio, order in orders.items():
        line = at_speed(spectra, ratio)
        peak = strongest(line)[0].amplitude
        found[ratio] = [height / peak for height in heights(line, *(k * order for k in (1, 2, 3, 4)))]
    return found


def crests(
    cases: xr.Dataset, synchronous: xr.Dataset, orders: Iterable[Fraction]
) -> tuple[dict[Fraction, float], float]:
    """Return the crests of some torsion lines at the pseudo-critical frequency, and this frequency, Hz.

    It is the spin frequency of the largest of the `synchronous` orbits.
    """
    spectra, frequency = torsional_cascade(cases), spin_frequency(largest_orbit(synchronous))
    return {order: crest(spectra, order, frequency) for order in orders}, frequency


def largest_by_period(cases: xr.Dataset) -> list[float]:
    """Return the speed ratios at which the orbits of period 1, 2 and 3 are largest."""
    size, periods = orbit_size(cases), cases["period"].compute()
    return [float(size.where(periods == n).idxmax("speed_ratio")) for n in (1, 2, 3)]


def crest(spectra: xr.DataArray, order: Fraction, frequency: float) -> float:
    """Return the speed ratio at which the line of an order is highest while it passes a frequency (Hz).

    NaN where it only rises, or only falls, within a quarter of that frequency.
    """
    line = spectra.sel(order=float(order), method="nearest", tolerance=1e-6)
    line = line[abs(line["frequency"].values - frequency) <= _NEAR * frequency]
    at = int(np.argmax(line.values))
    return float(line["speed_ratio"][at]) if 0 < at < line.size - 1 else math.nan


# Lines


def spectrum(case: xr.Dataset, signal: str) -> xr.DataArray:
    """Return the spectrum of a signal over whole periods, with its frequencies in Hz."""
    return spectrum_data(case, signal).compute()


def heights(spectrum: xr.DataArray, *orders: float | Fraction) -> tuple[float, ...]:
    """Return the amplitudes of the lines at some orders; the record holds whole numbers of their cycles."""
    found = (spectrum.sel(order=float(order), method="nearest", tolerance=1e-6) for order in orders)
    return tuple(map(float, found))


def strongest(spectrum: xr.DataArray, n_line: int = 1) -> tuple[Line, ...]:
    """Return the strongest lines, the strongest first."""
    lines = strongest_lines(spectrum, n_line)
    columns = (lines[n].values.tolist() for n in ("name", "frequency", "amplitude", "order"))
    return tuple(map(Line, *columns))


def strongest_along(cases: xr.Dataset, signal: str, axis: str) -> tuple[Line, ...]:
    """Return the strongest line of a signal of each case along an axis."""
    each = (cases.isel({axis: i}) for i in range(cases.sizes[axis]))
    return tuple(strongest(spectrum(case, signal))[0] for case in each)


def half_orders(case: xr.Dataset) -> float:
    """Return the highest of 1/2X, 3/2X and 5/2X in the vertical motion over 1X."""
    first, *halves = heights(spectrum(case, "vertical"), 1, 0.5, 1.5, 2.5)
    return max(halves) / first


# Contacts and what they leave


def alternating(values: Floats) -> tuple[float, float]:
    """Return the means of every other value, the larger first."""
    n = values.size // 2 * 2
    low, high = sorted((float(np.mean(values[:n:2])), float(np.mean(values[1:n:2]))))
    return high, low


def durations(case: xr.Dataset) -> tuple[float, float, float]:
    """Return the mean duration of contacts as they passed, and the shortest and the longest recorded, s."""
    each = contact_spans(case)["duration"].values
    return float(case["contact_duration"]), each.min(), each.max()


def contact_rate(case: xr.Dataset) -> tuple[float, float, float, int, int]:
    """Return contacts a revolution and the part of the time, as they passed, and the part of the samples.

    Then follow the revolutions without a whole contact, as the ends of the record may cut one, and the
    samples of a revolution.
    """
    force = case["contact_force"]
    n_sample = samples_per_revolution(force)
    n_lacking = force.sizes["sample"] // n_sample - contact_spans(case).sizes["span"]
    rate, share = float(case["contacts_per_revolution"]), float(case["contact_fraction"])
    return rate, share, float((force > 0).mean()), n_lacking, n_sample


def least_jumps(case: xr.Dataset) -> tuple[float, float]:
    """Return the least departure from smooth torsional acceleration at touch and at release, over the rms."""
    jumps = event_jumps(case)
    touch, release = (
        float(jumps["ratio"][jumps["kind"].values == kind].min()) for kind in ("touch", "release")
    )
    return touch, release


def decay_rates(cases: xr.Dataset, axis: str) -> list[float]:
    """Return the median decay rate of the stator out of contact for each value of an axis, 1/s."""
    each = (cases.isel({axis: i}) for i in range(cases.sizes[axis]))
    return [float(np.median(free_decay(case)["decay_rate"])) for case in each]


def torsion_median(case: xr.Dataset, revolutions: int | None = _REVOLUTIONS) -> float:
    """Return the median frequency of torsion out of contact, weighted with its amplitude, Hz."""
    return float(median_frequency(hilbert_huang(case, "torsion", revolutions=revolutions)))


def stator_ringing(case: xr.Dataset) -> tuple[float, float, float]:
    """Return the median after release that is farthest from 803 Hz, and the spreads in and out, Hz."""
    found = hilbert_huang(case, "stator_lateral", revolutions=_REVOLUTIONS)
    medians = span_frequencies(found, cycles=_CYCLES).values[1:-1]  # the record may cut the outer two
    spread = contact_bandwidth(found)
    farthest = medians[np.argmax(np.abs(medians - STATOR))]
    return float(farthest), float(spread["contact"]), float(spread["free"])


# What is expected of quantities


def near(value: float, expected: float, tolerance: float) -> bool:
    """Return whether a number is within a tolerance of another."""
    return abs(value - expected) <= tolerance


def rises(values: Any) -> bool:
    """Return whether each of some values is above the one before."""
    return bool((np.diff(np.asarray(values, dtype=float)) > 0).all())


def falls(values: Any) -> bool:
    """Return whether each of some values is below the one before."""
    return bool((np.diff(np.asarray(values, dtype=float)) < 0).all())


def steady(values: Floats, share: float) -> bool:
    """Return whether the largest of some values exceeds the smallest by at most a share."""
    return bool(values.max() / values.min() - 1 <= share)


def rings(farthest: float, contact: float, free: float) -> bool:
    """Return whether a stator rings at 803 Hz, and broadly in contact: a twentieth of it, twice the rest."""
    return near(farthest, STATOR, 0.02 * STATOR) and contact > max(40.0, 2 * free)


# How they are written


def written(values: Any, unit: str, factor: float = 1.0) -> str:
    """Write values in a row, with three digits or all before the point, and one unit."""
    numbers: Iterable[float] = np.atleast_1d(np.asarray(values, dtype=float)) * factor
    digits = (f"{number:.3g}" if abs(number) < 1000 else f"{number:.0f}" for number in numbers)
    return f"{', '.join(digits)} {unit}".rstrip()


micrometres = partial(written, unit="µm", factor=1e6)
millimetres = partial(written, unit="mm", factor=1e3)
microradians = partial(written, unit="µrad", factor=1e6)
milliradians = partial(written, unit="mrad", factor=1e3)
milliseconds = partial(written, unit="ms", factor=1e3)
newtons = partial(written, unit="N")


def percent(part: float, whole: float = 1.0) -> str:
    """Write a part of a whole in per cent."""
    return f"{100 * part / whole:.3g} %"


def change(values: Iterable[float]) -> str:
    """Write by how many per cent the second of two values is above the first."""
    first, second = values
    return f"({100 * (second / first - 1):+.0f} %)"
