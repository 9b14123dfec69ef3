"""How a simulated motion is compared with a measured one: by lines where it repeats, else by statistics."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from scipy.special import logsumexp

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.identification.channels import Channels

    Floats = NDArray[np.float64]

# Relative errors of the model's lines that are thought possible, equally likely; what they are is learnt too.
DISCREPANCIES = np.geomspace(3e-5, 0.3, 9)
LEAST = 0.03  # of the rms of its signal: even a smaller line has the error of one of that size
WHOLE = 8.0  # order up to which every line is compared
NEAR = 0.2  # of a natural frequency, within which lines above that are compared too
_PERIODS = (6, 12, 10, 14, 8, 16, 18, 22, 26)  # revolutions that hold whole periods; 6 of 1, 2 and 3
_FEWEST = 4  # of them in a record
_BROAD = 0.05  # share of the power between the lines from which on a motion does not repeat
_LEFT = 0.1  # of that share of the first period, which a longer one may leave


class Seen(NamedTuple):
    """Features of a motion and their variance, (n_channel, n_feature) each."""

    values: NDArray[Any]  # complex, or real
    variance: Floats

    def in_order(self) -> Seen:
        """Return copies that lie in memory row by row, on which the rounding of sums depends."""
        return Seen(*(np.array(array, order="C") for array in self))


class Unknown(NamedTuple):
    """Forces of unknown size and phase at an order, of which a linear machine makes lines."""

    order: float
    shapes: NDArray[np.complex128]  # (n_channel, n_force), of unit forces
    sizes: Floats  # (n_size,), standard deviations of the forces that are equally likely


class Comparison(Protocol):
    """Features of a measured motion, with which those of simulated ones are compared."""

    measured: Seen
    orders: Floats  # (n_feature,)
    about: str

    def of(self, waves: Floats) -> Seen:
        """Return the features of a simulated motion, (n_channel, n_sample)."""
        ...

    def by_discrepancy(self, seen: Seen, unknown: Unknown | None = None) -> Floats:
        """Return the logarithm of the likelihood at each of `DISCREPANCIES`, over unknown forces."""
        ...

    def misfit(self, seen: Seen, unknown: Unknown | None = None) -> float:
        """Return the mean square of the residuals over their standard deviation."""
        ...

    def amplitudes(self, seen: Seen) -> tuple[Floats, Floats]:
        """Return the amplitudes of the features and of their noise, for figures."""
        ...


def log_likelihood(comparison: Comparison, seen: Seen, unknown: Unknown | None = None) -> float:
    """Return the logarithm of the likelihood of the measured features, over all discrepancies."""
    return float(logsumexp(comparison.by_discrepancy(seen, unknown)) - math.log(DISCREPANCIES.size))


def discrepancy_of(comparison: Comparison, seen: Seen) -> float:
    """Return the geometric mean of the discrepancy, relative."""
    logs = comparison.by_discrepancy(seen)
    return float(np.exp(np.exp(logs - logsumexp(logs)) @ np.log(DISCREPANCIES)))


def likeliest(comparison: Comparison, seen: Seen, unknown: Unknown | None = None) -> float:
    """Return the likeliest discrepancy."""
    return float(DISCREPANCIES[int(comparison.by_discrepancy(seen, unknown).argmax())])


def wanted_orders(orders: Floats, natural: Sequence[float], highest: float) -> NDArray[np.bool_]:
    """Return which orders are compared: all low ones, and those around natural frequencies (in orders)."""
    near = [np.abs(orders - order) <= NEAR * order for order in natural]
    is_wanted: NDArray[np.bool_] = np.any([orders <= WHOLE, *near], axis=0)
    return is_wanted & (orders > 0.0) & (orders <= highest)


def period_of_lines(channels: Channels) -> int:
    """Return in how many revolutions the measured motion repeats a whole number of times; 0: in none.

    White noise does not count, nor does what one channel alone shows, such as a torsional encoder of a shaft
    without torsional vibration. A longer period than the first has to explain what that one leaves: a
    quasi-periodic motion nearly repeats after some of many numbers of revolutions.
    """
    first = _between(channels, _PERIODS[0])
    steadiest = int(first.argmin())
    for period in _PERIODS:
        if channels.revolutions < _FEWEST * period:
            continue
        most = _BROAD if period == _PERIODS[0] else min(_BROAD, _LEFT * first[steadiest])
        if _between(channels, period)[steadiest] < most:
            return period
    return 0


def _between(channels: Channels, period: int) -> Floats:
    """Return the share of the power (n_channel,) that lies between the lines of a period."""
    whole = channels.revolutions // period * period
    power = np.abs(lines_of(channels.waves, channels.n, whole)) ** 2
    first, last = (math.floor(share * channels.highest_order * whole) for share in (0.75, 1.0))
    white = np.median(power[:, first:last], axis=1) / math.log(2.0)  # of exponential variates: the mean
    low = power[:, 1 : math.ceil(WHOLE * whole)]
    is_between = np.ones(low.shape[1], dtype=bool)
    is_between[whole // period - 1 :: whole // period] = False
    excess = low[:, is_between].sum(axis=1) - white * is_between.sum()
    return np.asarray(excess / np.maximum(low.sum(axis=1), np.finfo(float).tiny))


def lines_of(waves: Floats, n: int, revolutions: int) -> NDArray[np.complex128]:
    """Return the complex amplitudes (zero to peak) of all lines of the first revolutions, k / revolutions."""
    whole = revolutions * n
    return np.asarray(np.fft.rfft(waves[:, :whole], axis=1) * (2.0 / whole))
