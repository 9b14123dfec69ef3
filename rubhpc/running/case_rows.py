"""The record of a case as a row of its block's arrays, and its measures as one of a journal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.branches.case import BranchRecord
from rubhpc.integrate.changing_speed.case import RunUpRecord
from rubhpc.schema import DONE, FINAL_STATE
from rubhpc.storage.measures import missing_value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.record import Record

    Arrays = dict[str, NDArray[Any]]


def put_any(record: Record | BranchRecord | RunUpRecord, data: Arrays, i_case: int) -> None:
    """Put the arrays of a record into those of a block."""
    if isinstance(record, BranchRecord | RunUpRecord):
        put_points(record, data, i_case)
    else:
        put(record, data, i_case)


def put(record: Record, data: Arrays, i_case: int) -> None:
    """Put the arrays of a record that is done into those of a block.

    Raises
    ------
    FloatingPointError
        One of them is not finite.
    """
    if record.status != DONE:
        return
    arrays = {**record.signals, **record.spectra, **record.sections}
    if FINAL_STATE in data:
        arrays[FINAL_STATE] = record.final.packed()
    for name, values in data.items():
        if not np.isfinite(arrays[name]).all():
            raise FloatingPointError(f"{name} is not finite")
        values[i_case] = arrays[name]


def put_points(record: BranchRecord | RunUpRecord, data: Arrays, i_case: int) -> None:
    """Put the points of branches, or the revolutions and samples of a run-up, into the arrays of a block."""
    for name, values in data.items():
        values[i_case] = np.nan
        found = record.arrays.get(name, np.zeros(0))
        if found.size:  # a case without a point has no shape either
            values[i_case][tuple(slice(n) for n in found.shape)] = found


def packed_measures(record: Record | BranchRecord | RunUpRecord, kind: np.dtype[np.void]) -> NDArray[np.void]:
    """The measures of a record, packed; one that this version does not know is missing."""
    row = np.zeros((), kind)
    for name in kind.names or ():
        row[name] = record.measures[name] if name in record.measures else missing_value(kind[name])
    return row
