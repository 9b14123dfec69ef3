"""Edges of a refined map: neighbours that differ where the axes have all their values, one of them inferred.

Both are computed, and so is every inferred case next to a computed one that differs, until there is none. A
case is asked for because of a neighbour's result and its own inferred value alone: the order in which results
come changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Results:
    """What is known of the cases of a grid, as far as it decides what is refined.

    Attributes
    ----------
    is_known : (*grid) bool
        Cases that have an outcome.
    is_failed : (*grid) bool
        Those of them that have none to compare: their surroundings are computed.
    classes : list of (*grid) int
        Flags.
    values : list of ((*grid) float, float)
        Measures, and the share of the larger one by which neighbours may differ.
    """

    is_known: NDArray[np.bool_]
    is_failed: NDArray[np.bool_]
    classes: list[NDArray[Any]] = field(default_factory=list)
    values: list[tuple[NDArray[np.float64], float]] = field(default_factory=list)

    def compared(self) -> tuple[list[NDArray[Any]], list[float]]:
        """Return all that is compared, failures first, (*grid) each, and the share allowed of each."""
        held = [self.is_failed, *self.classes, *(values for values, _ in self.values)]
        return held, [0.0] * (1 + len(self.classes)) + [share for _, share in self.values]


class Edges:
    """The cases that a grid asks for, all its values held or inferred.

    Parameters
    ----------
    refined : sequence of int
        Dimensions along which neighbours are compared.
    results : Results
        As far as they are known.
    asked : (*grid) bool
        Cases that are asked for already; changed in place.
    is_final : (*grid) bool
        Whether a case is known or known to be inferred, so far.
    held : list of (*grid)
        Results of the cases asked for and what is inferred of the others, as `Results.compared` has them.
    """

    def __init__(
        self,
        refined: Sequence[int],
        results: Results,
        asked: NDArray[np.bool_],
        is_final: NDArray[np.bool_],
        held: list[NDArray[Any]],
    ) -> None:
        self._refined, self.asked = tuple(refined), asked
        self._inferred, self._is_final = held, is_final
        beside = np.zeros(asked.shape, bool)
        for axis in self._refined:
            one, other = span(axis, None, -1), span(axis, 1, None)
            is_open = differ(held, results.compared()[1], axis) & is_final[one] & is_final[other]
            beside[one] |= is_open
            beside[other] |= is_open
        asked |= beside

    def follow(self, results: Results, cases: NDArray[np.int64]) -> None:
        """Ask for the neighbours of cases that differ from them, and for those of these that are known.

        Parameters
        ----------
        cases : (n,) int
            Flat indices of cases that are asked for and have become known.
        """
        known, tolerances = results.compared()
        true = [values.ravel() for values in known]
        inferred = [values.ravel() for values in self._inferred]
        asked, is_final = self.asked.reshape(-1), self._is_final.ravel()
        is_known, shape = results.is_known.ravel(), self.asked.shape
        while len(cases) and self._refined:
            found = []
            for axis in self._refined:
                stride = int(np.prod(shape[axis + 1 :]))
                place = cases // stride % shape[axis]
                for step, is_inside in ((-1, place > 0), (1, place < shape[axis] - 1)):
                    here = cases[is_inside]
                    beside = here + step * stride
                    is_open = ~asked[beside] & is_final[beside]
                    here, beside = here[is_open], beside[is_open]
                    pairs = [np.stack([t[here], i[beside]]) for t, i in zip(true, inferred, strict=True)]
                    found.append(beside[differ(pairs, tolerances, 0)[0]])
            new = np.unique(np.concatenate(found))
            asked[new] = True
            cases = new[is_known[new]]


def differ(held: list[NDArray[Any]], tolerances: list[float], axis: int) -> NDArray[np.bool_]:
    """Whether neighbours along an axis differ; first in `held` are failures, which agree with none."""
    failed, *rest = held
    one, other = span(axis, None, -1), span(axis, 1, None)
    found: NDArray[np.bool_] = failed[one] | failed[other]
    for values, tolerance in zip(rest, tolerances[1:], strict=True):
        a, b = values[one], values[other]
        if values.dtype.kind != "f":
            found |= a != b
            continue
        is_same = np.abs(a - b) <= tolerance * np.maximum(np.abs(a), np.abs(b))  # of NaN, false
        found |= ~is_same & ~(np.isnan(a) & np.isnan(b))
    return found


def span(axis: int, start: int | None, stop: int | None) -> tuple[slice, ...]:
    """All along the axes before one, and a part of it."""
    return (*[slice(None)] * axis, slice(start, stop))
