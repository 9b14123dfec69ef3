"""Counts, for the plan, how often a run assembles a rig, prepares a speed and solves contact modes."""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from rubhpc.running.kept_setups import MOST_SETUPS
from rubhpc.storage.resume import missing_share

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.rig.rig import Rig
    from rubhpc.study.cases import Block, CaseGrid
    from rubhpc.study.contact_keys import Contact

_STRETCHES, _MOST_COUNTED = 10, 2_000  # parts of a run, and cases in all, in which preparations are counted

# Rig, speed and contact -> the rig and its frictions.
_Kept: TypeAlias = "OrderedDict[tuple[int, float, Contact], tuple[Rig, set[float]]]"


class Preparations(NamedTuple):
    """How many times a rank that computes all alone assembles a rig, prepares a speed, and a friction."""

    rig: float
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
    sizes = [sum(math.prod(block.shape) for block in sequence) for sequence in sequences]
    n_stretch = _STRETCHES if sum(sizes) > _MOST_COUNTED else 1
    counted, found = 0, np.zeros(3)
    kept: _Kept = OrderedDict()
    for part in np.array_split(np.arange(len(sequences)), min(n_stretch, len(sequences) or 1)):
        n_here = 0
        for k in part.tolist():
            for block in sequences[k]:
                n_here += _count_in(grid, block, missing, kept, found)
            if n_stretch > 1 and n_here > _MOST_COUNTED / _STRETCHES:
                break
        counted += n_here
    share = int(missing.sum()) / counted if counted else 0.0
    return Preparations(*(share * found).tolist())


def _count_in(
    grid: CaseGrid, block: Block, missing: NDArray[np.bool_], kept: _Kept, found: NDArray[np.float64]
) -> int:
    """Add to `found` what the missing cases of a block prepare, given what is kept; returns their number."""
    try:
        cases = grid.cases(block)
    except Exception:  # its cases will fail
        return 0
    wanted = [cases[i] for i in grid.in_turn(cases) if missing[cases[i].index]]
    for case in wanted:
        key = id(case.rig), case.speed, case.contact
        if key not in kept:
            found[0] += all(rig is not case.rig for rig, _ in kept.values())
            found[1] += 1
            kept[key] = case.rig, set()
            if len(kept) > MOST_SETUPS:
                kept.popitem(last=False)
        frictions = kept[key][1]
        found[2] += case.friction not in frictions
        frictions.add(case.friction)
    return len(wanted)
