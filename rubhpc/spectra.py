"""Amplitude spectra of arrays that span whole revolutions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.fft

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


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
    spectrum: Floats = np.abs(scipy.fft.rfft(np.asarray(signal, dtype=np.float64), axis=-1)) * (
        2.0 / n_sample
    )
    spectrum[..., 0] *= 0.5
    if n_sample % 2 == 0:
        spectrum[..., -1] *= 0.5
    return spectrum
