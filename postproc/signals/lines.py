"""The strongest lines of a spectrum, named as fractions of the spin speed where the period proves them."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

SPIKE = 0.004  # half width of a spike, as a part of the abscissa
_LEAST = 0.02  # of the highest line, below which none counts
_EXACT = 1e-6  # orders
_CLOSE = 0.01  # of a frequency, up to which a natural one is near
_NAMED = 0.25  # lines between the order of a sine and the one that it is named by, at most


def order_name(order: float, tolerance: float = _EXACT, period: int = 1, digits: int = 3) -> str:
    """Name an order as a fraction within `tolerance`, as in "1/2X" or "-1X", else by so many decimals.

    A motion with a period of so many revolutions has lines at multiples of `1 / period` alone.
    """
    fraction = Fraction(round(order * period), period)
    if fraction != 0 and abs(float(fraction) - order) <= tolerance:
        return f"{fraction}X"
    return f"{order:.{digits}f}X"


def sine_order(order: NDArray[np.float64], amplitude: NDArray[np.float64], peak: int) -> float:
    """Order of the sine that a peak of a spectrum belongs to, in a record without a window.

    The line of a sine falls with one over its distance, so that the peak and its higher neighbour, of
    amplitudes A and B, lie to both sides of it, at distances as B to A.
    """
    beside = [i for i in (peak - 1, peak + 1) if 0 <= i < len(order)]
    higher = max(beside, key=lambda i: float(amplitude[i]))
    share = float(amplitude[higher] / (amplitude[peak] + amplitude[higher]))
    return float(order[peak] + share * (order[higher] - order[peak]))


def _name_line(
    order: NDArray[np.float64], amplitude: NDArray[np.float64], peak: int, period: int, digits: int
) -> str:
    """Name of a peak: the fraction at the order of its sine, or else at its own, or else decimals."""
    near = _NAMED * abs(float(order[1] - order[0]))
    of_sine = order_name(sine_order(order, amplitude, peak), near, period, digits)
    at_line = order_name(float(order[peak]), _EXACT, period, digits)
    return of_sine if "." in at_line else at_line if "." in of_sine else of_sine


def parse_orders(text: str, where: str) -> list[Fraction]:
    """Return the orders that a list such as "1/2, 1X, 2" names; InputError where it is none."""
    try:
        return [Fraction(part.strip().upper().removesuffix("X")) for part in text.split(",") if part.strip()]
    except (ValueError, ZeroDivisionError):
        raise InputError(f'{where}: "{text}" is not a list of orders; write 1/2,1,2') from None


def spikes(
    x: NDArray[np.float64], amplitude: NDArray[np.float64], width: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the curve that shows each line of a spectrum as a spike, at most `width` to either side.

    Joined by straight lines, the few lines of a short record would look like broad peaks. Lines closer than
    `width` are joined.
    """
    if x[1] - x[0] <= width:
        return x, amplitude
    width = min(width, float(x[1] - x[0]) / 2)
    ends = np.stack((x - width, x, x + width), axis=-1)
    heights = np.stack((np.zeros_like(amplitude), amplitude, np.zeros_like(amplitude)), axis=-1)
    return ends.ravel(), heights.ravel()


def strongest_lines(
    spectrum: xr.DataArray,
    n_line: int = 6,
    natural: Mapping[str, Sequence[float]] | None = None,
    digits: int = 3,
) -> xr.Dataset:
    """Return the strongest local maxima of a spectrum, strongest first, with their names.

    None is below a fiftieth of the highest.

    Parameters
    ----------
    spectrum : (order,)
        One case; the mean (order 0) is no line. Its coordinate `period` (revolutions, `proven_period`) allows
        fractions: without it, or where it is 0, only multiples of the spin speed are named.
    natural : mapping of kind to frequencies in Hz, optional
        Natural frequencies; the spectrum then needs the coordinate `frequency`.
    digits : int
        Decimals of an order that is no fraction.

    Returns
    -------
    Dataset over `line`
        `order`, `amplitude`, `name`, and `frequency` (Hz) where the spectrum has it; `near`: the natural
        frequency that a line without a fraction is near, as in "torsional 39.6 Hz". A record that does not
        hold whole periods of a sine shifts its line off its order, by half a line at most; such a line is
        named by where the sine lies between it and its higher neighbour (`sine_order`).
    """
    order = spectrum["order"].values
    amplitude = np.where(np.isfinite(spectrum.values), spectrum.values, 0.0)
    amplitude = np.where(np.abs(order) < 1e-9, 0.0, amplitude)
    padded = np.concatenate(([0.0], amplitude, [0.0]))
    is_peak = (amplitude > padded[:-2]) & (amplitude >= padded[2:])
    is_peak &= amplitude >= _LEAST * amplitude.max(initial=0.0)
    peaks = np.flatnonzero(is_peak)
    peaks = peaks[np.argsort(-amplitude[peaks], kind="stable")][:n_line]
    period = max(int(spectrum.coords["period"]), 1) if "period" in spectrum.coords else 1
    names = [_name_line(order, amplitude, i, period, digits) for i in peaks.tolist()]
    lines = xr.Dataset(
        {
            "order": ("line", order[peaks], {"units": "1"}),
            "amplitude": ("line", amplitude[peaks], dict(spectrum.attrs)),
            "name": ("line", names),
        }
    )
    if "frequency" in spectrum.coords:
        frequency = spectrum["frequency"].values
        lines["frequency"] = ("line", frequency[peaks], {"units": "Hz"})
        width = abs(float(frequency[1] - frequency[0]))
        near = [
            _near(abs(float(frequency[i])), width, natural or {}) if "." in name else ""
            for i, name in zip(peaks.tolist(), names, strict=True)
        ]
        lines["near"] = ("line", near)
    return lines


def _near(frequency: float, width: float, natural: Mapping[str, Sequence[float]]) -> str:
    """Kind and value of the natural frequency (Hz) within a line's width of a frequency; "" for none."""
    all_of_them = [(abs(value - frequency), kind, value) for kind in natural for value in natural[kind]]
    distance, kind, value = min(all_of_them, default=(np.inf, "", 0.0))
    return f"{kind} {value:.4g} Hz" if distance <= max(width, _CLOSE * frequency) else ""
