"""A rub below the critical speed (Figs. 6 to 9): its two lobes, its contacts, what they set ringing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.mokhtar2017.claims.cases import LARGE_GAP_CASE, SMALL_GAP_CASE, cases
from postproc.mokhtar2017.claims.claim import Claim, Finding, claim
from postproc.mokhtar2017.claims.loops import loops_of
from postproc.mokhtar2017.claims.measures import (
    MICRO,
    height,
    peak_to_peak,
    percent,
    spectrum,
    strongest,
    within,
    written,
)
from postproc.signals.contacts import contact_spans, event_jumps, free_decay, peak_after_contact
from postproc.signals.spectra import samples_per_revolution
from postproc.store.rig_of_case import stator_frequencies

if TYPE_CHECKING:
    import xarray as xr

_SETTING = "r 0.75, 3 GPa, g 100 µm"
HALF_ORDERS = (0.5, 1.5, 2.5)


@claim("C10", "6", "subcritical", says=f"{_SETTING}: period of two revolutions", expected="period 2")
def larger_gap_has_period_two(store: xr.Dataset) -> Finding:
    """Read the period of the orbit."""
    period = int(cases(store, **LARGE_GAP_CASE)["period"])
    return Finding(f"period {period}", period == 2)


@claim(
    "C11",
    "6b",
    "subcritical",
    says="Same: vertical motion has 1/2X, 1X, 3/2X, 2X",
    expected="each over 2 % of 1X",
)
def vertical_has_half_orders(store: xr.Dataset) -> Finding:
    """Compare the lines with 1X."""
    lines = spectrum(cases(store, **LARGE_GAP_CASE), "vertical")
    heights = [height(lines, order) for order in (0.5, 1.5, 2.0)]
    first = height(lines, 1)
    shares = ", ".join(
        f"{n} {percent(h, first)}" for n, h in zip(("1/2X", "3/2X", "2X"), heights, strict=True)
    )
    return Finding(f"1X {first * MICRO:.1f} µm; {shares}", min(heights) > 0.02 * first)


@claim(
    "C12",
    "6d",
    "subcritical",
    says="Same: horizontal motion has 1X and 3/2X, and more 3/2X than 1/2X",
    expected="3/2X over twice 1/2X, 1X the highest",
)
def horizontal_has_the_three_halves_order(store: xr.Dataset) -> Finding:
    """Compare the lines with each other."""
    lines = spectrum(cases(store, **LARGE_GAP_CASE), "horizontal")
    half, first, three_halves = (height(lines, order) for order in (0.5, 1.0, 1.5))
    holds = three_halves > 2 * half and strongest(lines)[0][0] == "1X"
    return Finding(f"1/2X, 1X, 3/2X: {written([half, first, three_halves], 'µm', MICRO)}", holds)


@claim("C13", "6h", "subcritical", says="Same: orbit of two lobes", expected="2 loops")
def orbit_has_two_lobes(store: xr.Dataset) -> Finding:
    """Count the loops of the orbit."""
    loops = loops_of(cases(store, **LARGE_GAP_CASE))
    return Finding(f"loops {loops}", loops == 2)


@claim(
    "C14",
    "6f",
    "subcritical",
    says="Same: strongest torsion line 130.2 Hz, which is 11/2 X",
    expected="130.2 Hz within 0.3 Hz",
)
def torsion_line_nearest_the_mode_is_strongest(store: xr.Dataset) -> Finding:
    """Name the strongest line."""
    ((name, hertz, _),) = strongest(spectrum(cases(store, **LARGE_GAP_CASE), "torsion"))
    return Finding(f"{name} ({hertz:.2f} Hz)", name == "11/2X" and abs(hertz - 130.2) <= 0.3)


@claim(
    "C16",
    "6e",
    "subcritical",
    says="Same: torsion peaks after successive contacts differ (73.1 and 61.0 µrad)",
    expected="ratio 1.05 to 4; each within a factor 4",
)
def torsion_peaks_alternate(store: xr.Dataset) -> Finding:
    """Compare the peaks between one touch and the next."""
    peaks = peak_after_contact(cases(store, **LARGE_GAP_CASE), "torsion").values
    high, low = (float(np.mean(part)) for part in _halves(peaks))
    levels = within(high / 73.1e-6, 1 / 4, 4) and within(low / 61.0e-6, 1 / 4, 4)
    ratio = high / low
    return Finding(
        f"{written([high, low], 'µrad', MICRO)}; ratio {ratio:.2f}", within(ratio, 1.05, 4) and levels
    )


@claim(
    "C17",
    "6e, 7a",
    "subcritical",
    says="Same: contacts alternate in spacing (46 ms printed; a revolution takes 42.2 ms)",
    expected="long spacing 44 to 48 ms",
)
def contacts_alternate_in_spacing(store: xr.Dataset) -> Finding:
    """Measure the time from one touch to the next."""
    spacing = np.diff(contact_spans(cases(store, **LARGE_GAP_CASE))["start"].values)
    long, short = (float(np.mean(part)) for part in _halves(spacing))
    return Finding(f"{written([long, short], 'ms', 1e3)}", within(long, 44e-3, 48e-3) and short < 0.99 * long)


@claim("C18", "7a", "subcritical", says="Same: a contact lasts 3 ms", expected="2.5 to 4.2 ms")
def contact_lasts_three_milliseconds(store: xr.Dataset) -> Finding:
    """Read the mean duration, and measure the longest and the shortest."""
    case = cases(store, **LARGE_GAP_CASE)
    mean, each = float(case["contact_duration"]), contact_spans(case)["duration"].values
    found = f"{mean * 1e3:.2f} ms on average, {written([each.min(), each.max()], 'ms', 1e3)} each"
    return Finding(found, all(within(t, 2.5e-3, 4.2e-3) for t in (mean, each.min(), each.max())))


@claim(
    "C19",
    "7a",
    "subcritical",
    says="Same: one contact a revolution and no force otherwise",
    expected="exact",
)
def one_contact_a_revolution(store: xr.Dataset) -> Finding:
    """Count the contacts as they passed and in the samples; both give the same share of the time."""
    case = cases(store, **LARGE_GAP_CASE)
    rate, share = float(case["contacts_per_revolution"]), float(case["contact_fraction"])
    force = case["contact_force"]
    per_revolution = samples_per_revolution(force)
    spans = contact_spans(case)
    whole = force.sizes["sample"] // per_revolution - spans.sizes["span"]  # one may be cut by both ends
    sampled = float((force > 0).mean())
    found = (
        f"{rate:g} a revolution, in {100 * share:.2f} % of the time ({100 * sampled:.2f} % of the samples)"
    )
    return Finding(found, rate == 1 and whole in (0, 1) and abs(sampled - share) <= 2 / per_revolution)


@claim(
    "C20",
    "6g",
    "subcritical",
    says="Same: torsional acceleration jumps at touch and at release",
    expected="jump over 5 times the local rms",
)
def torsional_acceleration_jumps(store: xr.Dataset) -> Finding:
    """Compare the smallest departure from smooth motion at each kind of event with that in free motion."""
    jumps = event_jumps(cases(store, **LARGE_GAP_CASE))
    least = {kind: float(jumps["ratio"][jumps["kind"].values == kind].min()) for kind in ("touch", "release")}
    found = ", ".join(f"{kind} {ratio:.3g}" for kind, ratio in least.items())
    return Finding(f"least at {found} times the rms", all(ratio > 5 for ratio in least.values()))


@claim(
    "C21",
    "7b,c",
    "subcritical",
    says="Same: the stator vibrates freely at 803 Hz between contacts",
    expected="within 1 % of 803 Hz",
)
def stator_rings_at_its_own_frequency(store: xr.Dataset) -> Finding:
    """Fit a decaying sine to each span out of contact."""
    case = cases(store, **LARGE_GAP_CASE)
    found = free_decay(case, "stator_lateral")["frequency"].values
    own = float(stator_frequencies(case)["lateral"])
    holds = bool((np.abs(found - 803.0) <= 0.01 * 803.0).all()) and found.size > 0
    text = f"{np.median(found):.1f} Hz, {found.min():.1f} to {found.max():.1f} Hz; undamped {own:.1f} Hz"
    return Finding(text, holds)


@claim(
    "C24",
    "9",
    "sixth_harmonic",
    says="20, 21.34, 22 Hz, g 56 µm: strongest torsion line 120, 128, 132 Hz, which is 6X",
    expected="within 0.3 Hz",
)
def sixth_harmonic_is_strongest(store: xr.Dataset) -> Finding:
    """Name the strongest line at each speed."""
    every = cases(store)
    lines = [strongest(spectrum(every.isel(speed=i), "torsion"))[0] for i in range(every.sizes["speed"])]
    near = (abs(line[1] - f) <= 0.3 for line, f in zip(lines, (120, 128, 132), strict=True))
    found = ", ".join(f"{name} ({hertz:.2f} Hz)" for name, hertz, _ in lines)
    return Finding(found, all(near) and all(name == "6X" for name, *_ in lines))


@claim(
    "C25",
    "9",
    "sixth_harmonic",
    says="Same: torsion peak to peak 181.7, 513.7, 423.9 µrad",
    expected="second over third over first; first and third within 30 %",
)
def torsion_peaks_where_the_sixth_harmonic_meets_the_mode(store: xr.Dataset) -> Finding:
    """Compare the peak-to-peak values."""
    below, at, above = (float(v) for v in peak_to_peak(cases(store)["torsion"]))
    near = within(below / 181.7e-6, 0.7, 1.3) and within(above / 423.9e-6, 0.7, 1.3)
    return Finding(written([below, at, above], "µrad", MICRO), at > above > below and near)


@claim(
    "C73",
    "6, 14",
    "subcritical",
    says="r 0.75: subharmonics below the critical speed with the larger gap only",
    expected="period 2 at 100 µm, 1 at 84 µm; half orders over 2 %, under 0.5 % of 1X",
)
def subharmonics_need_the_larger_gap(store: xr.Dataset) -> Finding:
    """Compare periods and half orders of both gaps."""
    large, small = (cases(store, **choice) for choice in (LARGE_GAP_CASE, SMALL_GAP_CASE))
    shares = [half_order_share(case) for case in (large, small)]
    periods = [int(case["period"]) for case in (large, small)]
    written_shares = " and ".join(percent(share, 1) for share in shares)
    found = f"period {periods[0]} and {periods[1]}; half orders {written_shares}"
    return Finding(found, periods == [2, 1] and shares[0] > 0.02 and shares[1] < 0.005)


def half_order_share(case: xr.Dataset) -> float:
    """Return the highest of 1/2X, 3/2X and 5/2X in the vertical motion over 1X."""
    lines = spectrum(case, "vertical")
    return max(height(lines, order) for order in HALF_ORDERS) / height(lines, 1)


def _halves(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return every other value, those first whose sum is larger."""
    n = values.size // 2 * 2
    even, odd = values[:n:2], values[1:n:2]
    return (even, odd) if even.sum() >= odd.sum() else (odd, even)


CLAIMS: tuple[Claim, ...] = (
    larger_gap_has_period_two,
    vertical_has_half_orders,
    horizontal_has_the_three_halves_order,
    orbit_has_two_lobes,
    torsion_line_nearest_the_mode_is_strongest,
    torsion_peaks_alternate,
    contacts_alternate_in_spacing,
    contact_lasts_three_milliseconds,
    one_contact_a_revolution,
    torsional_acceleration_jumps,
    stator_rings_at_its_own_frequency,
    sixth_harmonic_is_strongest,
    torsion_peaks_where_the_sixth_harmonic_meets_the_mode,
    subharmonics_need_the_larger_gap,
)
