"""Processor times of what a run computes, without the compilation of kernels."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, TypeVar

from rubhpc.integrate.compilation import seconds_compiling

if TYPE_CHECKING:
    from collections.abc import Callable

_Result = TypeVar("_Result")

_LEAST = 1e-6  # s, least time, so that times are not zero


class Enough(Exception):  # noqa: N818 - no error: what cuts off a run
    """A run takes longer than is waited for."""


class Stopwatch:
    """Times runs; one in which kernels were compiled is repeated.

    Attributes
    ----------
    compiling : float
        Processor seconds of the runs in which kernels were compiled.
    """

    def __init__(self) -> None:
        self.compiling = 0.0

    def timed(
        self, run: Callable[[Callable[[], None]], _Result], most: float
    ) -> tuple[float, _Result | None]:
        """Processor time of a run, s, and its result: None where it was stopped after `most` s.

        The run receives a function that it must call regularly.
        """
        while True:
            compiled, began = seconds_compiling(), time.process_time()
            try:
                result = run(_limit(most))
            except Enough:
                result = None
            taken = time.process_time() - began
            if seconds_compiling() == compiled:
                return max(taken, _LEAST), result
            self.compiling += taken


def _limit(seconds: float) -> Callable[[], None]:
    """Check that ends a run after so much processor time from now."""
    end = time.process_time() + seconds

    def check() -> None:
        if time.process_time() > end:
            raise Enough

    return check
