"""Ranks as threads of one process that take turns, on a clock that goes on only when all of them wait.

Cases last as long as a test says, and where ranks wait for each other is known exactly.
"""

from __future__ import annotations

import pickle
import threading
from dataclasses import dataclass, field
from typing import Any

from rubhpc.running.pool import Pool, Totals


@dataclass
class Simulation:
    """The clock of some ranks, and what happened on it.

    Attributes
    ----------
    now : float
    waits : list of (float, float, int)
        When a rank came to a meeting, when all were there, and how many cases began in between.
    """

    size: int
    patience: float = 120.0  # s of this machine
    now: float = 0.0
    n_begun: int = 0
    waits: list[tuple[float, float, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._turn = threading.Condition()
        self._wake = dict.fromkeys(range(self.size), 0.0)
        self._current = 0
        self._sums = [0] * len(Totals())
        self._brought: dict[int, tuple[bytes, float, int]] = {}
        self._shared: list[bytes] = []

    def run(self, work: Any) -> list[Any]:
        """Call `work(pool)` for every rank, and return what they return, or raise what one of them raises."""
        results: list[Any] = [None] * self.size
        errors: list[BaseException] = []

        def live(rank: int) -> None:
            self._await(rank)
            try:
                results[rank] = work(SimulatedRank(self, rank))
            except BaseException as error:
                errors.append(error)
                with self._turn:
                    for other in self._wake:
                        self._wake[other] = self.now  # the others end at their next turn
            finally:
                del self._wake[rank]
                self._pass_on()

        threads = [threading.Thread(target=live, args=(rank,), daemon=True) for rank in range(self.size)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(self.patience)
            assert errors or not thread.is_alive(), "ranks wait for each other forever"
        if errors:
            raise errors[0]
        return results

    def sleep(self, rank: int, seconds: float) -> None:
        """Let so much time go by for a rank."""
        self._wake[rank] = self.now + seconds
        self._pass_on()
        self._await(rank)

    def last(self, seconds: float) -> None:
        """Let a case of the rank whose turn it is last so long."""
        self.n_begun += 1
        self.sleep(self._current, seconds)

    def meet(self, rank: int, value: object) -> list[Any]:
        """Wait until all ranks are here; returns what they have brought."""
        self._brought[rank] = pickle.dumps(value), self.now, self.n_begun
        if len(self._brought) == self.size:
            self._shared = [self._brought[i][0] for i in range(self.size)]
            self.waits += [(came, self.now, self.n_begun - n) for _, came, n in self._brought.values()]
            self._brought.clear()
            self._wake = dict.fromkeys(self._wake, self.now)
        else:
            self._wake[rank] = float("inf")
        self._pass_on()
        self._await(rank)
        return [pickle.loads(data) for data in self._shared]

    def add(self, increment: Totals) -> Totals:
        """Add to the sums; returns what they were."""
        before = Totals(*self._sums)
        self._sums = [a + b for a, b in zip(self._sums, increment, strict=True)]
        return before

    def _pass_on(self) -> None:
        """Give the turn to the rank that wakes first."""
        with self._turn:
            if self._wake:
                self._current = min(self._wake, key=lambda rank: (self._wake[rank], rank))
                self.now = max(self.now, self._wake[self._current])
            self._turn.notify_all()

    def _await(self, rank: int) -> None:
        with self._turn:
            assert self._turn.wait_for(lambda: self._current == rank, self.patience), "no turn came"


class SimulatedRank(Pool):
    """A rank; see `rubhpc.running.pool.Pool`."""

    def __init__(self, simulation: Simulation, rank: int) -> None:
        self._simulation, self.rank, self.size = simulation, rank, simulation.size

    def from_first(self, make: Any) -> Any:
        return self._simulation.meet(self.rank, make() if self.rank == 0 else None)[0]

    def add(self, increment: Totals) -> Totals:
        return self._simulation.add(increment)

    def gather(self, value: object) -> list[Any]:
        return self._simulation.meet(self.rank, value)
