"""Friction (Figs. 10 to 12): what grows with it, and what does not."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.mokhtar2017.claims.cases import LARGE_GAP_CASE, cases
from postproc.mokhtar2017.claims.claim import Claim, Finding, claim
from postproc.mokhtar2017.claims.loops import loops_of
from postproc.mokhtar2017.claims.measures import (
    MICRO,
    height,
    peak_to_peak,
    rises,
    spectrum,
    strongest,
    within,
    written,
)
from postproc.signals.hilbert_huang import hilbert_huang, median_frequency

if TYPE_CHECKING:
    import xarray as xr

FRICTIONS = [0.1, 0.3, 0.5]
_FIXED = "the normal is fixed"
_N_LINE = 5


@claim(
    "C30",
    "10",
    "subcritical",
    says="r 0.75, g 100 µm, friction 0.1, 0.3, 0.5: torsion and stator lateral grow, their lines stay",
    expected=f"as 1 : 3 : 5 within 2 %, since {_FIXED}; same five strongest lines",
)
def response_is_proportional_to_friction(store: xr.Dataset) -> Finding:
    """Compare peak-to-peak values with their first, and the names of the strongest lines."""
    every = cases(store, **LARGE_GAP_CASE | {"friction": FRICTIONS})
    found, holds = [], True
    for name, signal in (("torsion", "torsion"), ("lateral", "stator_lateral")):
        size = peak_to_peak(every[signal]).values
        ratios = size / size[0]
        holds &= all(abs(ratio / whole - 1) <= 0.02 for ratio, whole in zip(ratios, (1, 3, 5), strict=True))
        found.append(f"{name} 1 : {ratios[1]:.3f} : {ratios[2]:.3f}")
    names = {
        tuple(line[0] for line in strongest(spectrum(every.sel(friction=mu), "torsion"), _N_LINE))
        for mu in every["friction"].values
    }
    found.append(f"torsion lines {', '.join(sorted(names)[0])}" if len(names) == 1 else "lines differ")
    return Finding("; ".join(found), bool(holds) and len(names) == 1)


@claim(
    "C31",
    "11",
    "friction",
    says="r 3, g 76 µm, same frictions: torsion and horizontal motion grow, vertical does not",
    expected="monotone; vertical within 5 %",
)
def friction_moves_the_rotor_sideways(store: xr.Dataset) -> Finding:
    """Compare peak-to-peak values over friction."""
    every = cases(store)
    torsion, horizontal, vertical = (
        peak_to_peak(every[n]).values for n in ("torsion", "horizontal", "vertical")
    )
    found = (
        f"torsion {written(torsion, 'mrad', 1e3)}; horizontal {written(horizontal, 'µm', MICRO)}; "
        f"vertical {written(vertical, 'µm', MICRO)}"
    )
    steady = vertical.max() / vertical.min() - 1 <= 0.05
    return Finding(found, rises(torsion) and rises(horizontal) and bool(steady))


@claim(
    "C32",
    "12a",
    "friction",
    says="Same, friction 0.3: horizontal motion has 1/2X (47.3 Hz) above 1X (94.7 Hz), and a small 3/2X",
    expected="frequencies within 0.4 Hz; 1/2X over 1X over 3/2X over 1 % of 1/2X",
)
def horizontal_has_the_half_order(store: xr.Dataset) -> Finding:
    """Compare the three lines."""
    lines = spectrum(cases(store, friction=0.3), "horizontal")
    half, first, three_halves = (height(lines, order) for order in (0.5, 1.0, 1.5))
    (name, hertz, _), (_, next_hertz, _) = strongest(lines, 2)
    near = abs(hertz - 47.3) <= 0.4 and abs(next_hertz - 94.7) <= 0.4
    found = (
        f"{name} ({hertz:.2f} Hz) first; 1/2X, 1X, 3/2X: {written([half, first, three_halves], 'µm', MICRO)}"
    )
    return Finding(found, near and half > first > three_halves > 0.01 * half)


@claim(
    "C33",
    "12b",
    "friction",
    says="Same: Hilbert-Huang spectrum of torsion shows 128 Hz out of contact",
    expected="amplitude-weighted median 122 to 134 Hz",
)
def torsion_rings_between_contacts(store: xr.Dataset) -> Finding:
    """Take the first intrinsic mode with contact masked."""
    median = float(median_frequency(hilbert_huang(cases(store, friction=0.3), "torsion")))
    return Finding(f"{median:.1f} Hz", within(median, 122, 134))


@claim("C34", "11b", "friction", says="Same: orbit of two loops", expected="period 2, 2 loops")
def orbit_has_two_loops(store: xr.Dataset) -> Finding:
    """Read the period and count the loops of the orbit."""
    case = cases(store, friction=0.3)
    period, loops = int(case["period"]), loops_of(case)
    return Finding(f"period {period}, loops {loops}", period == 2 == loops)


CLAIMS: tuple[Claim, ...] = (
    response_is_proportional_to_friction,
    friction_moves_the_rotor_sideways,
    horizontal_has_the_half_order,
    torsion_rings_between_contacts,
    orbit_has_two_loops,
)
