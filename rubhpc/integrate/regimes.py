"""The regime of a motion: no contact, periodic, quasi-periodic or chaotic."""

from __future__ import annotations

import math
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.orbit_measures import LONGEST_PERIOD, PERIOD_TOLERANCE
from rubhpc.schema import REGIME

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LEAST_REVOLUTIONS = LONGEST_PERIOD  # of a record without a period that is worth following further
TORUS_REVOLUTIONS = 2 * LONGEST_PERIOD  # of a record that may show a torus, or a longer period, by itself
N_FIRST, N_ALL, N_MOST = 16, 64, 256  # spans whose growth is measured, each where the last left it open
CLEAR = 0.05  # per revolution: an exponent beyond that over 16 spans keeps its sign
ZERO = 0.01  # per revolution: an exponent within that is none
SURE = 2.0  # standard errors: an exponent within that is none, too
# A torus: the nearest return is that near, of the distance between cycles; that of twice as many revolutions
# is twice as far, by 8 %; and neither half of the record has the farther ones.
NEAR, TWICE, EVEN = 0.21, (1.85, 2.16), 1.5


def regime(
    vertical: Floats,
    horizontal: Floats,
    samples_per_revolution: int,
    *,
    period: int,
    is_contact: bool,
    growth: Iterable[float],
) -> tuple[int, float]:
    """Flag of `schema.REGIME`, and the largest Lyapunov exponent where that had to be measured (else NaN).

    A record shorter than 16 revolutions without a period leaves the motion undecided: it is too short for
    some periods. From 16 to 31 the growth alone decides, for it is measured beyond the record; a longer
    record may show a torus, or a period beyond 16, by itself.

    Parameters
    ----------
    vertical, horizontal : (n_revolution * samples_per_revolution,), m
    period : int
        Revolutions, or 0 where there is no period up to 16.
    growth : iterable of float
        Growth of a small displacement per revolution, span by span; read only where it is needed.
    """
    if not is_contact:
        return REGIME.index("no_contact"), math.nan
    if period > 0:
        return REGIME.index("periodic"), math.nan
    if vertical.size < LEAST_REVOLUTIONS * samples_per_revolution:
        return REGIME.index("undecided"), math.nan
    distances = None
    if vertical.size >= TORUS_REVOLUTIONS * samples_per_revolution:
        distances = cycle_distances(vertical, horizontal, samples_per_revolution)
        size = float(np.var(vertical) + np.var(horizontal))
        if returns(distances).min() <= PERIOD_TOLERANCE**2 * size:
            return REGIME.index("periodic"), math.nan  # of more than 16 revolutions
    spans = iter(growth)
    grown = list(islice(spans, N_FIRST))
    if len(grown) == N_FIRST and abs(np.mean(grown)) < CLEAR:
        if distances is not None and is_torus(distances):
            return REGIME.index("quasi_periodic"), float(np.mean(grown))
        grown += islice(spans, N_ALL - N_FIRST)
        if len(grown) == N_ALL and ZERO < abs(np.mean(grown)) < SURE * standard_error(grown):
            grown += islice(spans, N_MOST - N_ALL)
    if len(grown) < N_FIRST or N_FIRST < len(grown) < N_ALL:
        return REGIME.index("undecided"), math.nan  # the motion next to it cannot go on
    exponent = float(np.mean(grown))
    if len(grown) > N_FIRST and abs(exponent) <= max(ZERO, SURE * standard_error(grown)):
        return REGIME.index("quasi_periodic"), exponent
    return REGIME.index("chaotic" if exponent > 0.0 else "periodic"), exponent


def standard_error(grown: list[float]) -> float:
    """Standard error of the mean of growths that follow one another by chance."""
    return float(np.std(grown)) / math.sqrt(len(grown))


def cycle_distances(vertical: Floats, horizontal: Floats, samples_per_revolution: int) -> Floats:
    """Mean square distance between all whole cycles, (n_revolution, n_revolution), m2."""
    cycles = np.concatenate([s.reshape(-1, samples_per_revolution) for s in (vertical, horizontal)], axis=1)
    cycles = cycles - cycles.mean(axis=0)
    product = cycles @ cycles.T
    square = np.diag(product)
    distances: Floats = np.maximum(square[:, np.newaxis] + square - 2.0 * product, 0.0)
    return distances / samples_per_revolution


def returns(distances: Floats) -> Floats:
    """Mean square distance of cycles 1, 2, ... revolutions apart, up to a third of the record, m2."""
    return np.array([np.diagonal(distances, n).mean() for n in range(1, len(distances) // 3 + 1)])


def is_torus(distances: Floats) -> bool:
    """Whether the cycles lie on a closed curve, along which each revolution takes them by the same share.

    After the revolutions that nearly fill whole rounds of that curve, the cycles are displaced along it by a
    little, and by twice that little after twice as many; those of chaotic motion return to a neighbourhood,
    however often, and those of a motion that still settles draw nearer and nearer.
    """
    square = returns(distances)
    n = int(square.argmin()) + 1
    once, twice = np.diagonal(distances, n), np.diagonal(distances, 2 * n)
    first, last = np.array_split(once, 2)
    near = math.sqrt(once.mean() / (distances.sum() / (distances.size - len(distances))))
    ratio = math.sqrt(twice.mean() / once.mean())
    is_even = max(first.mean(), last.mean()) < EVEN**2 * min(first.mean(), last.mean())
    return near < NEAR and TWICE[0] < ratio < TWICE[1] and bool(is_even)
