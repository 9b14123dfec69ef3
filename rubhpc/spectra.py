"""Amplitude spectra of arrays that span whole revolutions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.fft

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


def amplitude_spectrum(signal: Floats) -> Floats:
    """Single-sided amplitude (zero to peak) of signals that span whole revolutions.

    Parameters
    ----------
    signal : (..., n_sample)
        n_sample even; no window is needed where the samples are locked to the shaft.

    Returns
    -------
    (..., n_sample // 2 + 1)
        In the signal's unit; line k is order k over the revolutions recorded, line 0 the size of the mean.
    """
    n_sample = signal.shape[-1]
    spectrum = np.zeros((*signal.shape[:-1], n_sample // 2 + 1))
    moves = np.any(signal != 0.0, axis=-1)  # in a ring that nothing has touched, few signals do
    moving = np.asarray(signal[moves], dtype=np.float64)
    spectrum[moves] = np.abs(scipy.fft.rfft(moving, axis=-1)) * (2.0 / n_sample)
    spectrum[..., 0] *= 0.5
    if n_sample % 2 == 0:
        spectrum[..., -1] *= 0.5
    return spectrum


def track_orders(signal: Floats, per_revolution: int, orders: Sequence[float], window: int) -> Complexes:
    """Return the complex amplitude of each order in every revolution of a shaft-locked signal.

    The signal is `Re(c exp(i order angle))` where that order is all there is: `abs(c)` is its amplitude, zero
    to peak, and the argument its lead over the order of the shaft's angle.

    Parameters
    ----------
    signal : (n_sample,)
        Whole revolutions.
    orders : sequence of float
        Multiples of the spin frequency; the window holds whole periods of them.
    window : int
        Revolutions over which they are taken, around each; those at the ends have the window of the first, or
        last, that fits.

    Returns
    -------
    (n_revolution, n_order)
    """
    n = signal.size // per_revolution
    if n == 0:
        return np.zeros((0, len(orders)), dtype=np.complex128)
    window = min(window, n)
    turned = 2.0 * np.pi * np.asarray(orders, dtype=np.float64)
    angle = turned / per_revolution * np.arange(per_revolution)[:, np.newaxis]
    both = signal.reshape(n, per_revolution) @ np.hstack([np.cos(angle), -np.sin(angle)])
    sums = both[:, : turned.size] + 1j * both[:, turned.size :]
    sums *= np.exp(-1j * turned * np.arange(n)[:, np.newaxis])
    fits = n - window + 1
    whole: Complexes = sums[:fits].copy()
    for ahead in range(1, window):
        whole += sums[ahead : ahead + fits]
    whole *= 2.0 / (window * per_revolution)
    followed: Complexes = whole[np.clip(np.arange(n) - window // 2, 0, fits - 1)]
    return followed
