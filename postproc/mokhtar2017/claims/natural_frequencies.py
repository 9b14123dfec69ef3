"""Table 1: the natural frequencies that the paper prints for its rotor and its stator."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.mokhtar2017.claims.cases import LARGE_GAP_CASE, cases
from postproc.mokhtar2017.claims.claim import Claim, Finding, claim
from postproc.store.rig_of_case import natural_frequencies, stator_frequencies

if TYPE_CHECKING:
    import xarray as xr


def _compared(found: float, printed: float, tolerance: float) -> Finding:
    return Finding(f"{found:.2f} Hz", abs(found - printed) <= tolerance * printed)


@claim(
    "C01", "Table 1", "subcritical", says="Rotor at standstill: first lateral frequency",
    expected="31.56 Hz, 0.05 %",
)  # fmt: skip
def first_lateral_frequency(store: xr.Dataset) -> Finding:
    """Compare the rotor of the store."""
    found = natural_frequencies(cases(store, **LARGE_GAP_CASE))["lateral"]
    return _compared(float(found), 31.56, 5e-4)


@claim(
    "C02", "Table 1", "subcritical", says="Rotor in torsion: first natural frequency",
    expected="128 Hz, 0.2 %",
)  # fmt: skip
def first_torsional_frequency(store: xr.Dataset) -> Finding:
    """Compare the rotor of the store."""
    found = natural_frequencies(cases(store, **LARGE_GAP_CASE))["torsional"]
    return _compared(float(found), 128.0, 2e-3)


@claim(
    "C03", "Table 1", "subcritical", says="Stator of 3 GPa: first lateral frequency",
    expected="803 Hz, 0.2 %",
)  # fmt: skip
def first_stator_frequency(store: xr.Dataset) -> Finding:
    """Compare the stator of the store."""
    found = stator_frequencies(cases(store, **LARGE_GAP_CASE))["lateral"]
    return _compared(float(found), 803.0, 2e-3)


CLAIMS: tuple[Claim, ...] = (first_lateral_frequency, first_torsional_frequency, first_stator_frequency)
