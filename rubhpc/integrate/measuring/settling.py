"""Whether a recorded motion had settled: the transient was long enough."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.measuring.orbit_measures import PERIOD_TOLERANCE, ends_change
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

UNKNOWN = -1  # the record is too short
# Of the halves of a record: distance of their means over the standard deviation within them, and ratio of the
# two standard deviations. Linear drift gives 3.5 and 1, an exponential decay 3.1 and 2, 2.6 and 4, or 2.0 and
# 10. For 57 quasi-periodic and chaotic rubs, 1000 revolutions after their start, they are at most 0.5 and
# 1.3.
MOST_SHIFT, MOST_RATIO = 2.0, 2.0
MOST_CHANGE = PERIOD_TOLERANCE  # of a signal's size, or of the impulse: less is no change
NEGLIGIBLE = 1e-4  # of the motion's size in the unit of another signal: that varies by less, and is not heard
# Of a longer motion: revolutions of which the mean is taken, and standard errors by which the means of the
# halves may differ. They differ by more in 6 of 100 lasting chaotic motions, and in half of those that end.
BLOCK, MOST_ERRORS = 32, 5.0


def settled(
    motion: Floats,
    impulse: Floats,
    samples_per_revolution: int,
    *,
    period: int,
    is_contact: bool,
    others: Sequence[Floats] = (),
) -> int:
    """Flag of `schema.SETTLED`, or -1 where the record is too short to show it.

    The motion of the rim and each of the other signals must have settled, on its own scale (`_has_settled`),
    and the halves of the record must have the same mean impulse.

    Parameters
    ----------
    motion : (n_signal, n_revolution * samples_per_revolution), m
        Displacements; the first two are those of the orbit, whose size is the scale of all.
    impulse : (n_stator, n_revolution)
        Of the contact force in each revolution, in any unit.
    period : int
        Revolutions, or 0 where none was found.
    others : sequence of (n_signal, n_revolution, n)
        What is compared of further signals in each revolution, in the unit of the signal.
    """
    n_revolution = motion.shape[1] // samples_per_revolution
    cycles = motion.reshape(len(motion), n_revolution, samples_per_revolution).swapaxes(0, 1)
    cycles = cycles.reshape(1, n_revolution, -1) / math.sqrt(samples_per_revolution)
    size = np.sqrt(motion[:2].var(axis=1).sum(keepdims=True))
    if n_revolution < 2:
        return UNKNOWN
    flags = [_has_settled(cycles, size, period, is_contact=is_contact)]
    for each in others:
        flags.append(_has_settled(each, _size(each), period, is_contact=is_contact))
    if n_revolution >= LEAST_REVOLUTIONS:
        shift, deviation = halves(impulse.T)
        least = MOST_CHANGE * float(impulse.mean(axis=1).sum())
        flags.append(int(float(shift) <= max(MOST_SHIFT * float(_typical(deviation)), least)))
    return next((flag for flag in (int(False), UNKNOWN) if flag in flags), int(True))


def heard(signals: Floats, samples_per_revolution: int, least: float, *, jumps: bool = False) -> Floats:
    """What `settled` compares of other signals in each revolution, (n, n_revolution, n_value).

    Those that vary by less than `least`, or by less than 1e-4 of their largest value, are left out. Of
    signals that jump, which differ in a whole sample where a contact begins a little later, it is the
    standard deviation in each revolution.

    Parameters
    ----------
    signals : (n_signal, n_revolution * samples_per_revolution)
    least : float
        In their unit.
    """
    most = np.abs(signals).max(axis=1, initial=0.0)
    audible = signals[signals.std(axis=1) > np.maximum(least, NEGLIGIBLE * most)]
    n_revolution = signals.shape[1] // samples_per_revolution
    about = audible - audible.mean(axis=1, keepdims=True)
    cycles: Floats = about.reshape(len(audible), n_revolution, samples_per_revolution)
    if jumps:
        return np.asarray(cycles.std(axis=2, keepdims=True))
    return cycles / math.sqrt(samples_per_revolution)


def _has_settled(cycles: Floats, size: Floats, period: int, *, is_contact: bool) -> int:
    """Whether signals, (n, n_revolution, n_value), of these sizes (n,) have all settled, or -1.

    One with a period has if its first and last whole cycles are the same within 1e-2 of its size. Without a
    period, or where cycles differ, it has if the halves of the record have the same statistics: mean cycle,
    spread of the cycles about it, and distance of the cycles from that of the whole record. Without contact
    only a periodic motion has settled: the system is linear.
    """
    n_revolution = cycles.shape[1]
    if period > 0:
        cycles = cycles[ends_change(cycles, period) > MOST_CHANGE * size]
    if not len(cycles):
        return int(True)
    if not is_contact:
        return int(False)
    if n_revolution < LEAST_REVOLUTIONS:
        return int(False) if period > 0 else UNKNOWN
    shift, deviation = halves(cycles)
    is_settled = (shift <= MOST_SHIFT * _typical(deviation)) & (
        np.maximum(*deviation) <= MOST_RATIO * np.minimum(*deviation)
    )
    distance = np.linalg.norm(cycles - cycles.mean(axis=1, keepdims=True), axis=2, keepdims=True)
    shift, deviation = halves(distance)
    return int(np.all(is_settled & (shift <= MOST_SHIFT * _typical(deviation))))


def _size(cycles: Floats) -> Floats:
    """Size of signals, (n,): root mean square over the revolutions."""
    return np.asarray(np.sqrt((cycles**2).sum(axis=2).mean(axis=1)))


def is_steady(energy: Floats) -> bool:
    """Whether the halves of a motion have the same mean energy, within the scatter of its parts.

    Parameters
    ----------
    energy : (n_revolution,)
        At the end of each revolution, in any unit.
    """
    parts = energy[: len(energy) // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1, keepdims=True)
    shift, deviation = halves(parts)
    return bool(shift <= MOST_ERRORS * _typical(deviation) * 2.0 / math.sqrt(len(parts)))


def halves(values: Floats) -> tuple[Floats, tuple[Floats, Floats]]:
    """Distance of the means of the first and the second half, and the standard deviation in each, (...).

    Parameters
    ----------
    values : (..., n_revolution, n)
        The middle row of an odd number belongs to neither half.
    """
    n = values.shape[-2] // 2
    first, second = values[..., :n, :], values[..., values.shape[-2] - n :, :]
    shift = np.linalg.norm(first.mean(axis=-2) - second.mean(axis=-2), axis=-1)
    deviation = [np.sqrt(half.var(axis=-2, ddof=1).sum(axis=-1)) for half in (first, second)]
    return shift, (deviation[0], deviation[1])


def _typical(deviation: tuple[Floats, Floats]) -> Floats:
    """Root mean square of the standard deviations of two halves."""
    return np.asarray(np.hypot(*deviation) / math.sqrt(2.0))
