"""Requests to stop a run: a signal, a file STOP in the store, or the time limit."""

from __future__ import annotations

import os
import signal
import threading
import time
from typing import TYPE_CHECKING, Self

from rubhpc.errors import InputError
from rubhpc.running.launch import launch

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import FrameType, TracebackType

_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)
_LOOK = 0.5  # s between looks for the file STOP
_INTERRUPTED = b"stopping; the store keeps every finished case, run the same command again to continue\n"
SLURM_MARGIN = 30.0  # s kept free before Slurm ends the job: a block's files, the packing, and slow disks


class Stopped(Exception):  # noqa: N818 - it drops the current case and is not an error
    """Raised inside a case to drop it."""


class Stopping:
    """Whether to stop, and why; as a context it handles the signals that request it."""

    def __init__(self) -> None:
        self.reason = ""
        self._stop_file: Path | None = None
        self._deadline = float("inf")
        self._has_skipped = False
        self._looked = 0.0
        self._began = time.monotonic()
        self._handlers: dict[int, object] = {}
        self._forward: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._handlers = {number: signal.signal(number, self._note) for number in _SIGNALS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._handlers = {}

    def watch(self, stop_file: Path, time_limit: float | None) -> None:
        """Watch a file, a time limit (s from when this object was made) and the end of a Slurm job."""
        self._stop_file = stop_file
        if time_limit is not None:
            self._deadline = self._began + time_limit
        slurm_end = os.environ.get("SLURM_JOB_END_TIME", "")
        if slurm_end:
            try:
                left = float(slurm_end) - time.time()
            except ValueError:
                raise InputError(f"SLURM_JOB_END_TIME={slurm_end}: not a time; unset it") from None
            self._deadline = min(self._deadline, time.monotonic() + left - SLURM_MARGIN)

    def look(self) -> str:
        """Why to stop now; empty to continue."""
        now = time.monotonic()
        if not self.reason and now >= self._deadline:
            self.reason = "the time limit"
        if not self.reason and self._stop_file is not None and now - self._looked > _LOOK:
            self._looked = now
            if self._stop_file.exists():
                self.reason = "the file STOP"
        return self.reason

    def fits(self, seconds: float) -> bool:
        """Whether what takes so long ends before the time does."""
        fits = time.monotonic() + seconds < self._deadline
        self._has_skipped |= not fits
        return fits

    @property
    def verdict(self) -> str:
        """Why the run has not done all: the reason to stop, or that something did not fit into its time."""
        return self.reason or ("the time limit" if self._has_skipped else "")

    def ask(self, reason: str) -> None:
        """Have the run stop."""
        if not self.reason:
            self.reason = reason
            self._forward()

    def forward_to(self, others: Callable[[], None]) -> None:
        """Call this when the run is asked to stop."""
        self._forward = others
        if self.reason:
            others()

    def _note(self, number: int, frame: FrameType | None) -> None:
        if (
            number == signal.SIGINT and self.reason == "SIGINT"
        ):  # a second SIGINT: do not even store the finished cases of this block
            raise KeyboardInterrupt
        if number == signal.SIGINT and not self.reason and launch().size > 1 and launch().rank == 0:
            os.write(2, _INTERRUPTED)  # the launcher kills without a word at the second
        self.ask(signal.Signals(number).name)
