"""The claims on a figure, and the stores that claims are evaluated from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from postproc.mokhtar2017.claims.table import CLAIMS
from postproc.store.open import open_store
from rubhpc.errors import InputError, StoreError

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr

    from postproc.mokhtar2017.claims.claim import Claim


def on_figure(number: int) -> list[Claim]:
    """Return the claims on one figure of the paper.

    Raises
    ------
    InputError
        None is.
    """
    found = [claim for claim in CLAIMS if number in claim.figures]
    if not found:
        known = sorted({n for claim in CLAIMS for n in claim.figures})
        raise InputError(f"--figure {number}: no claim on it; there are {', '.join(map(str, known))}")
    return found


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
