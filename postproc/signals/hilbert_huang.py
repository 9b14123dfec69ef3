"""Hilbert-Huang analysis of a case: what frequencies a signal holds, and when, in and out of contact.

After N. E. Huang and others, Proc. R. Soc. Lond. A 454 (1998) 903-995, as the paper uses it (Figs. 8, 12, 14
and 16). Touch and release part the motion into spans that obey different equations, so that each span is
decomposed by itself: sifting across a release would spread the jump of the contact over the ringing that
follows. A span's modes are sifted before its Hann window is applied, since over the few cycles of a span the
window itself would be taken for a modulation and bend the mode.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.signals.contacts import sample_time, signal_of, touching
from postproc.signals.spectra import last_revolutions
from postproc.store.attributes import MEASURED
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

CONTACT = ("masked", "kept")
_SIFTINGS = 5  # in a row with as many zeros as extrema: the S number of Huang and others (2003)
_EDGE = 0.1  # of the Hann window; below it the signal nearly vanishes, and its phase is undefined
_LEAST = 8  # samples of a span that can be sifted


def empirical_modes(values: Floats, n_mode: int = 1) -> Floats:
    """Return the first intrinsic modes of a signal (n_sample,), the fastest first, (n_mode, n_sample).

    Sifting stops when zeros and extrema have matched in number five times in a row (Huang and others, Proc.
    R. Soc. Lond. A 459 (2003) 2317-2345), which does not depend on the unit of the signal. There are zeros
    where there are fewer modes: a signal of two extrema or less is a trend and has none.
    """
    from PyEMD import EMD

    modes = np.zeros((n_mode, values.size))
    size = float(np.abs(values).max(initial=0.0))
    if values.size < _LEAST or not size > 0:
        return modes
    # The library's limits on what is left to sift are absolute: they assume a signal of the order of one.
    sift = EMD(FIXE_H=_SIFTINGS, range_thr=1e-6, total_power_thr=1e-9)
    sift.emd(values / size, max_imf=n_mode)
    found = sift.imfs[:n_mode]
    modes[: len(found)] = found * size
    return modes


def analytic(mode: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return amplitude and instantaneous frequency (Hz) of an intrinsic mode by the Hilbert transform.

    Only the part between its first and its last zero has some, the rest NaN: continued as an odd function
    there, the mode stays smooth, and no edge effect leaks into a decayed part. At most half a cycle is lost
    at either end. The frequency is the forward difference of the phase, as in the paper. Mode and both
    results are (n_sample,), `dt` seconds apart.
    """
    from scipy.signal import hilbert

    amplitude, frequency = np.full(mode.size, math.nan), np.full(mode.size, math.nan)
    zeros = np.flatnonzero(np.diff(np.signbit(mode))) + 1
    if zeros.size < 2:
        return amplitude, frequency
    first, end = int(zeros[0]), int(zeros[-1])
    inner = mode[first:end]
    signal = hilbert(np.concatenate((-inner[::-1], inner)))[inner.size :]
    amplitude[first:end] = np.abs(signal)
    frequency[first : end - 1] = np.angle(signal[1:] * np.conj(signal[:-1])) / (2 * math.pi * dt)
    return amplitude, frequency


def hilbert_huang(
    case: xr.Dataset,
    signal: str = "torsion",
    *,
    contact: str | None = None,
    stator: int | None = None,
    revolutions: int | None = None,
    n_mode: int = 1,
) -> xr.Dataset:
    """Return the first intrinsic modes of a signal with their amplitude and instantaneous frequency.

    Parameters
    ----------
    case : Dataset
        One case with its waveforms and contact force.
    contact : {"masked", "kept"}, optional
        "masked": each span out of contact under a Hann window, its edges discarded, contact left out; by
        default for the rotor's signals. "kept": spans in contact too, without a window; for a stator's.
    stator : int, optional
        Whose signal and contact, counted from 1; contact with any by default.
    revolutions : int, optional
        Only the last ones.

    Returns
    -------
    Dataset over (mode, sample)
        `imf` and `amplitude` (the signal's unit), `frequency` (Hz, NaN where undefined) and `energy` (the
        square of the amplitude), with the coordinates `time` (s), `revolution`, `contact` and `span` (counted
        from 0 out of contact, -1 in contact). Where contact was not measured, all of it counts as out of
        contact.
    """
    is_known = "contact_force" in case or MEASURED not in case.attrs
    contact = contact or ("kept" if signal.startswith("stator") or not is_known else "masked")
    if contact not in CONTACT:
        raise InputError(f"contact: {contact}: is unknown; choose {' or '.join(CONTACT)}")
    if n_mode < 1:
        raise InputError(f"n_mode: {n_mode} is out of range; it must be at least 1")
    wave = signal_of(case, signal, stator)
    touches = touching(case, stator) if is_known else xr.zeros_like(wave, dtype=bool)
    if revolutions is not None:
        wave, touches = last_revolutions(wave, revolutions), last_revolutions(touches, revolutions)
    dt = sample_time(case)
    n = wave.sizes["sample"]
    imf, amplitude = np.full((n_mode, n), math.nan), np.full((n_mode, n), math.nan)
    frequency = np.full((n_mode, n), math.nan)
    span = np.full(n, -1)
    ends = [0, *(np.flatnonzero(np.diff(touches.values)) + 1).tolist(), n]
    n_span = 0
    for first, end in pairwise(ends):
        if touches.values[first]:
            if contact == "masked":
                continue
        else:
            span[first:end] = n_span
            n_span += 1
        window, kept = _window(end - first, contact)
        for i, mode in enumerate(empirical_modes(wave.values[first:end], n_mode)):
            a, f = analytic(mode * window, dt)
            imf[i, first:end] = mode * window
            amplitude[i, first:end] = np.where(kept, a, math.nan)
            frequency[i, first:end] = np.where(kept, f, math.nan)
    unit = str(wave.attrs.get("units", "1"))
    name = str(wave.attrs.get("long_name", signal))
    dims = ("mode", "sample")
    time = {"units": "s", "long_name": "time"}
    scalars = {str(k): c for k, c in wave.coords.items() if c.ndim == 0}
    return xr.Dataset(
        {
            "signal": ("sample", wave.values, dict(wave.attrs)),
            "imf": (dims, imf, {"units": unit, "long_name": f"intrinsic mode of the {name}"}),
            "amplitude": (dims, amplitude, {"units": unit, "long_name": "instantaneous amplitude"}),
            "frequency": (dims, frequency, {"units": "Hz", "long_name": "instantaneous frequency"}),
            "energy": (dims, amplitude**2, {"units": f"({unit})2", "long_name": "energy"}),
        },
        coords={
            **scalars,
            "mode": ("mode", np.arange(1, n_mode + 1), {"units": "1"}),
            "time": ("sample", np.arange(n) * dt, time),
            "revolution": wave["revolution"],
            "contact": ("sample", touches.values, {"units": "1", "long_name": "in contact"}),
            "span": ("sample", span, {"units": "1", "long_name": "span out of contact"}),
        },
        attrs={**case.attrs, "signal": signal, "contact": contact},
    )


