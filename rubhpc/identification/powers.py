"""Motions that do not repeat, compared by statistics: the mean power in bands of half an order.

Of a chaotic motion no phase can be predicted. Compared are logarithms of mean powers over segments of four
revolutions (Hann's window), of the orbit forward and backward, with the variance by the scatter of the
segments: a synthetic likelihood (S. N. Wood, Nature 466, 2010) with independent bands. White noise of the
measurement, from the highest quarter of its orders, is added to the simulated powers.

Another record of the same case would have other powers. Over n of them the logarithm of the likelihood thus
varies from case to case by chance, with a variance of 3/8 n if both records are as long, and a sampler would
find the case that fits best by chance. The logarithm is divided by that standard deviation: a coarsened
posterior (J. W. Miller and D. B. Dunson, Journal of the American Statistical Association 114, 2019).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.identification.comparison import DISCREPANCIES, NEAR, WHOLE, Seen, likeliest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.identification.channels import Channels
    from rubhpc.identification.comparison import Unknown

    Floats = NDArray[np.float64]

_SEGMENT = 4  # revolutions
_HALF = 0.5  # order, width of a band
_BY_CHANCE = 3 / 8  # a power, variance of the logarithm of the likelihood
_ACCURACY = 1e-3  # of a simulated signal, of its rms: weaker bands are not compared


class PowerComparison:
    """Powers of a measured motion that does not repeat.

    Parameters
    ----------
    channels : Channels
    natural : sequence of float
        Orders of natural frequencies, around each of which there is a band where it is above 8.
    """

    def __init__(self, channels: Channels, natural: Sequence[float]) -> None:
        self._n, self._orbit = channels.n, channels.orbit
        highest = min(channels.highest_order, WHOLE)
        bands = [(_HALF * i, _HALF * (i + 1)) for i in range(1, math.floor(highest / _HALF))]
        high = [((1.0 - NEAR) * order, (1.0 + NEAR) * order) for order in natural]
        bands += [band for band in high if band[0] > WHOLE and band[1] < channels.highest_order]
        self.orders = np.array([0.5 * (low + end) for low, end in bands])
        places = np.arange(_SEGMENT * channels.n // 2) / _SEGMENT
        self._in_band = np.array([(places >= low) & (places < end) for low, end in bands], dtype=float)
        power = self._powers(channels.waves)
        top = (places > 0.75 * channels.highest_order) & (places <= channels.highest_order)
        whole = power.mean(axis=1).sum(axis=1)
        white = np.median(power.mean(axis=1)[:, top], axis=1) + _ACCURACY**2 * whole / places.size
        self._white = white[:, None] * self._in_band.sum(axis=1)
        self.measured = self._seen(channels.waves, 0.0)
        self.about = (
            f"it does not repeat: powers in {self.orders.size} bands of half an order and around natural "
            "frequencies are compared, no phases"
        )

    def _powers(self, waves: Floats) -> Floats:
        """Power of each line of each segment, (n_row, n_segment, n_line); an orbit has two rows."""
        rows = list(waves.astype(np.complex128))
        size = _SEGMENT * self._n
        if self._orbit is not None:
            whirl = np.array([1.0, 1j]) @ self._orbit @ waves
            for i, row in zip(np.flatnonzero(self._orbit.any(axis=0)), (whirl, np.conj(whirl)), strict=True):
                rows[i] = row
        starts = range(0, waves.shape[1] - size + 1, size // 2)
        pieces = np.stack([np.stack([row[start : start + size] for start in starts]) for row in rows])
        pieces = pieces - pieces.mean(axis=2, keepdims=True)
        lines = np.fft.fft(pieces * np.hanning(size), axis=2)[:, :, : size // 2] / size
        return np.asarray(np.abs(lines) ** 2)

    def _seen(self, waves: Floats, white: Floats | float) -> Seen:
        power = self._powers(waves) @ self._in_band.T  # (n_row, n_segment, n_band)
        mean = power.mean(axis=1) + white
        free = max(waves.shape[1] // (self._n * _SEGMENT), 1)  # segments that do not overlap
        return Seen(np.log(mean), power.var(axis=1) / (free * mean**2))

    def of(self, waves: Floats) -> Seen:
        """Return the powers of a simulated motion with the white noise of the measurement."""
        return self._seen(waves, self._white)

    def by_discrepancy(self, seen: Seen, unknown: Unknown | None = None) -> Floats:
        """Return the logarithm of the likelihood at each discrepancy; unknown forces fit their band."""
        variance, apart = self._apart(seen, DISCREPANCIES, unknown)
        terms = apart**2 / variance + np.log(2.0 * np.pi * variance)
        return np.asarray(-0.5 * terms.sum(axis=(1, 2)) / math.sqrt(_BY_CHANCE * apart[0].size))

    def _apart(self, seen: Seen, discrepancies: Floats, unknown: Unknown | None) -> tuple[Floats, Floats]:
        """Variance and residuals, (n_discrepancy, n_row, n_band)."""
        error = (2.0 * discrepancies[:, None, None]) ** 2
        variance = self.measured.variance + seen.variance + error
        apart = np.abs(self.measured.values - seen.values)
        if unknown is not None:
            apart = np.where(self._in_band[:, round(unknown.order * _SEGMENT)] > 0.0, 0.0, apart)
        return variance, np.broadcast_to(apart, variance.shape)

    def misfit(self, seen: Seen, unknown: Unknown | None = None) -> float:
        """Return the mean square of the residuals over their standard deviation."""
        variance, apart = self._apart(seen, np.array([likeliest(self, seen, unknown)]), unknown)
        return float((apart**2 / variance).mean())

    def amplitudes(self, seen: Seen) -> tuple[Floats, Floats]:
        """Return roots of the powers, and their errors, (n_row, n_band)."""
        amplitude = np.exp(0.5 * seen.values)
        return amplitude, 0.5 * amplitude * np.sqrt(seen.variance)
