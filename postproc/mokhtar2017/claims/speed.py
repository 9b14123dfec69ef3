"""Over speed (Figs. 5 and 20): orbits at the pseudo-critical speeds, and the cascade of torsional spectra."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from postproc.mokhtar2017.claims.cases import STIFF, cases
from postproc.mokhtar2017.claims.claim import Claim, Finding, claim, report
from postproc.mokhtar2017.claims.loops import loops_of
from postproc.mokhtar2017.claims.measures import height, orbit_size, percent, strongest, within
from postproc.signals.cascade import cascade
from postproc.signals.lines import strongest_lines

if TYPE_CHECKING:
    import xarray as xr

PAPER_SPEEDS = slice(0, None, 2)  # the cascade of the paper takes every other speed of the store
_NEAR = 0.25  # of the pseudo-critical frequency; a line further off does not pass it


def largest_orbit(store: xr.Dataset, low: float, high: float) -> xr.Dataset:
    """Return the case with the largest orbit between two speed ratios, on the stiff stator."""
    near = cases(store, speed_ratio=slice(low, high), stator_youngs_modulus=STIFF)
    return near.sel(speed_ratio=float(orbit_size(near).idxmax("speed_ratio"))).load()


def torsional_cascade(store: xr.Dataset) -> xr.DataArray:
    """Return the spectra of the torsion on the stiff stator at the speeds of the paper's cascade."""
    return cascade(cases(store, stator_youngs_modulus=STIFF).isel(speed_ratio=PAPER_SPEEDS)).compute()


def pseudo_critical_frequency(store: xr.Dataset) -> float:
    """Return the spin frequency (Hz) at which the synchronous orbit on the stiff stator is largest."""
    return float(largest_orbit(store, 1.2, 2.4)["spin_speed"]) / (2 * math.pi)


def crest(spectra: xr.DataArray, order: Fraction, frequency: float) -> float:
    """Return the speed ratio at which the line of an order is highest while it passes a frequency (Hz).

    NaN where it only rises, or only falls, within a quarter of that frequency.
    """
    line = spectra.sel(order=float(order), method="nearest", tolerance=1e-6)
    line = line[abs(line["frequency"].values - frequency) <= _NEAR * frequency]
    at = int(np.argmax(line.values))
    return float(line["speed_ratio"][at]) if 0 < at < line.size - 1 else math.nan


def _resonance(store: xr.Dataset, low: float, high: float, band: tuple[float, float], period: int) -> Finding:
    case = largest_orbit(store, low, high)
    at, loops = float(case["speed_ratio"]), loops_of(case)
    frequency = float(case["spin_speed"]) / (2 * math.pi)
    found = f"r {at:.1f} ({frequency:.1f} Hz), period {int(case['period'])}, loops {loops}"
    return Finding(found, within(at, *band) and int(case["period"]) == period == loops)


@claim(
    "C04",
    "5a",
    "speed",
    says="30 GPa, cg 0.70, r 1.2 to 2.4: the orbit is largest at r 1.7, in a single loop, once a revolution",
    expected="r 1.6 to 1.8, period 1, 1 loop",
)
def first_pseudo_critical_speed(store: xr.Dataset) -> Finding:
    """Find the largest orbit, its period and its loops."""
    return _resonance(store, 1.2, 2.4, (1.6, 1.8), period=1)


@claim(
    "C05",
    "5b",
    "speed",
    says="Same, r 2.8 to 4.0: resonance of the half order at r 3.5, in two revolutions",
    expected="r 3.2 to 3.7, period 2, 2 loops",
)
def second_pseudo_critical_speed(store: xr.Dataset) -> Finding:
    """Find the largest orbit, its period and its loops."""
    return _resonance(store, 2.8, 4.0, (3.2, 3.7), period=2)


@claim(
    "C06",
    "5c",
    "speed",
    says="Same, r 4.6 to 6.0: resonance of the third order at r 5.3, in three revolutions",
    expected="r 4.8 to 5.5, period 3, 3 loops",
)
def third_pseudo_critical_speed(store: xr.Dataset) -> Finding:
    """Find the largest orbit, its period and its loops."""
    return _resonance(store, 4.6, 6.0, (4.8, 5.5), period=3)


