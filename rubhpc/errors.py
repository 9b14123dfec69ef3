"""Errors that reach the user: one line with where, what is wrong and how to fix it, and an exit code."""

from __future__ import annotations

import errno
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_LOCKED = (
    "HDF5 cannot lock it; close what has it open, or set HDF5_USE_FILE_LOCKING=FALSE where the file system "
    "has no locks"
)
_NO_INODES = "no inodes are left for another file (df -i); remove some files"


def reason_of(error: OSError, path: Path) -> str:
    """Return why the file or directory at `path` cannot be written, with a cure where it is hard to guess."""
    if "unable to lock file" in str(error):
        return _LOCKED
    return _NO_INODES if lacks_inodes(error, path) else error.strerror or str(error)


@contextmanager
def writing(path: Path, option: str = "") -> Iterator[None]:
    """Have a file or folder that cannot be written reported, with the option that names another one."""
    try:
        yield
    except OSError as error:
        remedy = f"choose another {option}".rstrip()
        raise InputError(f"{path}: cannot be written: {reason_of(error, path)}; {remedy}") from error


@contextmanager
def located(where: str) -> Iterator[None]:
    """Put what comes before "[table] key" of a message before those of InputErrors, "study.toml: "."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}{error}") from None


def lacks_inodes(error: OSError, path: Path) -> bool:
    """Whether a disk is full of files, not of bytes."""
    if error.errno != errno.ENOSPC:
        return False
    try:
        place = next(folder for folder in (path, *path.absolute().parents) if folder.exists())
        disk = os.statvfs(place)
    except (OSError, StopIteration):
        return False
    return disk.f_files > 0 and disk.f_favail == 0


def printable(text: str) -> str:
    """Return a text as one line that is safe on a terminal: white space as blanks, other controls escaped."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() else " " if c.isspace() else c.encode("unicode_escape").decode() for c in text
    )


class RubError(Exception):
    """An error that the user can fix; its text is one line, without control characters."""

    exit_code = 1

    def __init__(self, text: str = "") -> None:
        super().__init__(printable(text))


class InputError(RubError):
    """A study, a rig or an argument that is invalid."""

    exit_code = 2


class NoPeriodicMotion(RubError):  # noqa: N818 - it is named for what was asked for
    """A search for a periodic motion that found none; its text says why."""


class StoreError(RubError):
    """A store that cannot be used: of another study, locked, full, read-only or damaged."""

    exit_code = 3


class StoppedEarly(RubError):  # noqa: N818 - it is a state, not an error
    """A run that stopped on request before its end; the same command resumes it."""

    exit_code = 75
