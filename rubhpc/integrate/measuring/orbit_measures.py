"""A recorded orbit: its period, the sense of its whirl, and how nearly its cycles return."""

from __future__ import annotations

import math
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LONGEST_PERIOD = 16  # revolutions
PERIOD_TOLERANCE = 1e-2  # rms distance of whole cycles over the orbit's size

EQUAL = 1e-5  # of the orbit's size: nearer cycles are the same, where no motion can be solved for
NOISE, ALIKE = 1e-9, 2.0  # of the orbit's size, times the nearest return: counts as nearest
# A torus: limits of the nearest return, relative to the distance between cycles; of the return after twice as
# many revolutions, twice as far within 8 %; and of the difference between the halves of the record.
NEAR, TWICE, EVEN = 0.21, (1.85, 2.16), 1.5


def period(vertical: Floats, horizontal: Floats, samples_per_revolution: int) -> int:
    """Period of the orbit in revolutions; 0 where it has none up to 16 (or the record is too short).

    Whole cycles are compared: the rms distance between revolutions k and k + n over the orbit's size stays
    under 1e-2. Section points alone could show a period-2 orbit as period 1.

    Parameters
    ----------
    vertical, horizontal : (n_revolution * samples_per_revolution,), m
    """
    signals = vertical - vertical.mean(), horizontal - horizontal.mean()
    n_revolution = vertical.size // samples_per_revolution
    most = PERIOD_TOLERANCE**2 * sum(float(signal @ signal) for signal in signals) / vertical.size

    def distance(shift: int, end: int) -> float:
        """Sum of squared distances between the first samples, up to `end`, and those a shift later."""
        changes = [signal[shift : shift + end] - signal[:end] for signal in signals]
        return sum(float(change @ change) for change in changes)

    for n in range(1, min(LONGEST_PERIOD, n_revolution - 1) + 1):
        shift = n * samples_per_revolution
        n_pair = vertical.size - shift
        # The first revolution alone usually excludes a period.
        if all(distance(shift, end) <= most * n_pair for end in (samples_per_revolution, n_pair)):
            return n
    return 0


