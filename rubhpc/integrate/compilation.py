"""Compilation of kernels: announced, counted (it is no time of a case), and done by one process at a time."""

from __future__ import annotations

import fcntl
import sys
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from typing import IO, TYPE_CHECKING, Any

from numba.core import event

from rubhpc.kernels._cache import cache_folder, drop_old, temporary_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

COMMON = ""
COLLOCATION = "for curved gaps and any law"
PERIODIC = "for periodic motions"
# Sets of kernels, each announced, and compiled when a case first needs it -> seconds that it takes, about.
_SECONDS = {COMMON: 10, COLLOCATION: 15, PERIODIC: 10}
_SETS = {  # kernel -> its set; all others are common
    "advance_by_collocation": COLLOCATION,
    "follow_revolutions": PERIODIC,
    "carry_pieces": PERIODIC,
}
_announced: list[str] = []
_expected: set[str] = set()  # sets of the study that is run


class _Compilation(event.Listener):
    """Listens to numba, which takes its lock, looks in the cache, and compiles what is not there.

    Meanwhile this process has the lock of the cache. The others wait and load what it has compiled. Two at
    once could write one file of the cache for different arguments.
    """

    def __init__(self) -> None:
        self.seconds = 0.0  # spent on compilation so far, waiting for other processes included
        self.announce: Callable[[str], None] = to_stderr
        self._depth, self._began, self._own = 0, 0.0, threading.Lock()
        self._is_compiling = False
        self._held = ExitStack()

    @property
    def is_under_way(self) -> bool:
        """Whether this process compiles now, or waits for another that does."""
        return self._is_compiling

    def on_start(self, event: Any) -> None:
        if event.kind == "numba:compile":
            dispatcher = event.data["dispatcher"]
            if dispatcher.__module__.startswith("rubhpc.kernels."):
                self._is_compiling = True
                self.announce_set_of(dispatcher.__name__)
            return
        with self._own:
            self._depth += 1
            if self._depth == 1:
                with suppress(OSError):  # a folder that cannot be written, or a file system without locks
                    self._take(self._held.enter_context((cache_folder() / "lock").open("w")))
                self._began, self._is_compiling = time.perf_counter(), False

    def _take(self, lock: IO[str]) -> None:
        """Take the lock of the cache; to wait for another process that compiles counts as compilation."""
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            began, self._is_compiling = time.perf_counter(), True
            fcntl.flock(lock, fcntl.LOCK_EX)
            self.seconds += time.perf_counter() - began

    def on_end(self, event: Any) -> None:
        if event.kind == "numba:compile":
            return
        with self._own:
            self._depth -= 1
            if self._depth == 0:
                if self._is_compiling:
                    self.seconds += time.perf_counter() - self._began
                    drop_old()
                self._is_compiling = False
                self._held.close()

    def announce_set_of(self, name: str) -> None:
        """Announce the set of kernels that a kernel belongs to, unless that was done."""
        place = temporary_folder()
        if place is not None and not _announced:
            self.announce(f"compiled kernels are kept in {place}; set NUMBA_CACHE_DIR to a folder that lasts")
        kernels = _SETS.get(name, COMMON)
        if kernels in _announced:
            return
        _announced.append(kernels)
        n = len(_expected.intersection(_announced))
        number = f"set {n} of at most {len(_expected)}, " if kernels in _expected else ""
        purpose = f" {kernels}" if kernels else ""
        self.announce(
            f"compiling kernels{purpose}, once after an installation: "
            f"{number}about {_SECONDS[kernels]} s on a free core"
        )


def to_stderr(text: str) -> None:
    """Print it on the error stream."""
    print(f"rubhpc: {text}", file=sys.stderr, flush=True)


compilation = _Compilation()
for _kind in ("numba:compiler_lock", "numba:compile"):
    event.register(_kind, compilation)  # type: ignore[no-untyped-call]


def seconds_compiling() -> float:
    """Seconds that this process has spent on compilations so far."""
    return compilation.seconds


def is_compiling() -> bool:
    """Whether this process is compiling now."""
    return compilation.is_under_way


def expect_sets(names: set[str]) -> None:
    """Take the sets of kernels that a run may need, for announcements that count them."""
    _expected.update(names)


@contextmanager
def announced_by(announce: Callable[[str], None]) -> Iterator[None]:
    """Within this context, `announce` is called before a set of kernels that is in no cache is compiled."""
    before, compilation.announce = compilation.announce, announce
    try:
        yield
    finally:
        compilation.announce = before
