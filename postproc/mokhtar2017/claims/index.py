"""All claims in the order of the paper, and their evaluation from the stores."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from postproc.mokhtar2017.claims import (
    clearance,
    discrepancies,
    friction,
    models,
    natural_frequencies,
    ringing,
    rub,
    speed,
    stiffness,
)
from postproc.mokhtar2017.claims.cases import CaseFailed
from postproc.mokhtar2017.claims.claim import Claim, Finding
from postproc.store.open import open_store
from rubhpc.errors import InputError, StoreError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import xarray as xr

_MODULES = (natural_frequencies, models, speed, rub, ringing, friction, clearance, stiffness, discrepancies)
# C before D, then by number.
CLAIMS: tuple[Claim, ...] = tuple(
    sorted((c for module in _MODULES for c in module.CLAIMS), key=lambda c: (c.id[0], int(c.id[1:])))
)
HOLDS, FAILS, REPORTED = "holds", "fails", "reported"


@dataclass(frozen=True)
class Result:
    """A claim and what was found in the stores."""

    claim: Claim
    finding: Finding

    @property
    def verdict(self) -> str:
        """One of "holds", "fails", "reported"."""
        if self.claim.is_reported:
            return REPORTED
        return HOLDS if self.finding.holds else FAILS


def on_figure(number: int) -> list[Claim]:
    """Return the claims on one figure of the paper.

    Raises
    ------
    InputError
        None is.
    """
    found = [c for c in CLAIMS if number in figures_of(c)]
    if not found:
        known = sorted({n for c in CLAIMS for n in figures_of(c)})
        raise InputError(f"--figure {number}: no claim on it; there are {', '.join(map(str, known))}")
    return found


def figures_of(claim: Claim) -> list[int]:
    """Return the numbers of the figures that a claim is on; none for a table's."""
    if claim.figure.startswith("Table"):
        return []
    parts = (part.strip().rstrip("abcdefgh") for part in claim.figure.split(","))
    return [int(part) for part in parts if part]


def open_studies(folder: str | Path, names: Iterable[str]) -> dict[str, xr.Dataset]:
    """Return the stores of some studies of `jobs/paper`, lazily, by the names of their files.

    Raises
    ------
    StoreError
        One is missing.
    """
    paths = {name: Path(folder) / f"{name}.zarr" for name in dict.fromkeys(names)}
    missing = [path.name for path in paths.values() if not path.exists()]
    if missing:
        problem = f"there is no {', '.join(missing)}"
        raise StoreError(f"{folder}: {problem}; run make paper, or give another folder with --stores")
    return {name: open_store(path) for name, path in paths.items()}


def evaluate(claims: Iterable[Claim], stores: Mapping[str, xr.Dataset]) -> list[Result]:
    """Return the result of each claim; one on a case that failed or diverged fails."""
    return [Result(claim, _find(claim, stores)) for claim in claims]


def _find(claim: Claim, stores: Mapping[str, xr.Dataset]) -> Finding:
    try:
        return claim.evaluate(*(stores[name] for name in claim.studies))
    except CaseFailed as failed:
        return Finding(str(failed), False)
