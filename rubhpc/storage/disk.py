"""Files that are whole or absent, reading of regular files only, and operating system errors in one line."""

from __future__ import annotations

import errno
import json
import os
import shutil
import stat
import uuid
from contextlib import contextmanager
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

from rubhpc.errors import StoreError, lacks_inodes, reason_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from typing import BinaryIO

_ADVICE = {
    errno.ENOSPC: "the disk is full; free some space and run the same command again",
    errno.EDQUOT: "the disk quota is used up; free some space and run the same command again",
    errno.EFBIG: "the file size limit is reached; raise it (ulimit -f) and run the same command again",
    errno.EROFS: "the file system is read-only; choose another place with --output",
    errno.EACCES: "permission denied; change the permissions or choose another place with --output",
    errno.EPERM: "not permitted; change the permissions or choose another place with --output",
    errno.ENOTDIR: "its parent is not a directory; choose another place with --output",
    errno.EEXIST: "a file of that name exists; move it away or choose another place with --output",
    errno.ENOENT: "part of its path is missing and cannot be made; choose another place with --output",
    errno.EIO: "the disk reports an input/output error; repair it, then run rubhpc verify on the store",
}


LARGEST = 2**30  # bytes that are read at once, at most


class NotRegular(OSError):  # noqa: N818 - an errno of its own
    """What lies at a path is no regular file: a directory, a pipe, a device."""


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading; a pipe is not waited for, and a device is not read.

    Raises
    ------
    NotRegular
        The path, or what it links to, is no regular file.
    OSError
        It cannot be opened.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        if error.errno == errno.ELOOP:  # a link that leads back to itself
            raise NotRegular(errno.EINVAL, "is not a regular file", str(path)) from error
        raise
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise NotRegular(errno.EINVAL, "is not a regular file", str(path))
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def read_regular(path: Path, most: int = LARGEST) -> bytes:
    """The content of a regular file of at most `most` bytes.

    Raises
    ------
    NotRegular
        The path, or what it links to, is no regular file.
    OSError
        It cannot be read, or is larger.
    """
    with open_regular(path) as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EINVAL, "is larger than a file of its kind can be", str(path))
    return data


def is_filled(path: Path) -> bool:
    """Whether a regular file is there that holds something; a power cut may leave empty ones.

    Raises
    ------
    OSError
        Whether it is there cannot be seen.
    """
    try:
        found = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError as error:
        if error.errno == errno.ELOOP:  # a link that leads back to itself
            return False
        raise
    return stat.S_ISREG(found.st_mode) and found.st_size > 0


def remove(path: Path) -> None:
    """Remove whatever is at a path, if there is something; a link, not what it leads to."""
    try:
        path.unlink()
    except FileNotFoundError:
        pass
    except OSError:
        if not path.is_dir() or path.is_symlink():
            raise
        shutil.rmtree(path)


@contextmanager
def disk_errors(place: Path) -> Iterator[None]:
    """Turn an OSError raised while working on `place` into a StoreError that says how to fix it.

    Raises
    ------
    StoreError
        The disk is full or read-only, permission is missing, or the like.
    """
    try:
        yield
    except OSError as error:
        text = _ADVICE.get(error.errno or 0) or str(error.strerror or error).lower()
        if lacks_inodes(error, place):
            text = f"{reason_of(error, place)} and run the same command again"
        raise StoreError(f"{place}: {text}") from error


def write_whole(path: Path, data: bytes, *, is_synced: bool = True) -> None:
    """Write `data` to `path` such that a reader, or the next run after a crash, finds all of it or the old.

    With `is_synced` the data also survive a power failure.
    """
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{uuid.uuid4().hex}.partial")
    try:
        with partial.open("wb") as file:
            file.write(data)
            if is_synced:
                file.flush()
                os.fsync(file.fileno())
        partial.replace(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def flush_to_disk(path: Path) -> None:
    """Return once the file's content is on the disk, so that it is there before it is journalled."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


T = TypeVar("T")

_MOST = 2**16  # bytes
_NUMBERS: dict[str, tuple[type, ...]] = {"int": (int,), "float": (int, float)}


def read_record(path: Path, kind: type[T]) -> T | None:
    """The record of a dataclass of texts and numbers at `path`; None where it is absent or damaged."""
    try:
        content = json.loads(read_regular(path, _MOST))
        if not isinstance(content, dict):
            return None
        record: T = kind(**content)
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    types: dict[str, Any] = {f.name: f.type for f in fields(record)}  # type: ignore[arg-type]
    return record if all(_is_sound(getattr(record, n), t) for n, t in types.items()) else None


def _is_sound(value: object, kind: str) -> bool:
    """Whether a value is of its type, a text printable and a number not beyond any clock or count."""
    if isinstance(value, str):
        return kind == "str" and value.isprintable()
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return kind in _NUMBERS and isinstance(value, _NUMBERS[kind]) and abs(value) < 2**63
