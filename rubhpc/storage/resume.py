"""What a study finds in its store, and what is left to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.errors import StoreError
from rubhpc.schema import DIVERGED, DONE
from rubhpc.storage.manifest import PRIVATE, Manifest
from rubhpc.storage.store import Store
from rubhpc.sweep import Sweep

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.storage.journal import Ledger
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
        told = "; ".join(differences)
        raise StoreError(f"{study.output}: is the store of another study: {told}; choose another --output")
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
    """Grow the store to the sweep's axes, mend what is damaged beside the cases, remove partial files."""
    differences = store.manifest.differences(Manifest.of(sweep))
    if differences:
        raise StoreError(f"{store.path}: has just become that of another study: {'; '.join(differences)}")
    if store.manifest.shape != sweep.shape:
        store.grow(sweep)
    store.mend_static(sweep)
    store.remove_partial_files()


def find_gone(store: Store, ledger: Ledger) -> list[int]:
    """Flat indices of the cases that have been stored, but whose files are gone or empty."""
    gone: list[int] = []
    if not store.manifest.variables:
        return gone
    stored = (ledger.status == DONE) | (ledger.status == DIVERGED)
    for start in store.blocks():
        flat = store.flat(start)
        if stored[flat].any() and not store.has_files(start):
            gone += flat[stored[flat]].tolist()
    return gone


def missing_share(block: Block, missing: NDArray[np.bool_]) -> float:
    """Share of a block that is missing; `missing` has the grid's shape."""
    window = tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))
    return float(missing[window].mean())
