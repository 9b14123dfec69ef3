"""Models of the stator (Figs. 3 and 4): free to bend or held, and a fixed wall with a contact stiffness."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from postproc.mokhtar2017.claims.cases import SMALL_GAP_CASE, cases
from postproc.mokhtar2017.claims.claim import Claim, report
from postproc.mokhtar2017.claims.measures import MICRO, peak_to_peak, written
from postproc.signals.spectra import samples_per_revolution

if TYPE_CHECKING:
    import xarray as xr

_OTHER_RIG = "the rig of this figure is not in the paper"


def tilt(case: xr.Dataset) -> float:
    """Return how far the long axis of an orbit leans from the vertical, rad, positive with the spin."""
    path = case["vertical"].values + 1j * case["horizontal"].values
    return float(np.angle(np.mean((path - path.mean()) ** 2))) / 2


@report(
    "C80",
    "3",
    "lateral_freedom",
    says="Stator free to bend or not, updated normal, r 0.75, 1.5, 3: the orbit tilts with it, most at r 1.5",
    reason=_OTHER_RIG,
)
def freedom_to_bend_tilts_the_orbit(store: xr.Dataset) -> str:
    """Report the tilt of the orbit and the vertical motion with and without it."""
    found = []
    for speed in store["speed_ratio"].values:
        free, held = (cases(store, speed_ratio=speed, stator_1_lateral=on) for on in (1, 0))
        tilts = [math.degrees(tilt(case)) for case in (free, held)]
        sizes = [1e6 * float(case["peak_to_peak_vertical"]) for case in (free, held)]
        found.append(
            f"r {speed:g}: {tilts[0]:.0f}° against {tilts[1]:.0f}°, "
            f"vertical {sizes[0]:.0f} against {sizes[1]:.0f} µm"
        )
    return "; ".join(found)


def unevenness(signal: xr.DataArray) -> float:
    """Return how far the peak-to-peak values of single revolutions range, over their mean."""
    sizes = np.ptp(signal.values.reshape(-1, samples_per_revolution(signal)), axis=1)
    return float(np.ptp(sizes) / sizes.mean())


@report(
    "C81",
    "4",
    "penalty",
    "subcritical",
    says="Conventional law (fixed wall, contact stiffness, Coulomb friction) against the multiplier: "
    "vertical motion close, torsion larger and less regular",
    reason=f"{_OTHER_RIG}, nor is its contact stiffness",
)
def conventional_law_twists_more(penalty: xr.Dataset, multiplier: xr.Dataset) -> str:
    """Report sizes, periods and the unevenness of successive revolutions with either law."""
    found = []
    for name, case in (("wall", cases(penalty)), ("multiplier", cases(multiplier, **SMALL_GAP_CASE))):
        parts = [f"{name}: period {int(case['period'])}"]
        for signal, unit in (("vertical", "µm"), ("torsion", "µrad")):
            size = written(peak_to_peak(case[signal]), unit, MICRO)
            parts.append(f"{signal} {size} (uneven by {100 * unevenness(case[signal]):.2g} %)")
        found.append(", ".join(parts))
    return "; ".join(found)


CLAIMS: tuple[Claim, ...] = (freedom_to_bend_tilts_the_orbit, conventional_law_twists_more)