def ends_change(cycles: Floats, period: int) -> Floats:
    """Root mean square distance of the first cycles from the last ones whole periods later, (...).

    Parameters
    ----------
    cycles : (..., n_revolution, n)
        The distance of two is their Euclidean one.
    """
    n = cycles.shape[-2]
    shift = period * ((n - 1) // period)
    change = cycles[..., shift:, :] - cycles[..., : n - shift, :]
    return np.asarray(np.sqrt((change**2).sum(axis=(-2, -1)) / (n - shift)))


def whirl_ratio(vertical: Floats, horizontal: Floats, samples_per_revolution: int, spin: float) -> float:
    """Sense of the whirl at the spin frequency: 1 on a forward circle, 0 on a line, -1 on a backward circle.

    The amplitudes of the two-sided first order, (forward - backward) / (forward + backward); NaN without
    motion at that frequency.

    Parameters
    ----------
    vertical, horizontal : (n_revolution * samples_per_revolution,), m
    spin : float, rad/s
    """
    cycle = [signal.reshape(-1, samples_per_revolution).mean(axis=0) for signal in (vertical, horizontal)]
    whirl = cycle[0] + 1j * cycle[1]
    turn = _turn(samples_per_revolution)
    forward, backward = float(abs(np.vdot(turn, whirl))), float(abs(turn @ whirl))
    if forward + backward == 0.0:
        return math.nan
    return math.copysign(1.0, spin) * (forward - backward) / (forward + backward)


@cache
def _turn(n: int) -> NDArray[np.complex128]:
    """Points (n,) of a unit circle."""
    found: NDArray[np.complex128] = np.exp(2j * np.pi * np.arange(n) / n)
    found.flags.writeable = False
    return found


class RecordedOrbit:
    """A recorded orbit: its size, section and whole cycles.

    Parameters
    ----------
    vertical, horizontal : (n_revolution * samples_per_revolution,), m
    """

    def __init__(self, vertical: Floats, horizontal: Floats, samples_per_revolution: int) -> None:
        """Measure size and section."""
        self.signals = np.stack([vertical, horizontal])
        self.n_revolution = vertical.size // samples_per_revolution
        self.size = math.sqrt(float(self.signals.var(axis=1).sum()))
        self.section = self.signals[:, ::samples_per_revolution].T
        self.cycles = self.signals.reshape(2, self.n_revolution, -1).swapaxes(0, 1)

    @cached_property
    def distances(self) -> Floats:
        """Mean square distance between all whole cycles, (n_revolution, n_revolution), m2."""
        vertical, horizontal = self.signals
        return cycle_distances(vertical, horizontal, vertical.size // self.n_revolution)

    @cached_property
    def returns(self) -> Floats:
        """Mean square distance of cycles 1, 2, ... revolutions apart, up to a third of the record, m2."""
        return returns(self.distances)

    @property
    def nearest_return(self) -> int:
        """Revolutions after which this distance is least."""
        return int(self.returns.argmin()) + 1

    def distances_from(self, section: Floats) -> Floats:
        """Distance of each section point from those of a periodic motion, over the size of the orbit.

        Parameters
        ----------
        section : (period, 2), m
            The end of the record first.
        """
        place = (np.arange(self.n_revolution) - self.n_revolution) % len(section)
        apart = np.linalg.norm(self.section - section[place], axis=1)
        return np.asarray(apart / max(self.size, np.finfo(float).tiny))

    def has_equal_ends(self, period: int, tolerance: float = PERIOD_TOLERANCE) -> bool:
        """Whether the first cycles equal the last ones a whole number of periods later."""
        change = ends_change(self.cycles.reshape(self.n_revolution, -1), period)
        return bool(change <= tolerance * self.size * math.sqrt(self.cycles.shape[2]))

    def repeats(self, period: int) -> bool:
        """Whether its cycles are the same a period later and at both ends."""
        square = self._square_returns[period - 1]
        return square <= EQUAL**2 * self.size**2 and self.has_equal_ends(period, EQUAL)

    @cached_property
    def closest_return(self) -> int:
        """Revolutions after which the cycles return nearest."""
        return closest_return(self._square_returns, self.size)

    @cached_property
    def _square_returns(self) -> Floats:
        """Mean square distance of cycles 1, 2, ... revolutions apart, m2."""
        n = self.n_revolution
        longest = max(1, n // 3, min(n // 2, LONGEST_PERIOD))
        apart = [self.cycles[k:] - self.cycles[: n - k] for k in range(1, longest + 1)]
        return np.array([(one**2).sum(axis=1).mean() for one in apart])


def closest_return(square: Floats, size: float) -> int:
    """Least n whose mean square distance `square[n - 1]` is nearest within tolerance, for an orbit's size."""
    return int(np.argmax(square <= ALIKE**2 * square.min() + (NOISE * size) ** 2)) + 1


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
    """Whether the cycles lie on a closed curve and advance along it by the same share each revolution.

    After a number of revolutions that nearly completes rounds of the curve, the cycles are displaced along it
    by a small amount, and by twice this amount after twice as many. The cycles of chaotic motion return to a
    neighbourhood, and those of a motion that still settles approach each other.
    """
    square = returns(distances)
    n = int(square.argmin()) + 1
    once, twice = np.diagonal(distances, n), np.diagonal(distances, 2 * n)
    first, last = np.array_split(once, 2)
    near = math.sqrt(once.mean() / (distances.sum() / (distances.size - len(distances))))
    if not once.any():  # cycles that repeat exactly
        return False
    ratio = math.sqrt(twice.mean() / once.mean())
    is_even = max(first.mean(), last.mean()) < EVEN**2 * min(first.mean(), last.mean())
    return near < NEAR and TWICE[0] < ratio < TWICE[1] and bool(is_even)
