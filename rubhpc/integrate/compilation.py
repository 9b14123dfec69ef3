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

COMMON = ""
STICK, CURVED = "for friction with stick", "for curved gaps"
STEPS, PERIODIC = "for contact in short steps", "for periodic motions"
RUN_UPS = "for run-ups"
NEIGHBOURS = "for neighbouring motions, which distinguish chaos from order"
# Sets of kernels, each announced, and compiled when a case first needs it -> seconds that it takes, about.
_SECONDS = {COMMON: 10, STICK: 70, CURVED: 70, STEPS: 10, PERIODIC: 10, RUN_UPS: 10, NEIGHBOURS: 10}
_SETS = {  # kernel -> its set; all others are common
    "advance_friction": STICK,
    "advance_by_steps": STEPS,
    "advance_curved": CURVED,
    "follow_revolutions": PERIODIC,
    "search_period": PERIODIC,
    "fill_theory": PERIODIC,
    "advance_pieces": RUN_UPS,
    "carry_along": NEIGHBOURS,
}
_announced: list[str] = []
_expected: set[str] = set()  # sets of the study that is run


def seconds_compiling() -> float:
    """Seconds that this process has spent on compilations so far."""
    return compilation.seconds


def expect_sets(names: set[str]) -> None:
    """Take the sets of kernels that a run may need, for announcements that count them."""
    _expected.update(names)


def to_stderr(text: str) -> None:
    """Print it on the error stream."""
    print(f"rubhpc: {text}", file=sys.stderr, flush=True)


def announce_by(announce: Callable[[str], None]) -> None:
    """Call `announce` before kernels that are in no cache are compiled, once for each set of them."""

    def begin(name: str) -> None:
        place = temporary_folder()
        if place is not None and not _announced:
            announce(f"compiled kernels are kept in {place}; set NUMBA_CACHE_DIR to a folder that lasts")
        kernels = _SETS.get(name, COMMON)
        if kernels not in _announced:
            _announced.append(kernels)
            n = len(_expected.intersection(_announced))
            number = f"set {n} of at most {len(_expected)}, " if kernels in _expected else ""
            purpose = f" {kernels}" if kernels else ""
            announce(
                f"compiling kernels{purpose}, once after an installation: "
                f"{number}about {_SECONDS[kernels]} s on a free core"
            )

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
