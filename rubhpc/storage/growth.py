"""Grows a store to more values on its axes, at any position, and to new measures, atomically.

All that changes is first written to a directory of its own: metadata, coordinates, and every block whose
cases move. Renaming that directory commits the growth: from then on its manifest is the store's, and the next
holder of the lock moves the files to their places. A kill before the rename leaves the old store; after a
later kill the next run moves the remaining files.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from rubhpc.schema import DIVERGED, DONE, MISSING
from rubhpc.storage import layout
from rubhpc.storage.disk import disk_errors, flush_to_disk, remove, write_whole
from rubhpc.storage.journal import Entry, Journal, next_run
from rubhpc.storage.manifest import BLOCKS, GROWTH, PRIVATE, Manifest, manifests
from rubhpc.storage.measures import added_measures, converted
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.storage.store import Store, case_checksum

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.storage.ledger import Ledger
    from rubhpc.study.cases import CaseGrid

_HELD = 64  # blocks of the old grid kept in memory: a new block is made of few old ones


def origins(before: Manifest, after: Manifest) -> NDArray[np.int64]:
    """Flat index in the grid of `before` of every case of `after`, (n_case,); -1 for a new one.

    In a continuation a case is new if any of its predecessors is.
    """
    origin, is_new = np.zeros((), np.int64), np.zeros((), bool)
    for dim, n in zip(before.dims, before.shape, strict=True):
        at = {values: i for i, values in enumerate(before.points.along(dim))}
        place = np.array([at.get(values, -1) for values in after.points.along(dim)])
        origin = np.add.outer(origin * n, place)
        is_new = np.logical_or.outer(is_new, place < 0)
    if (continuation := after.continuation) is not None:
        kept = continuation.unchanged(
            before.axes[continuation.axis].values, after.axes[continuation.axis].values
        )
        shape = [
            len(axis.values) if i in (continuation.axis, continuation.direction) else 1
            for i, axis in enumerate(after.axes)
        ]
        is_new |= ~kept.reshape(shape)
    return np.where(is_new, -1, origin).ravel()


def grow(store: Store, grid: CaseGrid) -> None:
    """Give the store the axes and identity of `grid` and new measures, keeping every case; needs its lock.

    Raises
    ------
    StoreError
        The disk is full, or cannot be written; the store is as it was.
    """
    draft = store.private / f"{GROWTH}.draft"
    with disk_errors(store.path):
        remove(draft)
        try:
            _put_together(draft, store, grid)
            os.sync()  # everything is on the disk before it counts
            draft.rename(store.private / GROWTH)
            flush_to_disk(store.private)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    finish_growth(store.path)
    store.reopen()


def finish_growth(path: Path) -> None:
    """Finish a committed growth, if there is one; needs the store's lock."""
    growth = path / PRIVATE / GROWTH
    if not growth.is_dir():
        return
    by_block = {variable.name for variable in Manifest.read(path).variables}
    with disk_errors(path):
        (path / PRIVATE / "packed.json").unlink(missing_ok=True)
        for staged in sorted(growth.iterdir()):
            if staged.is_dir() and staged.name not in by_block and staged.name != PRIVATE:
                shutil.rmtree(path / staged.name, ignore_errors=True)  # it comes whole
                staged.replace(path / staged.name)
            elif staged.name != PRIVATE:
                for file in [staged] if staged.is_file() else staged.rglob("*"):
                    if file.is_file():
                        _move(file, path / file.relative_to(growth))
        blocks = growth / PRIVATE / BLOCKS
        for file in blocks.rglob("*") if blocks.is_dir() else ():
            if file.is_file():
                _move(file, path / file.relative_to(growth))
        os.sync()
        for file in manifests(path):
            if file.is_relative_to(growth) and file.exists():
                _move(file, path / file.relative_to(growth))
        shutil.rmtree(growth)


def _move(file: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    file.replace(target)


def _put_together(draft: Path, store: Store, grid: CaseGrid) -> None:
    """Write to `draft` all that changes in the store, and a journal of all cases in the new grid."""
    before, ledger = store.manifest, store.replay()
    accepted = before.accepted
    if before.parts["physics"] != grid.identity_parts["physics"]:
        accepted = (*accepted, before.parts["physics"])
    added = added_measures(before.measures)
    after = replace(
        manifest_of(grid),
        measures=(*before.measures, *added),
        added=(*before.added, *(variable.name for variable in added)),
        accepted=accepted,
        shard=before.shard,
    )
    files = layout.skeleton(grid, after)
    for name, data in files.items():
        write_whole(draft / name, data, is_synced=False)
    after = replace(after, files={name: crc32(data) for name, data in files.items()})
    after.write(draft)
    assert ledger.measures is not None
    ledger.measures = converted(ledger.measures, after.header.record_type)
    origin = origins(before, after)
    lost = _stage_blocks(Store(draft), store, ledger, origin)
    with Journal(
        store.journal_directory, next_run(store.journal_directory), "growth", after.header
    ) as journal:
        journal.write(
            _moved(ledger, int(origin[flat]), flat, after.case_id(flat), is_lost=flat in lost)
            for flat in np.flatnonzero((origin >= 0) & ledger.is_known[origin]).tolist()
        )
        journal.sync()


def _moved(ledger: Ledger, origin: int, flat: int, name: str, *, is_lost: bool) -> Entry:
    """Journal entry of a known case at its place in the new grid."""
    status = int(ledger.status[origin])
    if is_lost or status == MISSING:
        return Entry(flat, name, MISSING)
    assert ledger.measures is not None
    measures = ledger.measures[origin].tobytes() if status in (DONE, DIVERGED) else b""
    reason = ledger.reasons.get(origin, "")
    return Entry(flat, name, status, int(ledger.checksum[origin]), measures, reason)


def _stage_blocks(new: Store, old: Store, ledger: Ledger, origin: NDArray[np.int64]) -> set[int]:
    """Write the blocks of the new grid that differ from the old one; returns the cases found damaged."""
    read = lru_cache(maxsize=_HELD)(old.read_block)
    is_stored = np.isin(ledger.status, (DONE, DIVERGED))
    shape, chunk = old.manifest.shape, old.manifest.chunk
    lost: set[int] = set()
    for start in new.blocks() if new.manifest.variables else ():
        flat = new.flat(start)
        source = origin[flat]
        index = np.stack(np.unravel_index(flat, new.manifest.shape))
        was_inside = (index < np.array(shape)[:, None]).all(axis=0)
        here = np.where(was_inside, np.ravel_multi_index(tuple(index), shape, mode="clip"), -1)
        if np.array_equal(here, source):
            continue  # the block does not change
        wanted = np.flatnonzero((source >= 0) & is_stored[source])
        if not len(wanted) and not old.has_any_file(start):
            continue
        data = new.empty_block(start)
        for i_case in wanted.tolist():
            place = np.unravel_index(source[i_case], shape)
            corner = tuple(int(i) // c * c for i, c in zip(place, chunk, strict=True))
            stored = read(corner)
            i_stored = int(np.searchsorted(old.flat(corner), source[i_case]))
            if stored is None or case_checksum(stored, i_stored) != ledger.checksum[source[i_case]]:
                lost.add(int(flat[i_case]))
                continue
            for name, values in stored.items():
                data[name][i_case] = values[i_stored]
        new.write_block(start, data)
    return lost
