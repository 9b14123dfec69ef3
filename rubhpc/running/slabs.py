"""Slabs of a refined map: independent boxes that extend over the refined axes.

A map over speed, clearance and friction that is refined along the last two has one for each speed. Whoever
computes a slab goes through all its levels without waiting for others, with one set-up for all of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.running.worker import Worker
    from rubhpc.storage.refined import Refinement
    from rubhpc.study.cases import Block


@dataclass(frozen=True)
class Slab:
    """A box of the grid: its blocks, and its window along each dimension."""

    blocks: list[Block]
    window: tuple[slice, ...]

    def parts(self, missing: NDArray[np.bool_]) -> Iterator[tuple[Block, NDArray[np.bool_]]]:
        """Blocks that hold a case of those marked in the slab, and which of their cases are."""
        marked = missing.reshape([s.stop - s.start for s in self.window])
        for block in self.blocks:
            inside = tuple(
                slice(start - s.start, start - s.start + n)
                for s, start, n in zip(self.window, block.start, block.shape, strict=True)
            )
            if marked[inside].any():
                yield block, marked[inside].ravel()


def find_slabs(blocks: list[Block], shape: tuple[int, ...], refined: tuple[int, ...]) -> list[Slab]:
    """Return the slabs of a grid with these dimensions refined, in the order of their first blocks."""
    together: dict[tuple[int, ...], list[Block]] = {}
    for block in blocks:
        place = tuple(0 if axis in refined else start for axis, start in enumerate(block.start))
        together.setdefault(place, []).append(block)
    return [
        Slab(
            own,
            tuple(
                slice(0, shape[axis]) if axis in refined else slice(start, start + own[0].shape[axis])
                for axis, start in enumerate(place)
            ),
        )
        for place, own in together.items()
    ]


def work_through(slab: Slab, refinement: Refinement, worker: Worker) -> bool:
    """Compute the missing cases of a slab, level by level; returns whether its end was reached.

    Parameters
    ----------
    refinement : Refinement
        Of the whole map, as far as it was known when the run began.
    worker : Worker
        Leaves a slab unfinished when it is to stop or is wanted elsewhere.
    """
    own = refinement.within(slab.window)
    missing = own.missing()
    while missing.any():
        n_before = len(worker.held.entered)
        for block, marked in slab.parts(missing):
            flat = worker.store.flat(block.start)
            worker.missing[flat] = marked
            worker.work(block)
            worker.missing[flat] = False
            if worker.is_wanted_elsewhere():
                return False
            worker.attend()
        own.enter(worker.held.entered[n_before:])
        following = own.missing()
        if (following & missing).any():  # some of this level have not been computed
            return False
        missing = following
    return True
