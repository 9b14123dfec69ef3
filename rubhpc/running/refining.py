"""One rank's share of a refined map: slabs, which need no other rank, and rounds, after which all meet."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

from rubhpc.running.computing import Computing
from rubhpc.running.held_blocks import Blocks, News, lines_of, turns_of
from rubhpc.running.pool import Totals, together
from rubhpc.schema import MISSING

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.running.held_blocks import Lines, Unit
    from rubhpc.running.job import Job, RunRequest
    from rubhpc.running.pool import Pool
    from rubhpc.running.progress import Progress
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


_PATIENCE = 2.0  # s of work on a refined map a kill may cost: its blocks get more cases later
_SLABS = 2  # to a rank: with fewer they are computed together, in rounds


class Refining(Computing):
    """What a rank computes of a refined map.

    Parameters
    ----------
    job : Job
    pool : Pool
    request : RunRequest
    """

    def __init__(self, job: Job, pool: Pool, request: RunRequest) -> None:
        super().__init__(job, pool, request)
        self._n_journal = 0
        self._has_ended = False

    def compute(self) -> None:
        """Compute what the map asks for, together with all ranks: slabs, then in rounds what is left."""
        refinement = self._job.refinement
        assert refinement is not None
        slabs = self._find_slabs()
        with self._progress_of(refinement) as progress:
            self._job.missing[:] = False
            if slabs:
                together(self._pool, lambda: self._compute_slabs(slabs, refinement, progress))
            is_left = True
            while is_left:
                is_left = self._compute_rounds(refinement, progress)
                if not is_left and self._job.suspect and not self._has_ended:
                    together(self._pool, self.try_suspects)
                    self._job = replace(self._job, suspect={})
                    is_left = True

    def _compute_slabs(self, slabs: list[Slab], refinement: Refinement, progress: Progress) -> None:
        """Compute slabs through all their levels, until one rank finds none left.

        The others then store what they have; what is left of their slabs is computed together, in rounds.
        """
        with self._worker(self._next_kind(), progress) as worker:
            worker.held.patience = _PATIENCE
            worker.is_wanted_elsewhere = lambda: self._is_wanted(len(slabs))
            for number in self._numbers(len(slabs)):
                work_through(slabs[number], refinement, worker)
                worker.held.store()
                self._pack_for_readers()
        if self._stopping.reason:
            self._pool.add(Totals(stop=1))

    def _compute_rounds(self, refinement: Refinement, progress: Progress) -> bool:
        """Compute in rounds what a map asks for, until nothing is left; whether to go on with new journals.

        Cases that are marked as missing, since their arrays are damaged, need new ones: their next lines
        count after those of all ranks.
        """
        pool, job = self._pool, self._job
        units: list[Unit] = []
        with ExitStack() as stack:
            workers: list[Worker] = []
            kind = self._next_kind()
            together(pool, lambda: workers.append(stack.enter_context(self._worker(kind, progress))))
            worker = workers[0]
            worker.held.patience = _PATIENCE
            while True:
                news = together(pool, partial(self._round, units, worker))
                entries = [entry for own in news for entry in own.stored]
                is_stuck = bool(units) and not entries and not any(own.held for own in news)
                is_damaged = any(entry.status == MISSING for entry in entries)
                self._has_ended = is_stuck or any(own.is_over for own in news)
                self._n_claimed, self._n_claim = self._n_claimed + sum(own.n_claim for own in news), 0
                job.ledger.enter(lines_of(entries))
                refinement.enter(entries + [entry for own in news for entry in own.held])
                missing = refinement.missing()
                missing[list(job.suspect)] = False
                units = [] if self._has_ended else self._blocks.units(missing, pool.size)
                progress.expect(max(refinement.n_expected, int((job.ledger.status != MISSING).sum())))
                is_due = any(own.is_due for own in news) or any(not unit.is_shared for unit in units)
                has_pieces = any(own.pieces for own in news)
                if has_pieces and (is_due or is_damaged or not units):
                    self._store_pieces([own.pieces for own in news], worker)
                if is_damaged or not (units or (has_pieces and not self._has_ended)):
                    worker.held.store()
                    return is_damaged and not self._has_ended

    def _round(self, units: list[Unit], worker: Worker) -> News:
        """Compute units until one rank finds none left."""
        worker.is_wanted_elsewhere = lambda: self._is_wanted(len(units))
        for number in self._numbers(len(units)):
            block, places, is_shared = units[number]
            cases = self._store.flat(block.start)[places]
            worker.missing[cases] = True
            worker.work(block, is_shared=is_shared)
            worker.missing[cases] = False
            worker.attend()
            self._pack_for_readers()
        if self._stopping.reason:
            self._pool.add(Totals(stop=1))
        if self._pool.size > 1:
            worker.held.store()
        stored, held = list(worker.held.entered), list(worker.held.pieces.entered)
        worker.held.entered.clear()
        worker.held.pieces.entered.clear()
        is_over = self._is_over(self._pool.totals())
        return News(stored, held, worker.held.pieces.listed(), self._n_claim, worker.held.is_due, is_over)

    def _store_pieces(self, pieces: list[dict[tuple[int, ...], Lines]], worker: Worker) -> None:
        """Store what all ranks hold of blocks that they share: of one block, one rank after another."""
        for turn in turns_of(pieces) if self._store.manifest.variables else [pieces]:
            own = turn[self._pool.rank]
            together(self._pool, partial(worker.held.store_pieces, own))
            for lines in (lines for of_rank in turn for lines in of_rank.values()):
                self._job.ledger.enter(lines)

    @cached_property
    def _blocks(self) -> Blocks:
        return Blocks(self._grid)

    def _is_wanted(self, n: int) -> bool:
        """Whether a rank has found nothing left of n units, or all are to end."""
        return self._sums.claimed - self._n_claimed > n or self._is_over(self._sums)

    def _next_kind(self) -> str:
        """Kind of a refined map's next journals, which count after those before."""
        self._n_journal += 1
        return f"rank_{self._n_journal:03d}_" if self._n_journal > 1 else "rank"

    def _kind_of_tail(self) -> str:
        return self._next_kind()

    def _find_slabs(self) -> list[Slab]:
        """Slabs that are not complete; none where ranks would soon find none, or cases have killed ranks."""
        job, refinement = self._job, self._job.refinement
        if refinement is None or job.suspect:
            return []
        blocks = [block for sequence in self._sequences for block in sequence]
        slabs = find_slabs(blocks, self._grid.shape, refinement.refined)
        if len(slabs) < _SLABS * self._pool.size:
            return []
        return [slab for slab in slabs if refinement.within(slab.window).missing().any()]

    def _progress_of(self, refinement: Refinement) -> Progress:
        """That of a refined map, whose cases are known roughly."""
        job = self._job
        n_known = int((job.ledger.status != MISSING).sum())
        n_case = max(refinement.n_expected, n_known + int(job.missing.sum()))
        all_cost = sum(block.cost for sequence in self._sequences for block in sequence)
        cost = all_cost * (n_case - n_known) / self._grid.n_case
        return self._shown(n_case, cost, n_known, quiet=self._request.quiet or self._pool.rank > 0)
