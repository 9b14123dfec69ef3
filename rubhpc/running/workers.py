"""Worker processes of a run on one machine, without MPI: they share a counter, and talk to their parent.

The parent is the first rank and computes too. Each worker is a Python of its own, started by a command:
scripts need no `if __name__ == "__main__"`, and a notebook hands down nothing but where this package is.
"""

from __future__ import annotations

import fcntl
import mmap
import os
import signal
import socket
import subprocess
import tempfile
import threading
import time
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np

from rubhpc.children import command, environment
from rubhpc.errors import InputError, RubError
from rubhpc.running.launch import launch, move_to
from rubhpc.running.pool import Pool, RankLost, Totals, last_words

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import TracebackType

    from rubhpc.running.stopping import Stopping

    Part = Callable[[Pool, Stopping], object]

T = TypeVar("T")

_LOOK = 0.5  # s between looks at whether the parent still lives
_PATIENCE = 10.0  # s for workers to end by themselves
_ORPHANED = 75  # exit code of a worker whose parent has ended: run the same command again
_LOST = RankLost("a worker process was lost; run the same command again")


class Sums:
    """The sums of all processes, in a file that they share; a lock of the system guards each change."""

    def __init__(self, handle: int) -> None:
        self._handle = handle
        os.ftruncate(handle, 8 * len(Totals()))
        self._memory = mmap.mmap(handle, 8 * len(Totals()))

    def add(self, increment: Totals) -> Totals:
        """Add, and return what they were."""
        fcntl.lockf(self._handle, fcntl.LOCK_EX)  # given up by the system if this process dies
        try:
            sums = np.frombuffer(self._memory, np.int64)
            before = Totals(*sums.tolist())
            sums += np.array(increment, np.int64)
        finally:
            fcntl.lockf(self._handle, fcntl.LOCK_UN)
        return before

    def reset(self) -> None:
        """Begin again at zero."""
        np.frombuffer(self._memory, np.int64)[:] = 0


class _Shared(Pool):
    """What parent and workers have in common."""

    def __init__(self, rank: int, size: int, sums: Sums) -> None:
        self.rank, self.size, self._sums = rank, size, sums

    def add(self, increment: Totals) -> Totals:
        """See Pool."""
        return self._sums.add(increment)


class Parent(_Shared):
    """The first rank, with the workers that it started; as a context it leaves none behind."""

    def __init__(self, size: int, part: Part) -> None:
        self._part = part
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the run
        super().__init__(0, size, Sums(self._file.fileno()))
        self._workers: list[tuple[subprocess.Popen[bytes], Connection]] = []

    def __enter__(self) -> Self:
        for rank in range(1, self.size):
            here, there = socket.socketpair()
            handles = (there.fileno(), self._file.fileno())
            with there:
                process = subprocess.Popen(
                    command(f"{__package__}.worker_process", *handles, rank, self.size, os.getpid()),
                    pass_fds=handles,
                    env=environment(),
                    stdin=subprocess.DEVNULL,
                    start_new_session=True,  # Ctrl-C is passed on by the parent, as other signals are
                )
            self._workers.append((process, Connection(here.detach())))
        self._send(self._part)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        deadline = time.monotonic() + (_PATIENCE if error is None or isinstance(error, RubError) else 0.0)
        for process, connection in self._workers:
            connection.close()
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, deadline - time.monotonic()))
            process.kill()
            process.wait()
        self._file.close()

    def from_first(self, make: Callable[[], T]) -> T:
        """See Pool."""
        try:
            value = make()
        except RubError as error:
            self._send((None, error))
            raise
        self._send((value, None))
        return value

    def gather(self, value: T) -> list[T]:
        """See Pool."""
        values, is_lost = [value], False
        for process, connection in self._workers:
            try:
                values.append(connection.recv())
            except (EOFError, OSError):
                process.wait()
                is_lost = True
        self._send(None if is_lost else values)
        if is_lost:
            raise _LOST
        return values

    def leave_lost(self) -> None:
        """See Pool."""
        self._workers = [(process, pipe) for process, pipe in self._workers if process.poll() is None]
        self.size = 1 + len(self._workers)
        self._sums.reset()
        for rank, (_, connection) in enumerate(self._workers, start=1):
            with suppress(OSError):  # one more has died: the next meeting shows it
                connection.send((rank, self.size))

    def stop(self) -> None:
        """Stop the workers as by a signal; safe within a signal handler."""
        for process, _ in self._workers:
            with suppress(ProcessLookupError):
                process.send_signal(signal.SIGTERM)

    def abort(self, code: int, text: str = "") -> None:
        """See Pool."""
        for process, _ in self._workers:
            process.kill()

    def _send(self, value: object) -> None:
        for _, connection in self._workers:
            with suppress(OSError):  # it has died: the next meeting shows it
                connection.send(value)


class Child(_Shared):
    """A worker's side."""

    def __init__(self, connection: Connection, sums: Sums, rank: int, size: int) -> None:
        super().__init__(rank, size, sums)
        self._connection = connection

    def from_first(self, make: Callable[[], T]) -> T:
        """See Pool."""
        value, trouble = self._receive()
        if trouble is not None:
            raise trouble
        made: T = value
        return made

    def gather(self, value: T) -> list[T]:
        """See Pool."""
        self._connection.send(value)
        values: list[T] | None = self._receive()
        if values is None:
            raise _LOST
        return values

    def leave_lost(self) -> None:
        """See Pool."""
        self.rank, self.size = self._receive()
        move_to(self.rank, self.size)

    def part(self) -> Part:
        """What to do, as the parent has sent it first."""
        found: Part = self._receive()
        return found

    def abort(self, code: int, text: str = "") -> None:
        """See Pool: this one ends, and the others continue without it."""
        last_words(text)
        os._exit(code)

    def _receive(self) -> Any:
        try:
            return self._connection.recv()
        except (EOFError, OSError):  # the parent has given up
            os._exit(_ORPHANED)


@contextmanager
def start_workers(count: int, part: Part) -> Iterator[Parent]:
    """So many processes for a run, this one among them.

    Parameters
    ----------
    count : int
    part : callable
        What the others do, a function of a module.

    Raises
    ------
    InputError
        It is none, or a launcher has started this process among others.
    """
    if count < 1:
        raise InputError(f"workers: {count} is out of range; it must be at least 1")
    if launch().size > 1:
        raise InputError("workers: mpirun has started several processes already; use one of the two")
    with Parent(count, part) as parent:
        yield parent


def join(arguments: list[str]) -> Child:
    """Join the run that started this process with these arguments, and end with its parent."""
    pipe, file, rank, size, parent = map(int, arguments)
    end_with(parent)
    move_to(rank, size)
    return Child(Connection(pipe), Sums(file), rank, size)


def end_with(parent: int) -> None:
    """End this process soon after its parent has died."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK)
        os._exit(_ORPHANED)

    threading.Thread(target=watch, name="parent watch", daemon=True).start()
