"""Where the paper disagrees with itself or leaves its model's range: reported only."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.mokhtar2017.claims.cases import LARGE_GAP_CASE, SMALL_GAP_CASE, SOFT, STIFF, cases
from postproc.mokhtar2017.claims.claim import Claim, report
from postproc.mokhtar2017.claims.measures import MICRO, orbit_size, peak_to_peak, written
from postproc.signals.contacts import contact_spans

if TYPE_CHECKING:
    import xarray as xr


@report(
    "D1",
    "5",
    "speed",
    says="Pseudo-critical speeds r 1.7, 3.5, 5.3; the caption names no modulus",
    reason="they belong to 30 GPa",
)
def pseudo_critical_speeds(store: xr.Dataset) -> str:
    """Report where the orbits of period 1, 2 and 3 are largest, for both moduli."""
    found = []
    for modulus in (SOFT, STIFF):
        every = cases(store, stator_youngs_modulus=modulus)
        size, period = orbit_size(every), every["period"].compute()
        speeds = [float(size.where(period == n).idxmax("speed_ratio")) for n in (1, 2, 3)]
        found.append(f"{modulus / 1e9:.0f} GPa: r {', '.join(f'{speed:.1f}' for speed in speeds)}")
    return "; ".join(found)


@report(
    "D2",
    "3, 5, 17, 18",
    "subcritical",
    "lateral_freedom",
    says="One normal for all figures",
    reason="Fig. 3 needs the updated one, the others the fixed one",
)
def normals(fixed: xr.Dataset, updated: xr.Dataset) -> str:
    """Report the peak reaction at r 0.75, cg 0.70 with either normal."""
    force = float(cases(fixed, **SMALL_GAP_CASE)["peak_contact_force"])
    turning = float(cases(updated, speed_ratio=0.75, stator_1_lateral=1)["peak_contact_force"])
    return f"peak reaction at r 0.75, cg 0.70: {force:.1f} N fixed, {turning:.1f} N updated"


@report(
    "D3",
    "16, 18",
    "resonance",
    "clearance",
    says="cg of 150 µm at r 1.5 is 0.70, of 70 µm at r 2 is 0.55 (0.54 in Fig. 15)",
    reason="the paper's values disagree",
)
def clearance_ratios(near: xr.Dataset, above: xr.Dataset) -> str:
    """Report the clearance over the contact-free amplitude."""
    ratios = [
        float(gap / cases(store)["contact_free_amplitude"]) for gap, store in ((150e-6, near), (70e-6, above))
    ]
    return f"{ratios[0]:.2f} and {ratios[1]:.2f}"


@report(
    "D4",
    "6, 7, 13",
    "subcritical",
    says="r 0.75: reaction up to 10 N, torsion within 75 µrad",
    reason="Table 1 gives twice that at these gaps; the levels of Fig. 9 agree with it",
)
def levels_below_the_critical_speed(store: xr.Dataset) -> str:
    """Report the successive peaks of the reaction, and the peak of torsion, for both gaps."""
    found = []
    for choice in (LARGE_GAP_CASE, SMALL_GAP_CASE):
        case = cases(store, **choice)
        peaks = sorted(set(contact_spans(case)["peak_force"].values.round(1)))
        torsion = float(case["peak_torsion"]) * MICRO
        found.append(f"{1e6 * choice['clearance']:.0f} µm: {written(peaks, 'N')}, {torsion:.0f} µrad")
    return "; ".join(found)


@report(
    "D5",
    "13b",
    "subcritical",
    says="Torsion is 10 % lower at 84 µm than at 100 µm",
    reason="the size of the drop depends on the damping, which is not stated; its sign holds",
)
def torsion_over_the_gap(store: xr.Dataset) -> str:
    """Report the change of the peak-to-peak value."""
    large, small = (
        float(peak_to_peak(cases(store, **choice)["torsion"])) for choice in (LARGE_GAP_CASE, SMALL_GAP_CASE)
    )
    return f"peak to peak {written([large, small], 'µrad', MICRO)} ({100 * (small / large - 1):+.0f} %)"


@report(
    "D7",
    "5, 11, 18",
    "resonance",
    "friction",
    "speed",
    says="The model holds at r 1.5 and 3 (3 GPa) and at the resonances of 30 GPa",
    reason="force over the Euler load, a tip that moves far, slip that changes sign",
)
def range_of_the_model(near: xr.Dataset, twice: xr.Dataset, speed: xr.Dataset) -> str:
    """Report the validity monitors of these cases."""
    shown = {
        "r 1.5": cases(near, stator_youngs_modulus=SOFT),
        "r 3": cases(twice, friction=0.5),
        "r 1.7, 30 GPa": cases(speed, speed_ratio=1.7, stator_youngs_modulus=STIFF),
        "r 3.5, 30 GPa": cases(speed, speed_ratio=3.5, stator_youngs_modulus=STIFF),
        "r 5.3, 30 GPa": cases(speed, speed_ratio=5.3, stator_youngs_modulus=STIFF),
    }
    return "; ".join(
        f"{name}: {float(case['force_over_euler_load']):.2g} of the Euler load, "
        f"tip {100 * float(case['tip_deflection_ratio']):.0f} % of its length, "
        f"slip down to {float(case['minimum_slip_speed']):.0f} m/s"
        for name, case in shown.items()
    )


CLAIMS: tuple[Claim, ...] = (
    pseudo_critical_speeds,
    normals,
    clearance_ratios,
    levels_below_the_critical_speed,
    torsion_over_the_gap,
    range_of_the_model,
)
