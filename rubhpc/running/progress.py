"""Progress of a run: a bar on a terminal, an occasional line elsewhere."""

from __future__ import annotations

import shutil
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Self

from rubhpc.integrate.compilation import announced_by, seconds_compiling, to_stderr
from rubhpc.storage.duration import duration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import TracebackType

    from rich.progress import Progress as Bar

    from rubhpc.running.pool import Totals

_REDRAW = 0.2  # s between redraws of the bar
_LONG_CASE = 5.0  # s that a case takes until its progress is shown
_FIRST_LINE, _LONGEST_GAP = 10.0, 300.0  # s between lines: they grow rarer as a run grows long


class Progress:
    """Reports how many cases have ended, how fast, and the time left.

    Parameters
    ----------
    n_case, n_done : int
        Cases of the study, and those that were there before.
    cost : float
        Predicted steps of what is missing.
    quiet : bool
        Report nothing.
    has_bar : bool
        Draw a bar, where the output is a terminal. Under a launcher it is none: Open MPI's pretends to be one
        even when it writes to a file.
    """

    def __init__(
        self,
        n_case: int,
        cost: float,
        *,
        n_done: int,
        quiet: bool,
        has_bar: bool,
    ) -> None:
        self._n_case, self._cost, self._n_done = n_case, max(cost, 1.0), n_done
        self._quiet = quiet or n_done == n_case
        self._has_bar = has_bar and sys.stdout.isatty()
        self._shown = time.monotonic()
        self._began = self._shown - seconds_compiling()
        self._gap = _FIRST_LINE
        self._bar: Bar | None = None
        self._doing, self._doing_since = "", self._shown

    def __enter__(self) -> Self:
        if self._quiet:
            return self
        if self._has_bar:
            from rich import progress

            self._bar = progress.Progress(
                progress.TextColumn("{task.completed:.0f}/{task.total:.0f} cases"),
                progress.BarColumn(bar_width=None),
                progress.TextColumn("{task.fields[rest]}"),
            )
            self._bar.start()
            self._bar.add_task("", total=self._n_case, completed=self._n_done, rest="")
        else:
            print(f"{self._n_done}/{self._n_case} cases are stored; computing the rest", flush=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def expect(self, n_case: int) -> None:
        """Take the number of cases of a refined map as it is now predicted."""
        if n_case > self._n_done:
            self._cost *= (n_case - self._n_done) / max(self._n_case - self._n_done, 1)
            self._n_case = n_case
            if self._bar is not None:
                self._bar.update(self._bar.task_ids[0], total=n_case)

    def update(self, sums: Totals) -> None:
        """Show the sums of all ranks, unless that was done a moment ago."""
        now = time.monotonic()
        if self._quiet or now - self._shown < (_REDRAW if self._has_bar else self._gap):
            return
        self._shown = now
        n_ended = self._n_done + sums.n_case
        if self._bar is None:
            among = (
                f"/{self._n_case} cases" if n_ended <= self._n_case else f" cases, {self._n_case} expected"
            )
            print(f"{n_ended}{among}; {self._rest(sums)}", flush=True)
            self._gap = min(max(self._gap, 0.1 * (now - seconds_compiling() - self._began)), _LONGEST_GAP)
        else:
            total = max(self._n_case, n_ended)
            self._bar.update(self._bar.task_ids[0], completed=n_ended, total=total, rest=self._rest(sums))

    def say(self, doing: str) -> None:
        """Take what the case that is computed here has come to; "" at its end."""
        if not (doing and self._doing):
            self._doing_since = time.monotonic()
        self._doing = doing

    def _rest(self, sums: Totals) -> str:
        """Rate, time left (by predicted steps, for cases differ) and what went wrong."""
        seconds = max(time.monotonic() - seconds_compiling() - self._began, 1e-9)
        is_long = self._doing and time.monotonic() - self._doing_since > _LONG_CASE
        texts = [self._doing] if is_long else []
        if sums.n_case or not texts:
            texts.append(f"{sums.n_case / seconds:.3g} a second")
        if sums.cost and self._n_done + sums.n_case <= self._n_case:
            left = seconds * (self._cost - sums.cost) / sums.cost
            texts.append(f"{duration(max(left, 0.0))} left")
        if sums.failed:
            texts.append(f"{sums.failed} failed")
        if sums.diverged:
            texts.append(f"{sums.diverged} diverged")
        return ", ".join(texts)


@contextmanager
def one_line() -> Iterator[Callable[[str], None]]:
    """Show texts on the error stream, each in place of the last, and none at the end; on a terminal only."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return

    def say(text: str) -> None:
        width = shutil.get_terminal_size().columns - 1
        print(f"\r\x1b[K{text[:width]}", end="", file=sys.stderr, flush=True)

    def announce(text: str) -> None:
        say("")
        to_stderr(text)

    try:
        with announced_by(announce):
            yield say
    finally:
        say("")