def median_frequency(hht: xr.Dataset, mode: int = 1, *, contact: bool = False) -> xr.DataArray:
    """Return the amplitude-weighted median of a mode's frequency out of contact or in it, Hz; or NaN."""
    one = hht.sel(mode=mode)
    median = _quantiles(one, (one["span"].values < 0) == contact, (0.5,))[0]
    return xr.DataArray(median, name="frequency", attrs={"units": "Hz", "long_name": "median frequency"})


def span_frequencies(hht: xr.Dataset, mode: int = 1, cycles: float | None = None) -> xr.DataArray:
    """Return the amplitude-weighted median of a mode's frequency in each span out of contact, (span,), Hz.

    `cycles` keeps only as many cycles from the start of each span.
    """
    one = hht.sel(mode=mode)
    spans, time = one["span"].values, one["time"].values
    found = []
    for i_span in range(spans.max(initial=-1) + 1):
        inside = spans == i_span
        median = _quantiles(one, inside, (0.5,))[0]
        if cycles is not None and median > 0:
            start = time[np.argmax(inside)]
            median = _quantiles(one, inside & (time < start + cycles / median), (0.5,))[0]
        found.append(median)
    return xr.DataArray(found, dims="span", name="frequency", attrs={"units": "Hz"})


def contact_bandwidth(hht: xr.Dataset, mode: int = 1) -> xr.Dataset:
    """Return how far a mode's frequency spreads in contact and out of it: weighted interquartile range, Hz.

    Out of contact only the samples count at which more than a hundredth of the largest amplitude is left.
    """
    one = hht.sel(mode=mode)
    lively = one["amplitude"].values > 0.01 * float(one["amplitude"].max())
    out: dict[str, Any] = {}
    for name, inside in (("contact", one["contact"].values), ("free", ~one["contact"].values & lively)):
        low, high = _quantiles(one, inside, (0.25, 0.75))
        out[name] = ((), high - low, {"units": "Hz", "long_name": f"spread of frequency, {name}"})
    return xr.Dataset(out)


def energy_picture(
    hht: xr.Dataset, limit: float, n_frequency: int = 100, n_time: int = 400, mode: int = 1
) -> xr.DataArray:
    """Return the energy of a mode over frequency, up to `limit` Hz, and time: its Hilbert spectrum.

    That is (frequency, time), the mean squared amplitude of the samples in a bin of time whose frequency
    falls into a bin of frequency, in the signal's unit squared.
    """
    one = hht.sel(mode=mode)
    time = one["time"].values
    end = time[-1] + (time[-1] - time[-2])
    edges = np.linspace(0, limit, n_frequency + 1), np.linspace(0, end, min(n_time, time.size) + 1)
    defined = np.isfinite(one["frequency"].values)
    points = one["frequency"].values[defined], time[defined]
    energy, *_ = np.histogram2d(*points, bins=edges, weights=one["energy"].values[defined])
    per_bin, _ = np.histogram(time, bins=edges[1])
    middle = [(e[1:] + e[:-1]) / 2 for e in edges]
    return xr.DataArray(
        energy / np.maximum(per_bin, 1),
        dims=("frequency", "time"),
        coords={
            "frequency": ("frequency", middle[0], {"units": "Hz", "long_name": "instantaneous frequency"}),
            "time": ("time", middle[1], {"units": "s", "long_name": "time"}),
        },
        name="energy",
        attrs=dict(hht["energy"].attrs),
    )


def _window(n: int, contact: str) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the window of a span of `n` samples, and which of them are kept."""
    from scipy.signal.windows import hann

    if contact == "kept":
        return np.ones(n), np.ones(n, dtype=bool)
    window = hann(n)
    return window, window > _EDGE


def _quantiles(one: xr.Dataset, inside: NDArray[np.bool_], shares: tuple[float, ...]) -> list[float]:
    """Return amplitude-weighted quantiles of the frequency over some samples, Hz."""
    frequency, amplitude = one["frequency"].values, one["amplitude"].values
    inside = inside & np.isfinite(frequency) & (amplitude > 0)
    if not inside.any():
        return [math.nan] * len(shares)
    weights = amplitude[inside]
    found: list[float] = np.quantile(
        frequency[inside], shares, weights=weights, method="inverted_cdf"
    ).tolist()
    return found
