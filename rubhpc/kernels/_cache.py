"""Where compiled kernels are kept: beside their sources, or where NUMBA_CACHE_DIR names a folder."""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numba

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

_BESIDE = Path(__file__).parent / "__pycache__"
_MOST_CACHES = 4  # kept of a module, each of another state of its sources
_temporary: list[Path] = []


def temporary_folder() -> Path | None:
    """Return the temporary folder of this process's cache; None where it has another."""
    return _temporary[-1] if _temporary else None


@cache
def cache_folder() -> Path:
    """Return the folder of this process's compiled kernels; it has what was compiled beside the sources.

    Raises
    ------
    InputError
        No folder can be written.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    named = os.environ.get("NUMBA_CACHE_DIR")
    for folder in [Path(named)] if named else [_BESIDE, home / "rubhpc"]:
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                break
    else:
        try:
            folder = _private_folder()
        except OSError as error:
            problem = f"no folder can be written ({error.strerror or error})"
            raise InputError(f"compiled kernels: {problem}; set NUMBA_CACHE_DIR to one that can") from None
        _temporary.append(folder)
    if folder != _BESIDE and not os.access(_BESIDE, os.W_OK):
        _link_installed(folder)
    return folder


@contextmanager
def folder_of(name: str) -> Iterator[None]:
    """Context in which functions are decorated that numba keeps in a folder of the cache.

    The name ends with the digest of what they are compiled from: versions that alternate keep their caches.
    """
    config, folder = numba.config, cache_folder() / name
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]


def drop_old() -> None:
    """Remove the caches of all but the latest states of the sources."""
    kept: dict[str, int] = {}
    folders = [path for path in cache_folder().glob("*-*/") if not path.is_symlink()]
    for path in sorted(folders, key=lambda path: path.stat().st_mtime, reverse=True):
        module = path.name.rpartition("-")[0]
        kept[module] = kept.get(module, 0) + 1
        if kept[module] > _MOST_CACHES:
            shutil.rmtree(path, ignore_errors=True)


def _private_folder() -> Path:
    """Make a folder among the temporary files that nobody else can write, one for all processes of a user."""
    folder = Path(tempfile.gettempdir(), f"rubhpc-{os.getuid()}")
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022:
        return folder
    own = Path(tempfile.mkdtemp(prefix="rubhpc-"))  # another user has taken the name
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return own


def _link_installed(cache: Path) -> None:
    """Link what was compiled beside the sources into a cache that has nothing of the same sources."""
    with suppress(OSError):  # what is not linked is compiled
        for installed in _BESIDE.glob("*-*/"):
            there = cache / installed.name
            if there.exists():
                continue
            for file in installed.rglob("*.nb?"):
                link = there / file.relative_to(installed)
                link.parent.mkdir(parents=True, exist_ok=True)
                link.symlink_to(file)
