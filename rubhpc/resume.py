"""What a study finds in its store, and what is left to do."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import StoreError
from rubhpc.journal import Entry
from rubhpc.manifest import PRIVATE, Manifest
from rubhpc.schema import MISSING
from rubhpc.store import Store
from rubhpc.sweep import Sweep

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.journal import Ledger
    from rubhpc.study import Study
    from rubhpc.sweep import Block


def is_store(path: Path) -> bool:
    """Whether a store of this program stands at `path`."""
    return (path / PRIVATE / "manifest.json").is_file()


def sweep_for(study: Study) -> Sweep:
    """The study's sweep, with the blocks of the store it goes on with.

    Raises
    ------
    StoreError
        The store at the study's output is of another study; the text lists the differences.
    """
    sweep = Sweep(study)
    if not is_store(study.output):
        return sweep
    manifest = Manifest.read(study.output)
    differences = manifest.differences(Manifest.of(sweep))
    if differences:
        raise StoreError(
            f"{study.output}: is the store of another study: {'; '.join(differences)}; choose another --output"
        )
    return sweep if sweep.chunk == manifest.chunk else Sweep(study, chunk=manifest.chunk)


def open_store(sweep: Sweep) -> Store:
    """The store of the study, made if it is not there."""
    path = sweep.study.output
    if is_store(path):
        return Store(path)
    try:
        return Store.create(path, sweep)
    except StoreError:
        if is_store(path):  # another run was quicker
            return Store(path)
        raise


def bring_up_to_date(store: Store, sweep: Sweep) -> None:
    """Grow the store to the sweep's axes, write anew what has been damaged beside the cases, sweep up partial files."""
    differences = store.manifest.differences(Manifest.of(sweep))
    if differences:
        raise StoreError(f"{store.path}: has just become that of another study: {'; '.join(differences)}")
    if store.manifest.shape != sweep.shape:
        store.grow(sweep)
    store.mend_static(sweep)
    store.remove_partial_files()


def find_gone(store: Store, sweep: Sweep, ledger: Ledger) -> list[Entry]:
    """Entries that take back the cases journalled under another id, or whose files are gone."""
    gone: list[Entry] = []
    for block in sweep.blocks():
        flat = store.flat(block.start)
        there = ledger.status[flat] != MISSING
        if not there.any():
            continue
        ids = sweep.case_ids(block)
        is_gone = np.array(ids, dtype=ledger.ids.dtype) != ledger.ids[flat]
        if not all(path.exists() for path in store.chunk_files(block.start)):
            is_gone[:] = True
        gone += [Entry(int(flat[i]), ids[i], MISSING) for i in np.flatnonzero(there & is_gone)]
    return gone


def missing_share(block: Block, missing: NDArray[np.bool_]) -> float:
    """Share of a block that is missing; `missing` has the grid's shape."""
    window = tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))
    return float(missing[window].mean())
