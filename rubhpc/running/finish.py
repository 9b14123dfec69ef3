"""The end of a run on its first rank: journals are packed into arrays, blocks into shards, cases counted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.schema import DONE, FAILED, MISSING
from rubhpc.storage.disk import disk_errors, remove
from rubhpc.storage.in_progress import forget
from rubhpc.storage.ledger import count
from rubhpc.storage.lock import InUse
from rubhpc.storage.refined import status_of
from rubhpc.storage.runs import end_run
from rubhpc.storage.store import Store
from rubhpc.storage.summary import Summary
from rubhpc.storage.verdicts import verdicts

if TYPE_CHECKING:
    from rubhpc.running.beginning import RunRequest
    from rubhpc.running.job import Job
    from rubhpc.storage.ledger import Ledger

_REASONS = 100  # most failed cases named in a summary


def finish_run(job: Job, request: RunRequest, computed: int, seconds: float) -> Summary:
    """Pack the journals into arrays and count the cases."""
    store = Store(job.study.output)
    ledger = store.replay()
    store.pack(ledger)
    ledger.status = status_of(store.manifest, ledger.status, ledger.measures)
    _clean_up(store, ledger)
    with disk_errors(store.path):
        end_run(store.path, job.run)
    return _summary(job, store, ledger, computed, seconds)


def finish_part(job: Job, request: RunRequest, computed: int, seconds: float) -> Summary:
    """Release the part and pack the journals; if it is the last part, pack as after a whole run.

    The part is released first, so that the last of several parts that end together finds no other at work.
    Where the store is not available (a whole run has begun, or this one must stop at once) packing is left to
    others.
    """
    part, store = job.part, Store(job.study.output)
    assert part is not None
    if request.lock is not None:
        request.lock.release()
        request.lock = None
    stopping = request.stopping
    try:
        with disk_errors(store.path):
            end_run(store.path, job.run)
        with (
            disk_errors(store.path),
            store.parts.alone(part, stopping.look, lambda: stopping.ask("the loss of its lock")),
        ):
            ledger = store.replay()
            store.pack(ledger)
            if not store.parts.running():
                _clean_up(store, ledger)
                if not (ledger.status == MISSING).any():
                    store.block_files.pack(is_over=stopping.look)
                    if not stopping.look():
                        store.parts.forget()
    except InUse:
        ledger = store.replay(with_measures=False)
    return _summary(job, store, ledger, computed, seconds)


def _clean_up(store: Store, ledger: Ledger) -> None:
    """Remove stop requests, and the in-progress records of cases that have an outcome."""
    with disk_errors(store.path):
        remove(store.path / "STOP")
        forget(store.in_progress_directory, ledger.status != MISSING)


def _summary(job: Job, store: Store, ledger: Ledger, computed: int, seconds: float) -> Summary:
    own = ledger.status[job.share]
    failed = np.flatnonzero(job.share & (ledger.status == FAILED))[:_REASONS].tolist()
    measures = ledger.measures
    is_done = job.share & (ledger.status == DONE)
    return Summary(
        store=store.path,
        counts=count(own),
        computed=computed,
        seconds=seconds,
        reasons=tuple((store.manifest.name_case(i), ledger.reasons.get(i, "")) for i in failed),
        verdicts="" if measures is None else verdicts(store.manifest, is_done, measures),
        flawed=sum(1 for i in ledger.reasons if job.share[i] and ledger.status[i] == DONE),
        part="" if job.part is None else str(job.part),
        n_elsewhere=int((ledger.status == MISSING).sum()) - count(own)[MISSING],
    )
