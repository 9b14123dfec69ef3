"""Signals between their samples, and at fewer of them: band-limited interpolation and decimation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import resample_poly

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_FINER = 4  # times the sampling rate, between whose samples cubic splines are drawn
_FILTER = ("kaiser", 8.0)  # 80 dB


def between(values: Floats) -> Callable[[Floats], Floats]:
    """Return a signal as a function of the place between its samples (n_sample,), 0 to n_sample - 1.

    A filter makes four times as many samples, and cubic splines lie between these: at a quarter of the
    sampling rate the error is 0.02 %. Beyond the ends the function has the values there.
    """
    finer = resample_poly(values, _FINER, 1, window=_FILTER, padtype="line")
    spline = make_interp_spline(np.arange(finer.size) / _FINER, finer, k=3)
    last = float(values.size - 1)
    return lambda places: np.asarray(spline(np.clip(places, 0.0, last)))


def decimated(values: Floats, times: int) -> Floats:
    """Return every so-many-th sample of a signal, after a filter for what these cannot hold."""
    return (
        values if times == 1 else np.asarray(resample_poly(values, 1, times, window=_FILTER, padtype="line"))
    )
