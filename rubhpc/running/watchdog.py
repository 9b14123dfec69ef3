"""Ends a rank whose case does not return: within a kernel call no time limit can be checked."""

from __future__ import annotations

import os
import sys
import threading
import time
from typing import TYPE_CHECKING, Self

from rubhpc.running.launch import launch

if TYPE_CHECKING:
    from types import TracebackType

    from rubhpc.storage.in_progress import InProgress

PATIENCE = 10.0  # s over its limit until a case checks its limit: a kernel call lasts 0.25 s
_LOOK = 0.5  # s between looks
_STOPPED = 75  # exit code: run the same command again


class Watchdog:
    """Watches the cases of a rank, as a context; without a limit (s) it watches nothing.

    A kernel that does not return cannot be interrupted. The rank therefore records its case as overrun and
    exits, and the launcher ends the other ranks; the next run marks the case as failed and continues.
    """

    def __init__(self, limit: float | None, record: InProgress) -> None:
        self.limit, self._record = limit, record
        self._deadline = float("inf")
        self._ended = threading.Event()

    def begin(self, flat: int, name: str) -> None:
        """A case begins."""
        self._record.take(flat, name)
        if self.limit is not None:
            self._deadline = time.monotonic() + self.limit + PATIENCE

    def end(self) -> None:
        """The case has ended."""
        self._deadline = float("inf")

    def __enter__(self) -> Self:
        if self.limit is not None:
            threading.Thread(target=self._look, args=(self.limit,), name="case watch", daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()

    def _look(self, limit: float) -> None:
        while time.monotonic() < self._deadline:
            if self._ended.wait(_LOOK):
                return
        self._record.note_overrun(limit)
        print(
            f"rubhpc: rank {launch().rank}: a case is over its time limit of {limit:g} s and cannot be "
            "interrupted; run the same command again, which skips this case",
            file=sys.stderr,
            flush=True,
        )
        os._exit(_STOPPED)
