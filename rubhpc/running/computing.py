"""One rank's share of a run: it claims blocks and computes them, one after another."""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.running.pool import Totals, together
from rubhpc.running.progress import Progress
from rubhpc.running.worker import Watchdog, Worker
from rubhpc.storage.disk import disk_errors, flush_to_disk
from rubhpc.storage.in_progress import InProgress
from rubhpc.storage.resume import missing_share
from rubhpc.storage.store import Store
from rubhpc.study.cases import CaseGrid

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rubhpc.running.job import Job, RunRequest
    from rubhpc.running.pool import Pool
    from rubhpc.storage.journal import Entry
    from rubhpc.study.cases import Block

_PACKING_GAP = 600.0  # s between packings during a run; one takes 5 s for a million cases


class Computing:
    """One rank's computation of a job.

    Parameters
    ----------
    job : Job
    pool : Pool
    request : RunRequest
    """

    def __init__(self, job: Job, pool: Pool, request: RunRequest) -> None:
        self._job, self._pool, self._request = job, pool, request
        self._stopping = request.stopping
        self._grid = CaseGrid(job.study, chunk=job.chunk)
        self._sequences = self._grid.sequences()
        self._n_claim = 0  # in this round
        self._n_claimed = 0  # by all ranks, in the rounds before
        self._entered: list[Entry] = []  # of a refined map, since the last round
        self._sums = Totals()  # of all ranks, as this one last saw them
        self._unsynced: list[Path] = []
        self._next_packing = time.monotonic() + _PACKING_GAP

    @cached_property
    def _store(self) -> Store:
        """The store, which one rank may fail to open: it is opened where all ranks learn of that."""
        return Store(self._job.study.output)

    def compute(self) -> None:
        """Compute all that is missing, together with all ranks."""
        together(self._pool, self._compute_blocks)
        if self._job.suspect and not any(self._pool.gather(bool(self._stopping.look()))):  # all agree
            together(self._pool, self.try_suspects)

    def _compute_blocks(self) -> None:
        """Compute blocks until there are none left."""
        pool, job = self._pool, self._job
        sequences = [self._sequences[i] for i in job.pending]
        quiet = self._request.quiet or pool.rank > 0
        with self._progress(sequences, quiet=quiet) as progress, self._worker("rank", progress) as worker:
            for block in self._claimed(sequences):
                worker.work(block)
                worker.attend()
                self._pack_for_readers()
        if self._stopping.reason:
            pool.add(Totals(stop=1))

    def try_suspects(self) -> None:
        """Compute the cases during which ranks died: last, and each stored before the next begins.

        Those with the fewest deaths come first, so that a case that kills its rank ends up alone.
        """
        job = self._job = replace(self._job, ledger=self._store.replay(with_measures=False))
        blocks = {block.start: (n, block) for n, sequence in enumerate(self._sequences) for block in sequence}
        with self._worker(self._kind_of_tail()) as worker:
            for flat in sorted(job.suspect, key=lambda i: job.suspect[i]):
                n_sequence, block = blocks[self._store.start_of(flat)]
                is_mine = n_sequence % self._pool.size == self._pool.rank  # a block has one writer
                if is_mine and not self._stopping.look():
                    worker.missing = np.arange(self._grid.n_case) == flat
                    worker.is_wary = flat in job.deadly
                    worker.work(block)

    def _kind_of_tail(self) -> str:
        """Kind of the journals of cases that come last: they count after the others."""
        return "tail"

    def sync(self) -> None:
        """Return once all that this rank has stored would survive a power failure."""
        with disk_errors(self._store.path):
            for path in dict.fromkeys(self._unsynced):
                flush_to_disk(path)
        self._unsynced.clear()

    def _claimed(self, sequences: list[list[Block]]) -> Iterator[Block]:
        """The blocks this rank is to compute, one sequence after another, until none is left or it stops."""
        missing = self._job.missing.reshape(self._grid.shape)
        for number in self._numbers(len(sequences)):
            for i, block in enumerate(sequences[number]):
                if i and self._is_over(self._pool.totals()):
                    return
                if missing_share(block, missing):
                    yield block

    def _numbers(self, n: int) -> Iterator[int]:
        """The numbers below n that this rank claims, until none is left or it stops."""
        while not self._stopping.look():
            sums = self._sums = self._pool.claim()
            self._n_claim += 1
            number = sums.claimed - self._n_claimed
            if number >= n or self._is_over(sums):
                return
            yield number

    def _is_over(self, sums: Totals) -> bool:
        """Whether all ranks are to end."""
        most_failures = self._job.study.run.max_failures
        has_failed = most_failures is not None and sums.failed > most_failures
        return bool(self._stopping.look() or sums.stop or has_failed)

    def _pack_for_readers(self) -> None:
        """Let the first rank pack the journals from time to time, for readers during the run."""
        is_due = time.monotonic() > self._next_packing
        if is_due and self._pool.rank == 0 and self._job.part is None:
            self._store.pack(self._store.replay())
            self._next_packing = time.monotonic() + _PACKING_GAP

    def _report(self, increment: Totals) -> None:
        self._sums = self._pool.add(increment)

    @contextmanager
    def _worker(self, kind: str, progress: Progress | None = None) -> Iterator[Worker]:
        """A worker with its journal and its in-progress record.

        At its end all is on the disk; of a refined map it only survives this process, so that the
        other ranks do not wait for the disk (`sync`).
        """
        job, pool, store = self._job, self._pool, self._store

        def attend() -> None:
            if pool.rank == 0 and progress is not None:
                progress.update(pool.totals())

        writer = f"{kind}{pool.rank:05d}"
        with disk_errors(store.path):
            current = InProgress(store.in_progress_directory, job.run, writer)
        with (
            current,
            Watchdog(job.study.run.case_time_limit, current) as watch,
            store.journal(job.run, writer) as journal,
        ):
            worker = Worker(
                self._grid,
                store,
                job.ledger,
                job.missing,
                journal,
                watch,
                self._stopping,
                self._report,
                attend,
            )
            worker.held.entered = self._entered
            if progress is not None:
                worker.say = progress.say
            yield worker
            if job.refinement is None:
                worker.held.sync()
            else:
                self._unsynced += worker.held.take_unsynced()

    def _progress(self, sequences: list[list[Block]], *, quiet: bool) -> Progress:
        job = self._job
        is_missing = job.missing.reshape(self._grid.shape)
        n_case = int(job.share.sum())
        cost = sum(
            block.cost * missing_share(block, is_missing) for sequence in sequences for block in sequence
        )
        return self._shown(n_case, cost, n_case - int(job.missing.sum()), quiet=quiet)

    def _shown(self, n_case: int, cost: float, n_done: int, *, quiet: bool) -> Progress:
        return Progress(n_case, cost, n_done=n_done, quiet=quiet, has_bar=not self._pool.is_launched)
