"""Refined maps: which cases a level asks for, as the results of a store decide, and which are inferred."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Self

import numpy as np

from rubhpc.schema import FAILED, INFERRED, MISSING
from rubhpc.study.edges import Results
from rubhpc.study.levels import Levels
from rubhpc.study.refine import levels_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.storage.journal import Entry
    from rubhpc.storage.manifest import Manifest
    from rubhpc.study.edges import Edges
    from rubhpc.study.levels import Asked


class Refinement:
    """The cases that a refined map asks for, from the results so far.

    Parameters
    ----------
    manifest : Manifest
        Of a store with a refined map.
    status : (n_case,) int8
    records : (n_case,) record
        Measures of the cases.
    again : bool
        Whether failed cases are to be computed again, and so are not known.
    """

    def __init__(
        self,
        manifest: Manifest,
        status: NDArray[np.int8],
        records: NDArray[np.void],
        *,
        again: bool = False,
    ) -> None:
        assert manifest.refine is not None
        self._levels = levels_of(manifest.refine, manifest.points)
        self._by: list[tuple[str, float]] = [(name, share) for name, share in manifest.refine["by"]]
        self._status = status.copy()
        self._is_known = self._status != MISSING
        if again:
            self._is_known &= self._status != FAILED
        self._kind = records.dtype
        self._held = {name: records[name].copy() for name, _ in self._by}
        self._flat: NDArray[np.int64] | None = None  # cases of a box, by their number in the grid
        self._edges: Edges | None = None
        self._n_expected = 0
        self._fresh: list[NDArray[np.int64]] = []  # cases entered since edges were followed

    @property
    def refined(self) -> tuple[int, ...]:
        """Dimensions of the grid that are refined."""
        return self._levels.refined

    def within(self, window: tuple[slice, ...]) -> Self:
        """Return the refinement of a box alone, as long as the map along the refined axes.

        What lies beyond such a box decides nothing in it. Entries are those of its cases.
        """
        shape = self._levels.shape
        places = np.ix_(*(np.arange(n)[s] for s, n in zip(window, shape, strict=True)))
        flat = np.ravel_multi_index(places, shape)
        part = copy.copy(self)
        part._levels = Levels(flat.shape, self._levels.refined, self._levels.coarse)
        part._flat = flat.ravel()
        part._status, part._is_known = self._status[part._flat], self._is_known[part._flat]
        part._held = {name: held[part._flat] for name, held in self._held.items()}
        part._edges, part._fresh = None, []
        return part

    def enter(self, entries: Sequence[Entry]) -> None:
        """Add what has been computed since."""
        if not entries:
            return
        flat = np.array([entry.flat for entry in entries], np.int64)
        places = flat if self._flat is None else np.searchsorted(self._flat, flat)
        for entry, place in zip(entries, places.tolist(), strict=True):
            self._status[place] = entry.status
            self._is_known[place] = entry.status != MISSING
            if entry.measures:
                record = np.frombuffer(entry.measures, self._kind)[0]
                for name, _ in self._by:
                    self._held[name][place] = record[name]
        self._fresh.append(places)

    def asked(self) -> Asked:
        """Return the cases that are certain to be computed, as far as results decide."""
        asked = self._levels.asked(self._results())
        self._edges = asked.edges
        self._fresh.clear()
        self._n_expected = asked.n_expected
        return asked

    @property
    def n_expected(self) -> int:
        """About how many cases will be computed, as `missing` has last found."""
        return self._n_expected if self._edges is None else int(self._edges.asked.sum())

    def missing(self) -> NDArray[np.bool_]:
        """Return the cases that are asked for and not known, (n_case,), or those of the box."""
        if self._edges is None:
            asked = self.asked().cases
        else:  # nothing but edges is left, and what has been entered since decides the rest of them
            fresh = np.concatenate([np.zeros(0, np.int64), *self._fresh])
            self._fresh.clear()
            asked = self._edges.asked
            self._edges.follow(self._results(), fresh[self._is_known[fresh] & asked.ravel()[fresh]])
        missing: NDArray[np.bool_] = asked.ravel() & ~self._is_known
        return missing

    def _results(self) -> Results:
        shape = self._levels.shape
        results = Results(
            is_known=self._is_known.reshape(shape),
            is_failed=(self._is_known & (self._status == FAILED)).reshape(shape),
            classes=[self._status.reshape(shape)],
        )
        for name, share in self._by:
            held = self._held[name]
            for values in held.T if held.ndim > 1 else [held]:
                values = values.reshape(shape)
                if share:
                    results.values.append((values.astype(np.float64), share))
                else:
                    results.classes.append(values)
        return results


def status_of(
    manifest: Manifest, status: NDArray[np.int8], records: NDArray[np.void] | None
) -> NDArray[np.int8]:
    """Return the status of each case, (n_case,): of a complete refined map, what it lacks is inferred."""
    if manifest.refine is None or not (status == MISSING).any():
        return status
    assert records is not None
    is_all = Refinement(manifest, status, records).asked().is_all
    return np.where(is_all & (status == MISSING), INFERRED, status).astype(np.int8)
