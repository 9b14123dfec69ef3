"""The cases that the paper's figures show, picked out of the stores of `jobs/paper`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.store.axes import source
from postproc.store.open import open_store
from postproc.store.select import select
from rubhpc.errors import StoreError
from rubhpc.schema import DONE, MISSING, STATUS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import xarray as xr

SOFT, STIFF = 3e9, 30e9  # Pa, moduli of the stator


class CaseFailed(Exception):  # noqa: N818 - it is a state, not a fault
    """A case that a claim takes has failed or diverged: the claim fails with it."""


class Cases:
    """Some cases of a study of `jobs/paper`, by the values of its axes; all of them without a choice."""

    def __init__(self, study: str, **choice: Any) -> None:
        self.study = study
        self.choice = choice

    def but(self, **choice: Any) -> Cases:
        """Return the same cases with other values on some axes."""
        return Cases(self.study, **self.choice | choice)

    def of(self, stores: Mapping[str, xr.Dataset]) -> xr.Dataset:
        """Return the cases, without axes of one value; all of them done.

        StoreError where one has not been computed, CaseFailed where one has failed or diverged, InputError
        where there is none.
        """
        store = stores[self.study]
        chosen = select(store, self.choice).squeeze()
        status = chosen["status"].values
        if (status == MISSING).any():
            raise StoreError(f"{source(store)}: not all its cases are done; finish it with make paper")
        if (status != DONE).any():
            raise CaseFailed(f"a case has {STATUS[int(status.max())]}")
        return chosen


def open_studies(folder: str | Path, names: Iterable[str]) -> dict[str, xr.Dataset]:
    """Return the stores of some studies of `jobs/paper`, lazily, by the names of their files.

    StoreError where one is missing.
    """
    paths = {name: Path(folder) / f"{name}.zarr" for name in dict.fromkeys(names)}
    missing = [path.name for path in paths.values() if not path.exists()]
    if missing:
        problem = f"there is no {', '.join(missing)}"
        raise StoreError(f"{folder}: {problem}; run make paper, or give another folder with --stores")
    return {name: open_store(path) for name, path in paths.items()}


# r = 0.75
LARGE_GAP = Cases("subcritical", clearance=100e-6, friction=0.3, stator_youngs_modulus=SOFT)
SMALL_GAP = LARGE_GAP.but(clearance=84e-6)
FRICTIONS = LARGE_GAP.but(friction=[0.1, 0.3, 0.5])
MODULI = SMALL_GAP.but(stator_youngs_modulus=[SOFT, 15e9, STIFF])
# Of the stiff stator over speed: all, and those about the resonances of period 1, 2 and 3.
STIFF_SPEEDS = Cases("speed", stator_youngs_modulus=STIFF)
RESONANCES = ((1.2, 2.4), (2.8, 4.0), (4.6, 6.0))
FIRST, SECOND, THIRD = (STIFF_SPEEDS.but(speed_ratio=slice(*ends)) for ends in RESONANCES)
NEAR_MODULI = Cases("resonance")  # r = 1.5
GAPS = Cases("clearance")  # r = 2
THREE = Cases("friction")  # r = 3, three frictions
SIXTH_HARMONIC = Cases("sixth_harmonic")
FREEDOM = Cases("lateral_freedom")
WALL = Cases("penalty")
