"""Stator stiffness (Figs. 17 to 19): shorter, harder contacts, and a stator that falls silent sooner."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.mokhtar2017.claims.cases import SMALL_GAP_CASE, SOFT, STIFF, cases
from postproc.mokhtar2017.claims.claim import Claim, Finding, claim, report
from postproc.mokhtar2017.claims.measures import (
    MICRO,
    falls,
    orbit_size,
    peak_to_peak,
    rises,
    within,
    written,
)
from postproc.signals.contacts import free_decay

if TYPE_CHECKING:
    import xarray as xr

MODULI = [SOFT, 15e9, STIFF]  # Pa
_MODULUS = "stator_youngs_modulus"


def _below(store: xr.Dataset) -> xr.Dataset:
    return cases(store, **SMALL_GAP_CASE | {_MODULUS: MODULI})


def compression(every: xr.Dataset) -> xr.DataArray:
    """Return the peak compression of the stator, m."""
    return every["stator_axial"].max("sample").compute()


@claim(
    "C60",
    "17d",
    "subcritical",
    says="r 0.75, g 84 µm: contact time falls from 3 ms at 3 GPa to 1.2 ms at 30 GPa",
    expected="by a factor 2 to 3.3",
)
def stiffer_stator_shortens_contact(store: xr.Dataset) -> Finding:
    """Compare the mean durations."""
    duration = _below(store)["contact_duration"].values
    ratio = float(duration[0] / duration[-1])
    return Finding(
        f"{written(duration, 'ms', 1e3)}; factor {ratio:.2f}", within(ratio, 2, 3.3) and falls(duration)
    )


@claim(
    "C61",
    "17",
    "subcritical",
    says="Same, 3, 15, 30 GPa: reaction up, compression down, torsion up, orbit little changed",
    expected="monotone; orbit peak to peak within 15 %",
)
def stiffer_stator_pushes_harder_and_gives_less(store: xr.Dataset) -> Finding:
    """Compare peaks and peak-to-peak values over the modulus."""
    every = _below(store)
    force, torsion = every["peak_contact_force"].values, peak_to_peak(every["torsion"])
    sizes = [peak_to_peak(every[n]) for n in ("vertical", "horizontal")]
    found = (
        f"reaction {written(force, 'N')}; compression {written(compression(every), 'µm', MICRO)}; "
        f"torsion {written(torsion, 'µrad', MICRO)}; vertical {written(sizes[0], 'µm', MICRO)}; "
        f"horizontal {written(sizes[1], 'µm', MICRO)}"
    )
    steady = all(float(size.max() / size.min()) - 1 <= 0.15 for size in sizes)
    return Finding(found, rises(force) and falls(compression(every)) and rises(torsion) and steady)


@claim(
    "C62",
    "18",
    "resonance",
    "subcritical",
    says="r 1.5, g 150 µm, same moduli: orbit and compression shrink, compression more than at r 0.75",
    expected="monotone",
)
def stiffer_stator_shrinks_the_orbit_near_resonance(near: xr.Dataset, below: xr.Dataset) -> Finding:
    """Compare the reach of the orbit and the peak compression, and the drop of the latter at both speeds."""
    every = cases(near, **{_MODULUS: MODULI})
    size, pressed = orbit_size(every), compression(every)
    drops = [float(c[0] / c[-1]) for c in (pressed, compression(_below(below)))]
    found = (
        f"orbit {written(size, 'µm', MICRO)} from its centre; compression {written(pressed, 'µm', MICRO)}; "
        f"down by {drops[0]:.2f} times here, {drops[1]:.2f} times at r 0.75"
    )
    return Finding(found, falls(size) and falls(pressed) and drops[0] > drops[1])


@claim(
    "C63",
    "19",
    "subcritical",
    "resonance",
    says="r 0.75 and 1.5: stator lateral motion is smaller, and decays faster, for a larger modulus",
    expected="monotone",
)
def stiffer_stator_falls_silent_sooner(below: xr.Dataset, near: xr.Dataset) -> Finding:
    """Compare peak-to-peak values and the decay rates out of contact."""
    found, holds = [], True
    for speed, every in (("0.75", _below(below)), ("1.5", cases(near, **{_MODULUS: MODULI}))):
        size = peak_to_peak(every["stator_lateral"])
        rate = [
            float(np.median(free_decay(every.sel({_MODULUS: modulus}))["decay_rate"])) for modulus in MODULI
        ]
        holds &= falls(size) and rises(rate)
        found.append(f"r {speed}: {written(size, 'mm', 1e3)}, decay {written(rate, '1/s')}")
    return Finding("; ".join(found), bool(holds))


@report(
    "D9",
    "18a",
    "resonance",
    says="r 1.5: vertical and horizontal motion both shrink for a larger modulus",
    reason="horizontal motion depends on the damping, which is not stated",
)
def horizontal_motion_near_resonance(store: xr.Dataset) -> str:
    """Report both peak-to-peak values over the modulus."""
    every = cases(store, **{_MODULUS: MODULI})
    sizes = [f"{n} {written(peak_to_peak(every[n]), 'µm', MICRO)}" for n in ("vertical", "horizontal")]
    return f"{'; '.join(sizes)}"


CLAIMS: tuple[Claim, ...] = (
    stiffer_stator_shortens_contact,
    stiffer_stator_pushes_harder_and_gives_less,
    stiffer_stator_shrinks_the_orbit_near_resonance,
    stiffer_stator_falls_silent_sooner,
    horizontal_motion_near_resonance,
)
