"""Computes one case of a study again and holds it against the store, which it leaves as it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError, RubError, StoreError
from rubhpc.integrate.case import run_case
from rubhpc.points import Points
from rubhpc.running.worker import metrics_of, put, set_up
from rubhpc.schema import MISSING, STATUS
from rubhpc.storage.journal import metrics_type
from rubhpc.storage.manifest import Manifest
from rubhpc.storage.resume import is_store, sweep_for
from rubhpc.storage.store import Store, case_checksum

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from rubhpc.study import Study
    from rubhpc.sweep import Case, Sweep

SHORTEST = 6  # characters of an id that are enough, if no other case shares them


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """One case as it has just been computed.

    Attributes
    ----------
    metrics : dict
        Name -> value, or one a stator; empty where the case failed.
    verdict : str
        How it compares with the store.
    """

    id: str
    case: str
    status: str
    metrics: dict[str, Any]
    verdict: str

    def text(self) -> str:
        """All of it for people, a line each."""
        told = {
            "case": self.id,
            "at": self.case,
            "status": self.status,
            **self.metrics,
            "store": self.verdict,
        }
        width = max(map(len, told))
        return "\n".join(f"{name:{width}}  {value}" for name, value in told.items())


def reproduce(study: Study, name: str) -> Reproduction:
    """Compute the case whose id begins with `name`, compare every bit with the store, write nothing.

    Raises
    ------
    InputError
        No case of the study has such an id, or several have.
    StoreError
        The store is of another study, or what it holds of this case differs from what was computed.
    RubError
        The case fails; the text is its reason.
    """
    sweep = sweep_for(study)
    manifest = Manifest.of(sweep)
    flat = _find(sweep, name.lower())
    case = sweep.case([int(i) for i in np.unravel_index(flat, sweep.shape)])
    told = manifest.name_case(flat)
    try:
        record = run_case(
            set_up(study, case), clearance=case.clearance, friction=case.friction, recording=study.recording
        )
        data = {v.name: np.full((1, *manifest.extent(v)), np.nan, v.dtype) for v in manifest.variables}
        put(record, data, 0)
    except Exception as error:
        text = " ".join(str(error).split())
        raise RubError(f"case {case.id}, {told}: {type(error).__name__}: {text}") from error
    row = metrics_of(record, metrics_type(sweep.n_stator))
    status = STATUS[record.status] + (f": {record.remark}" if record.remark else "")
    metrics = {n: row[n].tolist() for n in row.dtype.names or ()}
    return Reproduction(
        id=case.id,
        case=told,
        status=status,
        metrics=metrics,
        verdict=_compare(study, case, record.status, data, row),
    )


def _find(sweep: Sweep, name: str) -> int:
    """Flat index of the one case whose id begins so."""
    if len(name) < SHORTEST:
        raise InputError(f"--only {name}: too short; give {SHORTEST} characters of an id at least")
    manifest = Manifest.of(sweep)
    found = [flat for flat in range(sweep.n_case) if manifest.case_id(flat).startswith(name)]
    if len(found) != 1:
        what = f"{len(found)} cases have such an id; give more of it" if found else "no case has such an id"
        raise InputError(f"--only {name}: {what}; rubhpc status names those that failed")
    return found[0]


def _compare(
    study: Study, case: Case, status: int, data: dict[str, NDArray[Any]], row: NDArray[np.void]
) -> str:
    """How a case compares with the store, where there is one; raises where it differs."""
    if not is_store(study.output):
        return f"{study.output} is not there yet"
    store = Store(study.output)
    mine, theirs = Points(study.axes), store.manifest.points
    try:
        index = [
            theirs.along(dim).index(mine.along(dim)[i]) for dim, i in zip(mine.dims, case.index, strict=True)
        ]
    except ValueError:
        return f"{study.output} does not hold it yet"
    flat = int(np.ravel_multi_index(index, store.manifest.shape))
    ledger = store.replay()
    assert ledger.metrics is not None
    if ledger.status[flat] == MISSING:
        return f"{study.output} does not hold it yet"
    if ledger.status[flat] != status:
        raise StoreError(
            f"{study.output}: case {case.id} is {STATUS[status]} now, but stored as "
            f"{STATUS[ledger.status[flat]]}: {ledger.reasons.get(flat, '')}"
        )
    start = tuple(int(i) // c * c for i, c in zip(index, store.manifest.chunk, strict=True))
    stored = store.read_block(start)
    i_case = int(np.searchsorted(store.flat(start), flat))
    names = [n for n in row.dtype.names or () if n != "wall_time"]
    differing = [n for n in names if ledger.metrics[flat][n].tobytes() != row[n].tobytes()]
    if stored is None:
        raise StoreError(f"{study.output}: case {case.id}: its files are damaged; rubhpc verify marks it")
    differing += [n for n, values in data.items() if values[0].tobytes() != stored[n][i_case].tobytes()]
    if differing:
        raise StoreError(
            f"{study.output}: case {case.id} differs from what is stored in {', '.join(differing)}; "
            "rubhpc verify tells whether the store is damaged"
        )
    return f"{study.output} holds the same, bit for bit (checksum {case_checksum(data, 0):08x})"
