"""Clearance (Figs. 13 to 16): what a smaller gap does below the critical speed and above it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.mokhtar2017.claims.cases import LARGE_GAP_CASE, SMALL_GAP_CASE, cases
from postproc.mokhtar2017.claims.claim import Claim, Finding, claim
from postproc.mokhtar2017.claims.loops import loops_of
from postproc.mokhtar2017.claims.measures import (
    MICRO,
    falls,
    height,
    peak_to_peak,
    percent,
    rises,
    spectrum,
    strongest,
    within,
    written,
)
from postproc.mokhtar2017.claims.rub import half_order_share
from postproc.signals.contacts import contact_spans, peak_after_contact

if TYPE_CHECKING:
    import xarray as xr

_SETTING = "r 2, 30 GPa, g 70, 90, 110 µm"


@claim(
    "C40",
    "13",
    "subcritical",
    says="r 0.75, g 84 µm: each revolution repeats, in a single loop",
    expected="period 1, 1 loop",
)
def smaller_gap_has_period_one(store: xr.Dataset) -> Finding:
    """Read the period and count the loops of the orbit."""
    case = cases(store, **SMALL_GAP_CASE)
    period, loops = int(case["period"]), loops_of(case)
    return Finding(f"period {period}, loops {loops}", period == 1 == loops)


@claim(
    "C41",
    "13c,d",
    "subcritical",
    says="Against g 100 µm: reaction and stator compression are 35 % higher (means of successive peaks)",
    expected="10 % to 80 % higher",
)
def smaller_gap_presses_harder(store: xr.Dataset) -> Finding:
    """Compare the mean peaks of one contact after the other."""
    large, small = (cases(store, **choice) for choice in (LARGE_GAP_CASE, SMALL_GAP_CASE))
    force = [float(contact_spans(case)["peak_force"].mean()) for case in (large, small)]
    compression = [float(peak_after_contact(case, "stator_axial").mean()) for case in (large, small)]
    ratios = [force[1] / force[0], compression[1] / compression[0]]
    found = (
        f"reaction {written(force, 'N')} ({100 * (ratios[0] - 1):+.0f} %), "
        f"compression {written(compression, 'µm', MICRO)} ({100 * (ratios[1] - 1):+.0f} %)"
    )
    return Finding(found, all(within(ratio, 1.1, 1.8) for ratio in ratios))


@claim(
    "C44",
    "14a",
    "subcritical",
    says="g 84 µm: vertical motion has 1X, 2X, 3X, and no half orders",
    expected="2X, 3X over 1 % of 1X, half orders under 0.5 %",
)
def vertical_has_whole_orders_only(store: xr.Dataset) -> Finding:
    """Compare the lines with 1X."""
    case = cases(store, **SMALL_GAP_CASE)
    lines = spectrum(case, "vertical")
    first, second, third = (height(lines, order) for order in (1, 2, 3))
    half = half_order_share(case)
    found = (
        f"1X {first * MICRO:.1f} µm; 2X {percent(second, first)}, 3X {percent(third, first)}, "
        f"half orders {percent(half, 1)}"
    )
    return Finding(found, min(second, third) > 0.01 * first and half < 0.005)


@claim(
    "C45",
    "14b",
    "subcritical",
    says="Same: torsion has 118.3 Hz (5X) first, 142 Hz (6X) second",
    expected="within 0.3 Hz",
)
def torsion_has_the_orders_on_either_side_of_its_mode(store: xr.Dataset) -> Finding:
    """Name the two strongest lines."""
    lines = strongest(spectrum(cases(store, **SMALL_GAP_CASE), "torsion"), 2)
    (first, low, _), (second, high, _) = lines
    found = ", ".join(f"{name} ({hertz:.2f} Hz, {a * MICRO:.1f} µrad)" for name, hertz, a in lines)
    holds = first == "5X" and second == "6X" and abs(low - 118.3) <= 0.3 and abs(high - 142.0) <= 0.3
    return Finding(found, holds)


@claim(
    "C50",
    "15",
    "clearance",
    says=f"{_SETTING}: vertical, torsion, reaction and both stator amplitudes fall with the gap",
    expected="monotone",
)
def less_gap_means_more_of_everything(store: xr.Dataset) -> Finding:
    """Compare peak-to-peak values and the peak reaction over the gap."""
    every = cases(store)
    sizes = {
        "vertical": (peak_to_peak(every["vertical"]), "µm", MICRO),
        "torsion": (peak_to_peak(every["torsion"]), "mrad", 1e3),
        "reaction": (every["peak_contact_force"], "N", 1.0),
        "axial": (peak_to_peak(every["stator_axial"]), "µm", MICRO),
        "lateral": (peak_to_peak(every["stator_lateral"]), "mm", 1e3),
    }
    found = "; ".join(f"{name} {written(*size)}" for name, size in sizes.items())
    return Finding(found, all(falls(size[0]) for size in sizes.values()))


@claim(
    "C51",
    "15b",
    "clearance",
    says="Same: horizontal motion hardly changes; its mean shifts with the friction force, more for less gap",
    expected="peak to peak within 10 %; mean negative, falling in size",
)
def friction_shifts_the_mean(store: xr.Dataset) -> Finding:
    """Compare means and peak-to-peak values: the rim passes the stator to +z, friction pushes it to -z."""
    horizontal = cases(store)["horizontal"]
    size, mean = peak_to_peak(horizontal), horizontal.mean("sample", dtype=float).compute()
    found = f"{written(size, 'µm', MICRO)}; means {written(mean, 'µm', MICRO)}"
    steady = float(size.max() / size.min()) - 1 <= 0.1
    return Finding(found, steady and rises(mean) and float(mean.max()) < 0)


@claim(
    "C52",
    "16a,b",
    "clearance",
    says="g 70 and 110 µm: strongest torsion line 126.3 Hz (2X)",
    expected="within 0.3 Hz",
)
def second_order_is_strongest_in_torsion(store: xr.Dataset) -> Finding:
    """Name the strongest line for the extreme gaps."""
    lines = [strongest(spectrum(cases(store, clearance=g), "torsion"))[0] for g in (70e-6, 110e-6)]
    holds = all(name == "2X" and abs(hertz - 126.3) <= 0.3 for name, hertz, _ in lines)
    return Finding(
        ", ".join(f"{name} ({hertz:.2f} Hz, {a * 1e3:.2f} mrad)" for name, hertz, a in lines), holds
    )


CLAIMS: tuple[Claim, ...] = (
    smaller_gap_has_period_one,
    smaller_gap_presses_harder,
    vertical_has_whole_orders_only,
    torsion_has_the_orders_on_either_side_of_its_mode,
    less_gap_means_more_of_everything,
    friction_shifts_the_mean,
    second_order_is_strongest_in_torsion,
)
