"""The cases that the paper's figures show, picked out of the stores of `jobs/paper`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from postproc.store.axes import source
from postproc.store.select import select
from rubhpc.errors import StoreError
from rubhpc.schema import DONE, MISSING, STATUS

if TYPE_CHECKING:
    import xarray as xr

SOFT, STIFF = 3e9, 30e9  # Pa, moduli of the stator
LARGE_GAP, SMALL_GAP = 100e-6, 84e-6  # m, at r = 0.75
LARGE_GAP_CASE = {"clearance": LARGE_GAP, "friction": 0.3, "stator_youngs_modulus": SOFT}
SMALL_GAP_CASE = {**LARGE_GAP_CASE, "clearance": SMALL_GAP}


class CaseFailed(Exception):  # noqa: N818 - it is a state, not a fault
    """A case that a claim takes has failed or diverged: the claim fails with it."""


def cases(store: xr.Dataset, **choice: Any) -> xr.Dataset:
    """Return the chosen cases, without axes of one value; all of them done.

    Raises
    ------
    StoreError
        A case has not been computed.
    CaseFailed
        A case has failed or diverged.
    InputError
        There is no such case.
    """
    chosen = select(store, choice).squeeze()
    status = chosen["status"].values
    if (status == MISSING).any():
        raise StoreError(f"{source(store)}: not all its cases are done; finish it with make paper")
    if (status != DONE).any():
        raise CaseFailed(f"a case has {STATUS[int(status.max())]}")
    return chosen
