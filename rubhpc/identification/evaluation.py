"""The likelihood of a case, as each process evaluates it, and the processes that share the cases."""

from __future__ import annotations

from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

from rubhpc.errors import RubError
from rubhpc.identification.evaluated import Evaluated
from rubhpc.identification.priors import at_shares
from rubhpc.running.ending import ended_together
from rubhpc.running.pool import connect, together
from rubhpc.running.workers import start_workers
from rubhpc.streams import lasting_streams
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.identification.candidates import Outcome, Rub
    from rubhpc.running.pool import Pool
    from rubhpc.running.stopping import Stopping

    Floats = NDArray[np.float64]

T = TypeVar("T")

_current: list[Evaluator] = []  # of this process: a sampler sends points alone


@dataclass(frozen=True, kw_only=True)
class Task:
    """What is to be evaluated.

    Attributes
    ----------
    rub : Rub
    folder : Path or None
        For cases that are done.
    content : str
        See `Evaluated`.
    rank : int
    """

    rub: Rub
    folder: Path | None = None
    content: str = ""
    rank: int = 0


class Evaluator:
    """Evaluates cases, each once."""

    def __init__(self, task: Task) -> None:
        self.rub = task.rub
        n_stator, n_value = task.rub.n_stator, len(task.rub.priors)
        like = task.rub.comparison.measured
        self.evaluated = Evaluated(task.folder, task.content, like, n_value, n_stator, task.rank)

    def outcome(self, values: Floats) -> Outcome:
        """Return the outcome of a case, known or computed."""
        known = self.evaluated.of(values)
        if known is None:
            known = self.rub.outcome(values.tolist())
            self.evaluated.keep(values, known)
        return known


def use(task: Task) -> None:
    """Evaluate this from here on."""
    _current[:] = [Evaluator(task)]


def evaluator() -> Evaluator:
    """Return what is evaluated."""
    return _current[0]


def current_likelihood(values: Floats) -> float:
    """Return the logarithm of the likelihood of a case of what is evaluated."""
    return evaluator().rub.log_likelihood(evaluator().outcome(values))


def current_values(shares: Floats) -> Floats:
    """Return the values at a point of the unit cube of what is evaluated."""
    return at_shares(evaluator().rub.priors, shares)


class Shared:
    """Maps functions over the processes of a pool, in the order of the items."""

    def __init__(self, pool: Pool) -> None:
        self._pool = pool
        self._is_met = True  # whether the others wait for more
        self.size = pool.size

    def use(self, task: Task) -> None:
        """Have all processes evaluate a task."""
        self.map(use, [replace(task, rank=rank) for rank in range(self._pool.size)])

    def map(self, function: Callable[[Any], T], items: Iterable[Any]) -> list[T]:
        """Return the values of a function of a module."""
        listed = list(items)
        work = self._pool.from_first(lambda: (function, listed))
        self._is_met = False
        parts = _share(self._pool, work)
        self._is_met = True
        return [parts[i % self._pool.size][i // self._pool.size] for i in range(len(listed))]

    def close(self) -> None:
        """Let the others go, if what was raised has not ended them too."""
        if self._is_met:
            self._pool.from_first(lambda: None)


@contextmanager
def sharing(pool: Pool) -> Iterator[Shared]:
    """Share work with the other processes of a pool; at the end they are let go."""
    with ended_together(pool):
        shared = Shared(pool)
        try:
            yield shared
        except RubError:
            shared.close()
            raise
        shared.close()


def processes(workers: int) -> AbstractContextManager[Pool]:
    """Return the processes of this run: the ranks of a launcher, or so many workers."""
    if workers > 1:
        return start_workers(workers, take_part)
    return nullcontext(connect())


def _share(pool: Pool, work: tuple[Callable[[Any], Any], list[Any]]) -> list[list[Any]]:
    function, items = work
    return together(pool, lambda: [function(item) for item in items[pool.rank :: pool.size]])


@on_one_thread
@lasting_streams()
def take_part(pool: Pool, stopping: Stopping | None = None) -> None:
    """Evaluate what the first rank sends until it is done."""

    def unknown() -> Any:
        raise AssertionError("a worker is not the first rank")

    with ended_together(pool):
        while (work := pool.from_first(unknown)) is not None:
            _share(pool, work)
