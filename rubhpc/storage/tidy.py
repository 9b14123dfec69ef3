"""Removes from a store what a run cannot use: unfinished files, and what is of another kind than it must be.

A directory in place of a file, a file in place of a directory, a pipe or a device is damage: its content is
lost, and its place has to be free before it can be written again.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rubhpc.storage.disk import disk_errors, remove
from rubhpc.storage.manifest import BLOCKS, GROWTH, PARTS, PRIVATE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rubhpc.storage.manifest import Manifest

_FOLDERS = ("journal", "logs")  # of the private directory, always there
_LATER = ("in_progress", "runs", PARTS, BLOCKS, GROWTH)  # made when they are needed
_FILES = ("zarr.json", "manifest.json", "manifest.copy.json", "packed.json")


def tidy(path: Path, manifest: Manifest) -> None:
    """Remove what cannot belong to the store at `path`, and make its directories; needs its lock.

    What is of names that the store does not use stays.

    Raises
    ------
    StoreError
        The store cannot be read or changed.
    """
    with disk_errors(path):
        for place in unfit(path, manifest):
            remove(place)
        for name in _FOLDERS:
            (path / PRIVATE / name).mkdir(exist_ok=True)


def unfit(path: Path, manifest: Manifest) -> Iterator[Path]:
    """Places in a store where something of another kind is, and its unfinished files; lost directories."""
    private = path / PRIVATE
    for name in (*_FOLDERS, *_LATER):
        place = private / name
        if not place.is_dir() and (name in _FOLDERS or os.path.lexists(place)):
            yield place
    for folder in (path, private):
        yield from _unfit_files(folder, lambda name: name in _FILES)
    for name in (*_FOLDERS, "in_progress", "runs"):
        yield from _unfit_files(private / name, lambda name: name.startswith("run"))
    yield from _unfit_files(private / PARTS, lambda _: True)
    for variable in manifest.variables:
        waiting = private / BLOCKS / variable.name
        if os.path.lexists(waiting) and not waiting.is_dir():
            yield waiting
        yield from _unfit_files(waiting, lambda _: True)
    for name, n_dim in _arrays(manifest).items():
        if os.path.lexists(path / name) and not (path / name).is_dir():
            yield path / name
        yield from _unfit_files(path / name, lambda name: name in _FILES or name.startswith("c."))
        yield from _unfit_chunks(path / name / "c", n_dim)


def _arrays(manifest: Manifest) -> dict[str, int]:
    """Arrays of the store with chunks below the directory `c`, and their number of dimensions."""
    static = {name.partition("/")[0]: name.count("/") - 1 for name in manifest.files if "/c/" in name}
    n_axis = len(manifest.dims)
    return static | {v.name: n_axis + len(v.dims) for v in (*manifest.variables, *manifest.packed)}


def _unfit_chunks(folder: Path, depth: int) -> Iterator[Path]:
    """What is not a whole file below so many directories, in a directory of chunks."""
    if not folder.is_dir():
        if os.path.lexists(folder):
            yield folder
        return
    for entry in _entries(folder):
        if depth > 1 and _is_directory(entry):
            yield from _unfit_chunks(Path(entry.path), depth - 1)
        elif depth > 1 or not _is_regular(entry) or entry.name.endswith(".partial"):
            yield Path(entry.path)


def _unfit_files(folder: Path, is_file: Callable[[str], bool]) -> Iterator[Path]:
    """Unfinished files, and what is none though its name is that of a file."""
    for entry in _entries(folder) if folder.is_dir() else ():
        if entry.name.endswith(".partial") or (is_file(entry.name) and not _is_regular(entry)):
            yield Path(entry.path)


def _is_directory(entry: os.DirEntry[str]) -> bool:
    """Whether it is one; a link that leads back to itself is neither that nor a file."""
    with suppress(OSError):
        return entry.is_dir()
    return False


def _is_regular(entry: os.DirEntry[str]) -> bool:
    with suppress(OSError):
        return entry.is_file()
    return False


def _entries(folder: Path) -> list[os.DirEntry[str]]:
    with os.scandir(folder) as entries:
        return list(entries)
