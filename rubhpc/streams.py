"""Standard streams that end no command: closed, full, or in an encoding that lacks a character."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import TYPE_CHECKING, Any, TextIO, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


class _Lasting:
    """A text stream; once it cannot be written, what is printed is dropped.

    It has no `buffer`, so that click writes texts, in the encoding of the stream.

    Attributes
    ----------
    problem : str
        Why it cannot be written; empty if it can, or if its reader has ended, as `head` does.
    """

    def __init__(self, stream: TextIO | None) -> None:
        is_closed = stream is None or stream.closed
        self._stream: Any = open(os.devnull, "w", encoding="utf-8") if is_closed else stream  # noqa: SIM115
        self.problem = ""

    def __getattr__(self, name: str) -> Any:
        if name == "buffer":
            raise AttributeError(name)
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        self._try(lambda: self._write(text))
        return len(text)

    def flush(self) -> None:
        self._try(self._stream.flush)

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
        except UnicodeEncodeError as error:
            self._stream.write(text.encode(error.encoding, "replace").decode(error.encoding))

    def _try(self, act: Callable[[], object]) -> None:
        try:
            act()
        except OSError as error:
            if error.errno != errno.EPIPE:
                self.problem = error.strerror or str(error)
            with suppress(OSError), open(os.devnull, "wb") as null:
                os.dup2(null.fileno(), self._stream.fileno())  # Python writes what it holds as it ends


@contextmanager
def lasting_streams() -> Iterator[Callable[[], str]]:
    """Context in which no output raises; its value returns why standard output is incomplete, or ""."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # the next file or socket would become a standard stream, of child processes too
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    out, err = _Lasting(sys.stdout), _Lasting(sys.stderr)

    def problem() -> str:
        out.flush()
        return out.problem

    with redirect_stdout(cast("TextIO", out)), redirect_stderr(cast("TextIO", err)):
        try:
            yield problem
        finally:
            out.flush()
            err.flush()