@claim(
    "C70",
    "20",
    "speed",
    says="30 GPa, cg 0.70, r 0.9 to 6.1: torsion is dominated by 3X at r 1.3, 2X at r 1.9, 1X at r 4.1",
    expected="strongest line within one bin of each",
)
def torsion_is_dominated_by_the_order_near_its_mode(store: xr.Dataset) -> Finding:
    """Compare the strongest line at each speed with the order."""
    spectra = torsional_cascade(store)
    bin_width = float(spectra["order"][1]) * (1 + 1e-9)
    found, holds = [], True
    for speed, order in ((1.3, 3.0), (1.9, 2.0), (4.1, 1.0)):
        line = strongest_lines(spectra.sel(speed_ratio=speed, method="nearest"), 1)
        name, at, hertz = (line[n].values[0] for n in ("name", "order", "frequency"))
        holds &= abs(float(at) - order) <= bin_width
        found.append(f"r {speed}: {name} ({hertz:.1f} Hz)")
    return Finding("; ".join(found), bool(holds))


@claim(
    "C71",
    "20",
    "speed",
    says="Same: lines that pass the pseudo-critical frequency crest at r 1.7 (1X), 3.5 (1/2X), 5.3 (1/3X)",
    expected="within 0.2 in r",
)
def lines_crest_at_the_pseudo_critical_frequency(store: xr.Dataset) -> Finding:
    """Follow each line past the frequency of the largest synchronous orbit."""
    spectra, frequency = torsional_cascade(store), pseudo_critical_frequency(store)
    printed = {Fraction(1): 1.7, Fraction(1, 2): 3.5, Fraction(1, 3): 5.3}
    crests = {order: crest(spectra, order, frequency) for order in printed}
    found = ", ".join(f"{order}X at r {at:.1f}" for order, at in crests.items())
    holds = all(abs(at - printed[order]) <= 0.2 + 1e-9 for order, at in crests.items())
    return Finding(f"{found}; frequency {frequency:.1f} Hz", holds)


@claim(
    "C72",
    "20",
    "speed",
    says="Same: strong multiples of 1/3X at r 5.3 and of 1/2X at r 3.5",
    expected="the first four over 5 % of the strongest line",
)
def multiples_of_the_subharmonic_are_strong(store: xr.Dataset) -> Finding:
    """Compare four multiples with the strongest line."""
    spectra = torsional_cascade(store)
    found, holds = [], True
    for speed, order in ((5.3, Fraction(1, 3)), (3.5, Fraction(1, 2))):
        line = spectra.sel(speed_ratio=speed, method="nearest")
        peak = strongest(line)[0][2]
        heights = [height(line, k * order) for k in (1, 2, 3, 4)]
        holds &= min(heights) > 0.05 * peak
        found.append(f"r {speed}: {', '.join(percent(h, peak) for h in heights)}")
    return Finding("; ".join(found), bool(holds))


@report(
    "D6",
    "20",
    "speed",
    says="Same: at r 5.7 the strongest torsion line is named 14/20 X (126 Hz)",
    reason="it takes a period of 20 revolutions",
)
def line_at_speed_ratio_5_7(store: xr.Dataset) -> str:
    """Name the strongest line."""
    case = cases(store, speed_ratio=5.7, stator_youngs_modulus=STIFF)
    ((name, hertz, _),) = strongest(torsional_cascade(store).sel(speed_ratio=5.7, method="nearest"))
    return f"{name} ({hertz:.1f} Hz), period {int(case['period'])}"


CLAIMS: tuple[Claim, ...] = (
    first_pseudo_critical_speed,
    second_pseudo_critical_speed,
    third_pseudo_critical_speed,
    torsion_is_dominated_by_the_order_near_its_mode,
    lines_crest_at_the_pseudo_critical_frequency,
    multiples_of_the_subharmonic_are_strong,
    line_at_speed_ratio_5_7,
)
