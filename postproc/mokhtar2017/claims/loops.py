"""How many loops an orbit has: those into which it falls apart where it crosses itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.signals.spectra import samples_per_revolution

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

_POINTS = 128  # a revolution
_SMALLEST = 0.05  # size of a loop that counts, over that of the orbit


def loops_of(case: xr.Dataset) -> int:
    """Return the number of loops in one period of a case's orbit; 0 where it has no period.

    At every crossing the curve is cut and joined again so that each branch goes on into the other, in the
    sense of its motion (Seifert 1934). An orbit that whirls n times round its centre falls into n loops,
    however often they cross each other, and a figure of eight into two.
    """
    period = int(case["period"])
    if period == 0:
        return 0
    n = samples_per_revolution(case["vertical"])
    path = (case["vertical"].values + 1j * case["horizontal"].values)[-period * n :: max(n // _POINTS, 1)]
    return count_loops(path.astype(complex))


def count_loops(path: NDArray[np.complex128]) -> int:
    """Return the number of loops of a closed curve, given by points along it, (n,)."""
    first, second = _crossings(path)
    if first.size == 0:
        return 1
    # Passages through crossings: i and i + n are those of one crossing, in places along the curve.
    places = np.concatenate((first, second))
    partner = np.roll(np.arange(places.size), first.size)
    order = np.argsort(places, kind="stable")
    following = np.empty_like(order)
    following[order] = np.roll(order, -1)
    smallest = _SMALLEST * _size(path)
    count = 0
    unseen = set(range(places.size))
    while unseen:
        passage = min(unseen)
        loop: list[NDArray[np.complex128]] = []
        while passage in unseen:
            unseen.discard(passage)
            loop.append(_between(path, places[passage], places[following[passage]]))
            passage = int(partner[following[passage]])
        count += _size(np.concatenate(loop)) > smallest
    return count


def _crossings(path: NDArray[np.complex128]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the curve crosses itself, as places along it: segment plus the part of it."""
    i, j = np.triu_indices(path.size, k=2)
    step = np.roll(path, -1) - path
    across = _cross(step[i], step[j])
    gap = path[j] - path[i]
    with np.errstate(divide="ignore", invalid="ignore"):
        along_i, along_j = _cross(gap, step[j]) / across, _cross(gap, step[i]) / across
    meets = (along_i >= 0) & (along_i < 1) & (along_j >= 0) & (along_j < 1)
    meets &= ~((i == 0) & (j == path.size - 1))  # neighbours across the end
    return i[meets] + along_i[meets], j[meets] + along_j[meets]


def _cross(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> NDArray[np.float64]:
    return a.real * b.imag - a.imag * b.real


def _between(path: NDArray[np.complex128], start: float, end: float) -> NDArray[np.complex128]:
    last = end if end > start else end + path.size
    return path[np.arange(int(start) + 1, int(last) + 1) % path.size]


def _size(points: NDArray[np.complex128]) -> float:
    return float(np.hypot(np.ptp(points.real), np.ptp(points.imag))) if points.size else 0.0
