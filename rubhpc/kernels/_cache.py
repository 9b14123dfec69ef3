"""Where compiled kernels are kept if the folder of their sources cannot be written.

Numba then takes a folder of the user's home; without one it would refuse to load any kernel.
"""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

import numba
from numba.core.caching import FunctionCache

from rubhpc.errors import InputError

_BESIDE = Path(__file__).parent / "__pycache__"
_temporary: list[Path] = []


def temporary_folder() -> Path | None:
    """Return the temporary folder of this process's cache; None where it has another."""
    return _temporary[-1] if _temporary else None


def find_cache() -> None:
    """Have numba cache kernels where that is possible, and load what was compiled beside the sources.

    Raises
    ------
    InputError
        No folder can be written.
    """
    try:
        folder = FunctionCache(_private_folder).cache_path
    except RuntimeError:  # NUMBA_CACHE_DIR, the sources, the home: none can be written
        try:
            _temporary.append(_private_folder())
        except OSError as error:
            problem = f"no folder can be written ({error.strerror or error})"
            raise InputError(f"compiled kernels: {problem}; set NUMBA_CACHE_DIR to one that can") from None
        os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = str(_temporary[-1])  # type: ignore[attr-defined]
        folder = FunctionCache(_private_folder).cache_path
    if not os.access(_BESIDE, os.W_OK):
        _link_installed(Path(folder))


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
            if there == installed or there.exists():
                continue
            there.mkdir()
            for file in installed.glob("*.nb?"):
                (there / file.name).symlink_to(file)
