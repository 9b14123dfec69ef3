"""Initial states in a continuation: the final state of the predecessor, from memory or the store, or rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.running.stopping import Stopped
from rubhpc.schema import DONE, FINAL_STATE, MISSING, STATUS
from rubhpc.storage.store import case_checksum
from rubhpc.study.axes import written

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from rubhpc.storage.journal import Entry
    from rubhpc.storage.ledger import Ledger
    from rubhpc.storage.store import Store
    from rubhpc.study.cases import Case, CaseGrid

    Arrays = dict[str, NDArray[Any]]
    Index = tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class InitialState:
    """Where a case starts.

    Attributes
    ----------
    state : (n_degree,) or None
        Of the case before, packed; None at rest.
    note : str
        Remark in the journal line of the case; "" if it starts as the study states.
    """

    state: NDArray[np.float64] | None = None
    note: str = ""


class InitialStates:
    """The final states from which other cases start.

    Parameters
    ----------
    repair : callable
        Computes damaged cases of the block that begins at an index again.
    """

    def __init__(self, grid: CaseGrid, store: Store, ledger: Ledger, repair: Callable[[Index], None]) -> None:
        self._grid, self._store, self._ledger, self._repair = grid, store, ledger, repair
        self._held: dict[int, NDArray[np.float64]] = {}  # of one block, by flat index

    def start_of(
        self, case: Case, flat: NDArray[np.int64], data: Arrays, entries: Sequence[Entry]
    ) -> InitialState:
        """Where a case of a block starts: `flat` and `data` are the block's, `entries` what it has computed.

        Raises
        ------
        Stopped
            Its predecessor has no outcome yet.
        """
        index = self._grid.predecessor(case.index)
        if index is None:
            return InitialState()
        before = int(np.ravel_multi_index(index, self._grid.shape))
        entered = [entry.status for entry in entries if entry.flat == before]
        if not entered and before not in flat and self._ledger.status[before] == DONE:
            self._fetch(before)
        status = entered[0] if entered else int(self._ledger.status[before])
        if status == DONE and before in flat:
            return InitialState(state=data[FINAL_STATE][np.searchsorted(flat, before)])
        if status == DONE and before in self._held:
            return InitialState(state=self._held[before])
        if status in (DONE, MISSING):  # it could not be computed again before the run was stopped
            raise Stopped
        return InitialState(note=rest_note(self._grid, index, status))

    def remember(self, flat: NDArray[np.int64], data: Arrays) -> None:
        """Keep the final states of a block, and drop those of the block before."""
        if FINAL_STATE in data:
            self._held = dict(zip(flat.tolist(), data[FINAL_STATE], strict=True))

    def _fetch(self, flat: int) -> None:
        """Load the final state of a case that is done."""
        if flat in self._held:
            return
        start = self._store.start_of(flat)
        stored = self._store.read_block(start)
        if stored is not None and is_intact(self._store, self._ledger, start, flat, stored):
            self.remember(self._store.flat(start), stored)
        else:
            self._repair(start)


def is_intact(store: Store, ledger: Ledger, start: Index, flat: int, stored: Arrays) -> bool:
    """Whether the stored arrays of a case, in the block that begins at `start`, match its checksum."""
    return case_checksum(stored, int(np.searchsorted(store.flat(start), flat))) == int(ledger.checksum[flat])


def rest_note(grid: CaseGrid, before: Index, status: int) -> str:
    """Why a case starts at rest: its predecessor, at an index, has no result."""
    assert grid.continuation is not None
    axis = grid.study.axes[grid.continuation.axis]
    value = axis.values[before[grid.continuation.axis]]
    return f"it starts at rest, as {written(axis.name, value, axis.unit)} before it has {STATUS[status]}"
