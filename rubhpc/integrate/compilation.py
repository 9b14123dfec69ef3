"""Announces the compilation of kernels and counts its time, which is not part of a case's computing time."""

from __future__ import annotations

import gc
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from numba.core import event

from rubhpc.kernels._cache import temporary_folder
from rubhpc.kernels._jit import compilation

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_LONG = _STICK, _CURVED = "for friction with stick", "for curved gaps"  # parts that take more than a minute
# Kernels with their own announcement -> purpose; they are compiled when a case first needs them.
_PARTS = {
    "advance_friction": _STICK,
    "advance_by_steps": "for contact in short steps",
    "advance_curved": _CURVED,
    "follow_revolutions": "for periodic motions",
    "search_period": "for periodic motions",
    "fill_theory": "for periodic motions",
    "advance_pieces": "for run-ups",
    "carry_along": "for neighbouring motions, which distinguish chaos from order",
}
_announced: set[str] = set()


def seconds_compiling() -> float:
    """Seconds that this process has spent on compilations so far."""
    return compilation.seconds


def to_stderr(text: str) -> None:
    """Print it on the error stream."""
    print(f"rubhpc: {text}", file=sys.stderr, flush=True)


def announce_by(announce: Callable[[str], None]) -> None:
    """Call `announce` before kernels that are in no cache are compiled, once for each part of the program."""

    def begin(name: str) -> None:
        place = temporary_folder()
        if place is not None and not _announced:
            announce(f"compiled kernels are kept in {place}; set NUMBA_CACHE_DIR to a folder that lasts")
        part = _PARTS.get(name, "")
        if part not in _announced:
            _announced.add(part)
            lasts = "one to three minutes" if part in _LONG else "up to a minute"
            announce(f"compiling kernels{part and ' '}{part}, once after an installation: {lasts}")

    compilation.began = begin


@contextmanager
def announced_by(announce: Callable[[str], None]) -> Iterator[None]:
    """`announce_by` within a context."""
    before = compilation.began
    announce_by(announce)
    try:
        yield
    finally:
        compilation.began = before


class _Uncollected(event.Listener):
    """Disables garbage collection while kernels are compiled (90 MB): it takes a twelfth of the time.

    A later scan of these objects takes as long, so that they are excluded: the process is 80 MB larger.
    """

    def __init__(self) -> None:
        self._depth, self._was_enabled = 0, False

    def on_start(self, event: Any) -> None:
        if self._depth == 0:
            self._was_enabled = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0 and self._was_enabled:
            gc.freeze()
            gc.enable()


event.register("numba:compile", _Uncollected())  # type: ignore[no-untyped-call]
announce_by(to_stderr)
