"""Signals at uniform angles of the shaft, from uniform times: order tracking by resampling."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from postproc.signals.resampling import between, decimated

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from postproc.measured.shaft import Turning

    Floats = NDArray[np.float64]

_ASIDE = 1  # revolutions on either side of a block, which its filter sees


def by_angle(values: Floats, step: float, turning: Turning, first: int, end: int, n: int) -> Floats:
    """Return a signal at `n` uniform angles of each revolution from `first` up to `end`, whole ones.

    Where the shaft turns so slowly that there are more samples in a revolution than `n`, orders beyond half
    of `n` are filtered off. The values (n_sample,) are `step` seconds apart.
    """
    seen = between(values)
    parts = []
    for begin, stop, times in _blocks(step, turning, first, end, n):
        wanted = np.arange((begin - _ASIDE) * n * times, (stop + _ASIDE) * n * times) / (n * times)
        at = turning.time_at(np.clip(wanted, turning.first, turning.last))
        fine = decimated(seen(at / step), times)
        parts.append(fine[_ASIDE * n : (_ASIDE + stop - begin) * n])
    return np.concatenate(parts)


def _blocks(step: float, turning: Turning, first: int, end: int, n: int) -> Iterator[tuple[int, int, int]]:
    """Yield the revolutions in whose samples `n` fit as many times, a power of two, and that number."""
    lasts = np.diff(turning.time_at(np.arange(first, end + 1).astype(float)))
    times = [2 ** max(0, math.ceil(math.log2(last / (step * n)))) for last in lasts.tolist()]
    begin = 0
    for i in range(1, len(times) + 1):
        if i == len(times) or times[i] != times[begin]:
            yield first + begin, first + i, times[begin]
            begin = i
