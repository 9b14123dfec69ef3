"""Whether a recorded motion had settled: the transient was long enough."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.measuring.orbit_measures import PERIOD_TOLERANCE, ends_change
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

UNKNOWN = -1  # the record is too short
# Of the halves of a record: distance of their means over the standard deviation within them, and ratio of the
# two standard deviations. Linear drift gives 3.5 and 1, an exponential decay 3.1 and 2, 2.6 and 4, or 2.0 and
# 10. For 57 quasi-periodic and chaotic rubs, 1000 revolutions after their start, they are at most 0.5 and
# 1.3.
MOST_SHIFT, MOST_RATIO = 2.0, 2.0
MOST_CHANGE = PERIOD_TOLERANCE  # of the orbit's size, or of the impulse: less is no change
# Of a longer motion: revolutions of which the mean is taken, and standard errors by which the means of the
# halves may differ. They differ by more in 6 of 100 lasting chaotic motions, and in half of those that end.
BLOCK, MOST_ERRORS = 32, 5.0


def settled(
    motion: Floats, impulse: Floats, samples_per_revolution: int, *, period: int, is_contact: bool
) -> int:
    """Flag of `schema.SETTLED`, or -1 where the record is too short to show it.

    A motion with a period has settled if its first and last whole cycles are the same within 1e-2 of the
    orbit's size. Without a period, or where cycles differ, it has settled if the halves of the record have
    the same statistics: mean cycle, and spread of the cycles about it. In both cases the halves must have the
    same mean impulse. Without contact only a periodic motion has settled: the system is linear.

    Parameters
    ----------
    motion : (n_signal, n_revolution * samples_per_revolution), m
        Displacements; the first two are those of the orbit.
    impulse : (n_stator, n_revolution)
        Of the contact force in each revolution, in any unit.
    period : int
        Revolutions, or 0 where none was found.
    """
    n_revolution = motion.shape[1] // samples_per_revolution
    cycles = motion.reshape(len(motion), n_revolution, samples_per_revolution).swapaxes(0, 1)
    cycles = cycles.reshape(n_revolution, -1) / math.sqrt(samples_per_revolution)
    size = math.sqrt(motion[:2].var(axis=1).sum())
    if n_revolution < 2:
        return UNKNOWN
    if period > 0 and ends_change(cycles, period) <= MOST_CHANGE * size:
        is_settled = True
    elif not is_contact:
        return int(False)
    elif n_revolution < LEAST_REVOLUTIONS:
        return int(False) if period > 0 else UNKNOWN
    else:
        shift, deviation = halves(cycles)
        is_settled = shift <= MOST_SHIFT * _typical(deviation) and max(deviation) <= MOST_RATIO * min(
            deviation
        )
    if n_revolution >= LEAST_REVOLUTIONS:
        shift, deviation = halves(impulse.T)
        least = MOST_CHANGE * float(impulse.mean(axis=1).sum())
        is_settled = is_settled and shift <= max(MOST_SHIFT * _typical(deviation), least)
    return int(is_settled)


def is_steady(energy: Floats) -> bool:
    """Whether the halves of a motion have the same mean energy, within the scatter of its parts.

    Parameters
    ----------
    energy : (n_revolution,)
        At the end of each revolution, in any unit.
    """
    parts = energy[: len(energy) // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1, keepdims=True)
    shift, deviation = halves(parts)
    return shift <= MOST_ERRORS * _typical(deviation) * 2.0 / math.sqrt(len(parts))


def halves(values: Floats) -> tuple[float, tuple[float, float]]:
    """Distance of the means of the first and the second half, and the standard deviation in each.

    Parameters
    ----------
    values : (n_revolution, n)
        The middle row of an odd number belongs to neither half.
    """
    n = len(values) // 2
    first, second = values[:n], values[len(values) - n :]
    shift = float(np.linalg.norm(first.mean(axis=0) - second.mean(axis=0)))
    deviation = [math.sqrt(half.var(axis=0, ddof=1).sum()) for half in (first, second)]
    return shift, (deviation[0], deviation[1])


def _typical(deviation: tuple[float, float]) -> float:
    """Root mean square of the standard deviations of two halves."""
    return math.hypot(*deviation) / math.sqrt(2.0)
