"""Who computes which block: one process, or MPI ranks that claim the next from a shared counter.

All ranks compute: a dedicated master would waste one, and a counter in an MPI window, longest block first,
keeps 99 % of the ideal. mpi4py is imported under a launcher only.
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, TypeVar, cast

import numpy as np

from rubhpc.errors import InputError, RubError
from rubhpc.running.launch import Launch, end_with_launcher, killed_with_launcher, launch, move_to

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

T = TypeVar("T")

_NAP = 2e-3  # s between looks at whether the others have come
_PASSED_ON = 0.3  # s, until the launcher has what a rank wrote: it drops the rest once one aborts


class Totals(NamedTuple):
    """Sums over all ranks.

    Blocks claimed; cases done, failed and diverged, and the predicted steps of them all; ranks that stop.
    """

    claimed: int = 0
    done: int = 0
    failed: int = 0
    diverged: int = 0
    cost: int = 0
    stop: int = 0

    @property
    def n_case(self) -> int:
        """Cases that have ended."""
        return self.done + self.failed + self.diverged


class RankLost(RubError):  # noqa: N818 - it is news, and most runs go on
    """A rank has died; the others may continue without it."""

    exit_code = 71


class Pool:
    """The processes that share a run: this one alone. Ranks and workers override what they share."""

    rank: int = 0
    size: int = 1
    is_launched: bool = False  # by mpirun or the like, which stands between the ranks and the terminal

    def __init__(self) -> None:
        self._own = np.zeros(len(Totals()), np.int64)

    def from_first(self, make: Callable[[], T]) -> T:
        """What `make` returns on the first rank, on all ranks; a RubError it raises is raised on all."""
        return make()

    def claim(self) -> Totals:
        """Claim the next block, whose position is `claimed` in the sums as they were before."""
        return self.add(Totals(claimed=1))

    def add(self, increment: Totals) -> Totals:
        """Add to the sums; returns them as they were before."""
        before = Totals(*self._own.tolist())
        self._own += increment
        return before

    def totals(self) -> Totals:
        """The current sums; cheap on the first rank, which holds them."""
        return self.add(Totals())

    def gather(self, value: T) -> list[T]:
        """The values of all ranks, on all of them."""
        return [value]

    def leave_lost(self) -> None:
        """Continue without the lost ranks; ranks, size and sums are reset."""

    def close(self) -> None:
        """End the run together with all ranks."""

    def stop(self) -> None:
        """Have the others stop as this one does, unless a launcher sends its signals to all."""

    def abort(self, code: int, text: str = "") -> None:
        """End the other processes of the run now, or report a text and end this one where that ends them."""


class Ranks(Pool):
    """The ranks of an MPI communicator, with the sums in a window of the first.

    Where the library survives the loss of a rank (Open MPI under `mpirun --with-ft ulfm`), the others learn
    of it at their next meeting as a RankLost; elsewhere the launcher ends them all.
    """

    is_launched = True

    def __init__(self) -> None:
        from mpi4py import MPI

        self._mpi = MPI
        self._comm: Any = MPI.COMM_WORLD
        self._open()

    def _open(self) -> None:
        """Make the window of the sums."""
        self.rank, self.size = self._comm.rank, self._comm.size
        with self._losses():
            n_byte = 8 * len(Totals()) if self.rank == 0 else 0
            self._window = self._mpi.Win.Allocate(n_byte, 8, comm=self._comm)
            if self.rank == 0:
                memory: Any = self._window.tomemory()
                np.frombuffer(memory, np.int64)[:] = 0
            self._comm.Barrier()
            self._window.Lock_all()

    def from_first(self, make: Callable[[], T]) -> T:
        """See Pool."""
        result: tuple[T | None, RubError | None] = (None, None)
        if self.rank == 0:
            try:
                result = (make(), None)
            except RubError as error:
                result = (None, error)
        self._meet()
        with self._losses():
            value, trouble = self._comm.bcast(result)
        if trouble is not None:
            raise trouble
        made: T = value
        return made

    def gather(self, value: T) -> list[T]:
        """See Pool."""
        self._meet()
        with self._losses():
            values: list[T] = self._comm.allgather(value)
        return values

    def leave_lost(self) -> None:
        """See Pool."""
        self._comm.Revoke()  # the others learn of it, whatever they wait for
        with self._losses():
            self._comm = self._comm.Shrink()
        self._open()  # the old window stays: to free it takes all ranks
        move_to(self.rank, self.size, has_lost=True)

    def close(self) -> None:
        """See Pool."""
        with suppress(self._mpi.Exception):
            self._window.Unlock_all()
            self._window.Free()

    def abort(self, code: int, text: str = "") -> NoReturn:
        """See Pool."""
        last_words(text)
        time.sleep(_PASSED_ON)
        self._comm.Abort(code)
        os._exit(code)

    def _meet(self) -> None:
        """Wait for all ranks, asleep: MPI's own waiting takes the core from ranks that still compute."""
        with self._losses():
            request = self._comm.Ibarrier()
            while not request.Test():
                time.sleep(_NAP)

    def add(self, increment: Totals) -> Totals:
        """Add to the sums and return what they were, in one atomic message."""
        added = np.array(increment, np.int64)
        before = np.zeros_like(added)
        with self._losses():
            self._window.Get_accumulate(added, before, 0, op=self._mpi.SUM)
            self._window.Flush(0)
        return Totals(*before.tolist())

    @contextmanager
    def _losses(self) -> Iterator[None]:
        """Raise RankLost for what MPI says of ranks that have died."""
        try:
            yield
        except self._mpi.Exception as error:
            lost = (getattr(self._mpi, name, None) for name in ("ERR_PROC_FAILED", "ERR_REVOKED"))
            if error.Get_error_class() in lost or self._misses_ranks():
                raise RankLost("a rank was lost; run the same command again") from None
            raise

    def _misses_ranks(self) -> bool:
        """Whether another rank has said so, or MPI knows of one that died: Open MPI has other errors too."""
        try:
            return bool(self._comm.Is_revoked()) or self._comm.Get_failed().size > 0
        except (AttributeError, NotImplementedError, self._mpi.Exception):  # MPI without fault tolerance
            return False


