"""Measures of a recorded orbit: period and sense of the whirl."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LONGEST_PERIOD = 16  # revolutions
PERIOD_TOLERANCE = 1e-2  # rms distance of whole cycles over the orbit's size


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
