"""Counts, for the plan, how often a run prepares a rig at a speed, and contact modes of a friction."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.running.kept_setups import MOST_SETUPS
from rubhpc.storage.resume import missing_share

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.study.cases import CaseGrid

_STRETCHES, _MOST_COUNTED = 10, 2_000  # parts of a run, and cases in all, in which preparations are counted


class Preparations(NamedTuple):
    """How many times a rank that computes all alone prepares a speed, and a friction."""

    speed: float
    friction: float

    def for_some(self, share: float, n_case: int) -> Preparations:
        """Those of a share of the `n_case` cases, anywhere among them: what no case needs is not prepared."""
        return Preparations(*(touched(n, share, n_case) for n in self))


def touched(n: float, share: float, n_case: float) -> float:
    """How many of n groups of `n_case` cases hold one of a share of these, anywhere among them."""
    return n * (1.0 - (1.0 - share) ** (n_case / n)) if n and share < 1.0 else n


def count_preparations(grid: CaseGrid, missing: NDArray[np.bool_]) -> Preparations:
    """Go through the missing cases in the order of a run, as a worker does that keeps the latest set-ups.

    Of many cases a few stretches are gone through, and stand for the rest.
    """
    sequences = [[b for b in sequence if missing_share(b, missing)] for sequence in grid.sequences()]
    sequences = [sequence for sequence in sequences if sequence]
    n_missing, counted, found = int(missing.sum()), 0, np.zeros(2)
    n_stretch = _STRETCHES if n_missing > _MOST_COUNTED else 1
    kept: OrderedDict[tuple[float, ...], set[float]] = OrderedDict()  # frictions of each set-up
    for part in np.array_split(np.arange(len(sequences)), min(n_stretch, len(sequences) or 1)):
        n_here = 0
        for block in (block for k in part.tolist() for block in sequences[k]):
            if n_stretch > 1 and n_here > _MOST_COUNTED / _STRETCHES:
                break
            window = tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))
            for place in np.argwhere(missing[window]) + np.array(block.start):
                key, friction = grid.setup_values(place.tolist())
                found[0] += key not in kept
                frictions = kept.setdefault(key, set())
                if len(kept) > MOST_SETUPS:
                    kept.popitem(last=False)
                found[1] += friction not in frictions
                frictions.add(friction)
                n_here += 1
        counted += n_here
    return Preparations(*(n_missing / max(counted, 1) * found).tolist())
