"""Resuming a study in its store: what it can use, and what is left to compute."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import StoreError
from rubhpc.schema import DIVERGED, DONE
from rubhpc.storage.differences import differences, is_other_version
from rubhpc.storage.drafts import remove_drafts
from rubhpc.storage.growth import finish_growth, grow
from rubhpc.storage.manifest import Manifest, manifests, no_store
from rubhpc.storage.measures import added_measures
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.storage.store import ELSEWHERE, Store
from rubhpc.storage.tidy import tidy
from rubhpc.study.cases import CaseGrid

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.schema import Variable
    from rubhpc.storage.ledger import Ledger
    from rubhpc.study.cases import Block
    from rubhpc.study.study import Study


def is_store(path: Path) -> bool:
    """Whether `path` is a store of this program."""
    return any(os.path.isfile(place) for place in manifests(path))  # a name too long is none


def grid_for(study: Study, *, accept_version: bool = False) -> CaseGrid:
    """The study's grid, with the blocks of the store it resumes.

    Raises
    ------
    StoreError
        The store at the study's output is of another study, or of another version of the physics that is
        not accepted; the text lists the differences. Or there is something else.
    """
    grid = CaseGrid(study)
    if not is_store(study.output):
        if os.path.isdir(study.output) and any(os.scandir(study.output)):
            raise StoreError(no_store(study.output, ELSEWHERE))
        return grid
    manifest = Manifest.read(study.output)
    _refuse_other(manifest, manifest_of(grid), study.output, accept_version=accept_version)
    return grid if grid.chunk == manifest.chunk else CaseGrid(study, chunk=manifest.chunk)


def _refuse_other(mine: Manifest, yours: Manifest, path: Path, *, accept_version: bool) -> None:
    found = differences(mine, yours)
    is_version = is_other_version(mine, yours)
    if not found or (is_version and accept_version):
        return
    listed = "; ".join(found)
    if is_version:
        raise StoreError(
            f"{path}: was computed by another version of the physics: {listed}; "
            "--accept-version keeps its cases and continues, another --output starts a new store"
        )
    raise StoreError(f"{path}: is the store of another study: {listed}; choose another --output")


def open_store(grid: CaseGrid) -> Store:
    """The store of the study, made if it is not there."""
    path = grid.study.output
    if is_store(path):
        return Store(path)
    try:
        return Store.create(path, grid)
    except StoreError:
        if is_store(path):  # another run was quicker
            return Store(path)
        raise


def bring_up_to_date(store: Store, grid: CaseGrid, *, accept_version: bool = False) -> str:
    """Grow the store to the axes of `grid`, add new measures, repair damaged metadata, remove partial files.

    Returns a note on the measures that were added, "" without any.
    """
    tidy(store.path, store.manifest)
    with suppress(OSError):  # the directory may be closed to this user
        remove_drafts(store.path, is_made=True)
    finish_growth(store.path)
    store.reopen()
    must_grow = must_be_grown(store, grid, accept_version=accept_version)
    added = added_measures(store.manifest.measures)
    note = _note_on(added, store) if added else ""
    if must_grow:
        grow(store, grid)
    store.refine(manifest_of(grid).refine)
    store.repair_files(grid)
    return note


def must_be_grown(store: Store, grid: CaseGrid, *, accept_version: bool) -> bool:
    """Whether the store lacks values or measures of `grid`, or has another order of them.

    Raises
    ------
    StoreError
        It is of another study.
    """
    mine, wanted = store.manifest, manifest_of(grid)
    _refuse_other(mine, wanted, store.path, accept_version=accept_version)
    is_same = mine.axes == wanted.axes and mine.identity == wanted.identity
    return not is_same or bool(added_measures(mine.measures))


def _note_on(added: tuple[Variable, ...], store: Store) -> str:
    names = ", ".join(variable.name for variable in added)
    what = f"measure {names}" if len(added) == 1 else f"measures {names}"
    n_case = int(np.isin(store.replay(with_measures=False).status, (DONE, DIVERGED)).sum())
    them = "it" if len(added) == 1 else "them"
    lack = f"its {n_case} cases have none; only new cases have {them}"
    return f"{store.path}: was made before the {what} existed: {lack}"


def cases_without_files(store: Store, ledger: Ledger) -> list[int]:
    """Flat indices of the cases that have been stored, but whose files are missing or empty."""
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
