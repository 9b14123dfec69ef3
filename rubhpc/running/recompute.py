"""Recomputes one case of a study and compares it with the store, which is not changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError, RubError, StoreError
from rubhpc.integrate.record import Record, State
from rubhpc.running.case_setup import set_up
from rubhpc.running.initial_states import is_intact
from rubhpc.running.worker import integrate, packed_measures, put
from rubhpc.schema import DONE, FINAL_STATE, MISSING, STATUS
from rubhpc.storage.measures import blank_records
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.storage.resume import grid_for, is_store
from rubhpc.storage.store import Store, case_checksum
from rubhpc.study.points import Points
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from rubhpc.integrate.changing_speed.case import RunUpRecord
    from rubhpc.study.cases import Case, CaseGrid
    from rubhpc.study.study import Study

SHORTEST = 6  # characters of an id that are enough, if no other case shares them


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """One case as it has just been computed.

    Attributes
    ----------
    measures : dict
        Name -> value, or one a stator; empty where the case failed.
    verdict : str
        How it compares with the store.
    """

    id: str
    case: str
    status: str
    measures: dict[str, Any]
    verdict: str

    def text(self) -> str:
        """All of it for people, a line each."""
        lines = {
            "case": self.id,
            "at": self.case,
            "status": self.status,
            **self.measures,
            "store": self.verdict,
        }
        width = max(map(len, lines))
        return "\n".join(f"{name:{width}}  {value}" for name, value in lines.items())


@on_one_thread
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
    grid = grid_for(study)
    manifest = manifest_of(grid)
    flat = _find(grid, name.lower())
    case = grid.case([int(i) for i in np.unravel_index(flat, grid.shape)])
    at = manifest.name_case(flat)
    try:
        record = _compute(grid, case)
        data = {v.name: np.full((1, *manifest.extent(v)), np.nan, v.dtype) for v in manifest.variables}
        put(record, data, 0)
    except Exception as error:
        text = " ".join(str(error).split())
        raise RubError(f"case {case.id}, {at}: {type(error).__name__}: {text}") from error
    row = packed_measures(record, manifest.header.record_type)
    status = STATUS[record.status] + (f": {record.remark}" if record.remark else "")
    measures = {n: row[n].tolist() for n in row.dtype.names or ()}
    return Reproduction(
        id=case.id,
        case=at,
        status=status,
        measures=measures,
        verdict=_compare(study, case, record.status, data, row),
    )


def _compute(grid: CaseGrid, case: Case) -> Record | RunUpRecord:
    """The record of a case; its predecessors are read from the store, or computed first."""
    study, behind, state = grid.study, [case], None
    while (index := grid.predecessor(behind[-1].index)) is not None:
        before = grid.case(index)
        status, state = _stored_end(study, before)
        if status != MISSING:
            break
        behind.append(before)
    for each in reversed(behind):
        setup = set_up(study, each)
        initial = each.initial if state is None else State.unpacked(state, setup.model)
        record = integrate(study, each, setup, initial)
        is_before = isinstance(record, Record) and record.status == DONE
        state = record.final.packed() if is_before else None  # type: ignore[union-attr]
    return record


def _stored_end(study: Study, case: Case) -> tuple[int, NDArray[np.float64] | None]:
    """Status of a case in the study's store, missing where it is damaged, and its final state where done."""
    if not is_store(study.output):
        return MISSING, None
    store = Store(study.output)
    flat = _locate(store, study, case)
    ledger = store.replay(with_measures=False)
    if flat is None or ledger.status[flat] != DONE:
        return (MISSING if flat is None else int(ledger.status[flat])), None
    start = store.start_of(flat)
    stored = store.read_block(start)
    if stored is None or not is_intact(store, ledger, start, flat, stored):
        return MISSING, None
    return DONE, stored[FINAL_STATE][np.searchsorted(store.flat(start), flat)]


def _locate(store: Store, study: Study, case: Case) -> int | None:
    """Flat index of a case in the store's grid; None where it is absent, or has other predecessors."""
    mine, theirs = Points(study.axes), store.manifest.points
    try:
        index = [
            theirs.along(dim).index(mine.along(dim)[i]) for dim, i in zip(mine.dims, case.index, strict=True)
        ]
    except ValueError:
        return None
    flat = int(np.ravel_multi_index(index, store.manifest.shape))
    return flat if store.manifest.case_id(flat) == case.id else None


def _find(grid: CaseGrid, name: str) -> int:
    """Flat index of the one case whose id begins so."""
    if len(name) < SHORTEST:
        raise InputError(f"--only {name}: too short; give at least {SHORTEST} characters of an id")
    manifest = manifest_of(grid)
    found = [flat for flat in range(grid.n_case) if manifest.case_id(flat).startswith(name)]
    if len(found) != 1:
        what = (
            f"{len(found)} cases have such an id; give more characters of it"
            if found
            else "no case has such an id"
        )
        raise InputError(f"--only {name}: {what}; rubhpc status lists those that failed")
    return found[0]


def _compare(
    study: Study, case: Case, status: int, data: dict[str, NDArray[Any]], row: NDArray[np.void]
) -> str:
    """How a case compares with the store, where there is one; raises where it differs."""
    if not is_store(study.output):
        return f"{study.output} does not exist yet"
    store = Store(study.output)
    flat = _locate(store, study, case)
    ledger = store.replay()
    assert ledger.measures is not None
    if flat is None or ledger.status[flat] == MISSING:
        return f"{study.output} does not contain it yet"
    if ledger.status[flat] != status:
        raise StoreError(
            f"{study.output}: case {case.id} is {STATUS[status]} now, but stored as "
            f"{STATUS[ledger.status[flat]]}: {ledger.reasons.get(flat, '')}"
        )
    start = store.start_of(flat)
    stored = store.read_block(start)
    i_case = int(np.searchsorted(store.flat(start), flat))
    kept, blank = ledger.measures[flat], blank_records((), ledger.measures.dtype)
    absent = {n for n in store.manifest.added if kept[n].tobytes() == blank[n].tobytes()}
    names = {*(row.dtype.names or ())} & {*(kept.dtype.names or ())} - absent - {"wall_time"}
    differing = sorted(n for n in names if kept[n].tobytes() != row[n].tobytes())
    if stored is None:
        raise StoreError(f"{study.output}: case {case.id}: its files are damaged; rubhpc verify marks it")
    differing += [n for n, values in data.items() if values[0].tobytes() != stored[n][i_case].tobytes()]
    if differing:
        raise StoreError(
            f"{study.output}: case {case.id} differs from what is stored in {', '.join(differing)}; "
            "rubhpc verify checks whether the store is damaged"
        )
    return f"{study.output} holds the same, bit for bit (checksum {case_checksum(data, 0):08x})"
