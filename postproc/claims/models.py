"""Models of the stator (Figs. 3 and 4): what freedom to bend does to the orbit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from postproc.claims.cases import cases
from postproc.claims.claim import Claim, report

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
    """Tell the tilt of the orbit and the vertical motion with and without it."""
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


CLAIMS: tuple[Claim, ...] = (freedom_to_bend_tilts_the_orbit,)