def last_words(text: str) -> None:
    """Report a text, if any, before the process ends at once."""
    if text:
        print(f"rubhpc: {text}", file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()


def together(pool: Pool, work: Callable[[], T]) -> list[T]:
    """Do this rank's part, and return what all return; what keeps any from its store is raised on all."""
    result: tuple[T | None, RubError | None] = (None, None)
    try:
        result = (work(), None)
    except RankLost:
        raise
    except RubError as error:
        pool.add(Totals(stop=1))
        result = (None, error)
    found = pool.gather(result)
    for _, trouble in found:
        if trouble is not None:
            raise trouble
    return cast("list[T]", [value for value, _ in found])


def connect() -> Pool:
    """Return the processes of this run: MPI ranks under a launcher, else this one alone.

    Raises
    ------
    InputError
        The launcher started several processes, but MPI does not connect them; the text says how to fix it.
    """
    given = launch()
    end_with_launcher()
    if given.size == 1:
        return Pool()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a foreign launcher, which is refused here
        library, n_connected = _connected(given)
    if n_connected != given.size:
        raise InputError(
            f"the launcher started {given.size} processes, but MPI ({library}) connects {n_connected}; "
            "use the mpirun of that MPI, or mpi4py built for this one (pip install --no-binary mpi4py mpi4py)"
        )
    return Ranks()


def _connected(given: Launch) -> tuple[str, int]:
    """Name of the MPI library, and how many processes it connects."""
    try:
        import mpi4py

        # Not before library and launcher are known to fit: MPICH aborts where Open MPI's mpirun started it.
        mpi4py.rc(initialize=False, finalize=True)
        from mpi4py import MPI
    except ImportError as error:
        raise InputError(
            f"started as {given.size} processes, but mpi4py cannot be used ({error}); "
            "pip install 'rubhpc[mpi]'"
        ) from None
    library = MPI.Get_library_version().split("\n")[0].split(",")[0].strip("\0 ")
    if given.is_open_mpi and any(name in library for name in ("MPICH", "Intel", "MVAPICH")):
        return library, 1
    if not MPI.Is_initialized():
        with killed_with_launcher():
            MPI.Init_thread(MPI.THREAD_FUNNELED)  # other threads keep the lock alive and watch the launcher
    return library, MPI.COMM_WORLD.size
