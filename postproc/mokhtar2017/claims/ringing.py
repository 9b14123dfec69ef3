"""What rings between contacts (Figs. 8, 14c,d and 16c): Hilbert-Huang spectra of torsion and stator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.mokhtar2017.claims.cases import LARGE_GAP_CASE, SMALL_GAP_CASE, cases
from postproc.mokhtar2017.claims.claim import Claim, Finding, claim
from postproc.mokhtar2017.claims.measures import within
from postproc.signals.contacts import free_decay
from postproc.signals.hilbert_huang import (
    contact_bandwidth,
    hilbert_huang,
    median_frequency,
    span_frequencies,
)

if TYPE_CHECKING:
    import xarray as xr

_REVOLUTIONS = 24  # of each record; the motion repeats after two
_CYCLES = 5
_BROAD = 40.0  # Hz, a twentieth of the 803 Hz


def torsion_frequency(case: xr.Dataset) -> float:
    """Return the median frequency of torsion out of contact, weighted with its amplitude, Hz."""
    return float(median_frequency(hilbert_huang(case, "torsion", revolutions=_REVOLUTIONS)))


def stator_ringing(case: xr.Dataset) -> tuple[float, float, float]:
    """Return the median after release that is farthest from 803 Hz, and the spreads in and out, Hz."""
    found = hilbert_huang(case, "stator_lateral", revolutions=_REVOLUTIONS)
    medians = span_frequencies(found, cycles=_CYCLES).values[1:-1]  # the record may cut the outer two
    spread = contact_bandwidth(found)
    farthest = medians[np.argmax(np.abs(medians - 803.0))]
    return float(farthest), float(spread["contact"]), float(spread["free"])


def _rings(farthest: float, contact: float, free: float) -> bool:
    return abs(farthest - 803) <= 0.02 * 803 and contact > max(_BROAD, 2 * free)


@claim(
    "C22",
    "8b",
    "subcritical",
    says="r 0.75, g 100 µm: Hilbert-Huang spectrum of torsion, contact masked, shows 128 Hz",
    expected="first mode, amplitude-weighted median 125 to 131 Hz",
)
def torsion_rings_with_the_larger_gap(store: xr.Dataset) -> Finding:
    """Take the first intrinsic mode with contact masked."""
    median = torsion_frequency(cases(store, **LARGE_GAP_CASE))
    return Finding(f"{median:.1f} Hz", within(median, 125, 131))


@claim(
    "C23",
    "8c",
    "subcritical",
    says="Same: that of the stator's lateral motion shows 803 Hz after release, and is broad in contact",
    expected="2 % over the first five cycles; spread over 40 Hz in contact, and over twice that out of it",
)
def stator_rings_with_the_larger_gap(store: xr.Dataset) -> Finding:
    """Take the first intrinsic mode of the whole record."""
    farthest, contact, free = stator_ringing(cases(store, **LARGE_GAP_CASE))
    found = f"farthest {farthest:.1f} Hz; spread {contact:.0f} Hz in contact, {free:.0f} Hz out of it"
    return Finding(found, _rings(farthest, contact, free))


@claim(
    "C46",
    "14c,d",
    "subcritical",
    says="g 84 µm: torsion at 128 Hz, stator at 803 Hz; over 80 % of its amplitude gone in the free span",
    expected="as C22 and C23; under 20 % left",
)
def both_ring_with_the_smaller_gap(store: xr.Dataset) -> Finding:
    """Take the first intrinsic modes, and fit a decaying sine to each span out of contact."""
    case = cases(store, **SMALL_GAP_CASE)
    median = torsion_frequency(case)
    farthest, contact, free = stator_ringing(case)
    left = float(free_decay(case)["remaining"].max())
    found = (
        f"torsion {median:.1f} Hz; stator {farthest:.1f} Hz, spread {contact:.0f} Hz in contact, "
        f"{free:.0f} Hz out of it; {100 * left:.2g} % left"
    )
    rings = within(median, 125, 131) and _rings(farthest, contact, free)
    return Finding(found, rings and left < 0.2)


@claim(
    "C53",
    "16c",
    "clearance",
    says="r 2, 30 GPa, g 70 µm: Hilbert-Huang spectrum of torsion shows 128 Hz between contacts",
    expected="124 to 132 Hz",
)
def torsion_rings_above_the_critical_speed(store: xr.Dataset) -> Finding:
    """Take the first intrinsic mode with contact masked."""
    median = torsion_frequency(cases(store, clearance=70e-6))
    return Finding(f"{median:.1f} Hz", within(median, 124, 132))


CLAIMS: tuple[Claim, ...] = (
    torsion_rings_with_the_larger_gap,
    stator_rings_with_the_larger_gap,
    both_ring_with_the_smaller_gap,
    torsion_rings_above_the_critical_speed,
)
