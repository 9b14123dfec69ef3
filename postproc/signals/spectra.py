"""Amplitude spectra over orders: single-sided ones of a signal, two-sided ones of the whirl.

Sampling is locked to the shaft, so that a record of whole revolutions holds whole periods of every order
and its spectrum needs no window: a line's height is the amplitude (zero to peak) of its sine.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.store.attributes import MEASURED
from postproc.store.axes import find_axis, refusal
from postproc.store.select import narrow
from postproc.store.variables import require_variables
from rubhpc import spectra
from rubhpc.errors import InputError
from rubhpc.schema import PROBE, SIGNAL_NAMES, TURNED, is_signal

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray


WHIRL = "whirl"  # the motion of the disc's centre, v + i w


def samples_per_revolution(waveform: xr.DataArray | xr.Dataset) -> int:
    """Return how many samples waveforms have in a revolution, from their `revolution`, or `turned`."""
    turned = waveform[TURNED if TURNED in waveform.coords else "revolution"].values
    return round((turned.size - 1) / float(turned[-1] - turned[0]))


def last_revolutions(waveform: xr.DataArray, revolutions: int) -> xr.DataArray:
    """Return the last `revolutions` of a waveform; all of it where it has no more."""
    return waveform.isel(sample=slice(-revolutions * samples_per_revolution(waveform), None))


def amplitude_spectrum(waveform: xr.DataArray) -> xr.DataArray:
    """Return the single-sided amplitude spectrum over `order`, in the unit of the signal; lazy as that is.

    Parameters
    ----------
    waveform : (..., sample)
        Whole revolutions with the coordinate `revolution`.
    """
    n = waveform.sizes["sample"]
    orders = np.fft.rfftfreq(n, d=1 / samples_per_revolution(waveform))
    spectrum = _over_orders(spectra.amplitude_spectrum, orders, waveform)
    spectrum.name = f"spectrum_{waveform.name}"
    long_name = waveform.attrs.get("long_name", waveform.name)
    spectrum.attrs = {**waveform.attrs, "long_name": f"amplitude (zero to peak) of the {long_name}"}
    return spectrum


def full_spectrum(vertical: xr.DataArray, horizontal: xr.DataArray) -> xr.DataArray:
    """Return the two-sided amplitude spectrum of the whirl `v + i w` over signed `order`.

    Positive spin turns vertical towards horizontal, so that lines at positive orders whirl forward, with the
    spin, and those at negative orders backward. A circular orbit of radius `a` is one line of height `a`.
    """
    n = vertical.sizes["sample"]
    orders = np.fft.fftshift(np.fft.fftfreq(n, d=1 / samples_per_revolution(vertical)))
    spectrum = _over_orders(_two_sided, orders, vertical, horizontal)
    spectrum.name = WHIRL
    spectrum.attrs = {**vertical.attrs, "long_name": "whirl amplitude"}
    return spectrum


def spectrum_of(store: xr.Dataset, signal: str) -> xr.DataArray:
    """Return the spectrum of a signal: the stored one, or else the stored waveform's; lazy.

    InputError where the signal is unknown, or the store keeps neither.
    """
    check_signal(signal)
    stored = f"spectrum_{signal}"
    if stored in store:
        return store[stored]
    if signal in store:
        return amplitude_spectrum(store[signal])
    raise refusal(
        store,
        f'keeps neither {stored} nor the waveform {signal}; run the study with "spectrum" in [record] keep',
    )


def periodic_spectrum(
    store: xr.Dataset, signal: str, spread: Iterable[str] = ()
) -> tuple[xr.DataArray, xr.Dataset]:
    """Return spectra of a signal, or of the "whirl", over whole periods of most cases, and those cases; lazy.

    Stored spectra split a period that does not divide the recorded revolutions: 64 hold 21 1/3 periods of a
    motion that repeats every third, whose lines then fall between those stored and are drawn too low. Where
    waveforms are stored, the last 63 (60, if others repeat every other) put them right. All axes of more than
    one value must have been selected, but those in `spread`.
    """
    if signal == WHIRL:
        names = ["vertical", "horizontal", "spin_speed", *(n for n in ("period",) if n in store)]
        data = narrow(store, names, spread)
        vertical, horizontal = (whole_periods(data[n], data.get("period")) for n in names[:2])
        return full_spectrum(vertical, horizontal), data
    check_signal(signal)
    if MEASURED in store.attrs:
        require_variables(store, [signal])
    known = [n for n in (signal, f"spectrum_{signal}", "period") if n in store]
    data = narrow(store, [*known, "spin_speed"], spread)
    if signal in data:
        whole = whole_periods(data[signal], data.get("period"))
        if whole.sizes["sample"] < data[signal].sizes["sample"]:
            return amplitude_spectrum(whole), data
    return spectrum_of(data, signal), data


def whole_periods(waveform: xr.DataArray, period: xr.DataArray | None) -> xr.DataArray:
    """Return the last revolutions, at least half of all, that hold whole periods of the most cases."""
    recorded = round(waveform.sizes["sample"] / samples_per_revolution(waveform))
    periods = np.ravel(period.values) if period is not None else np.zeros(0, dtype=int)
    periods = periods[periods > 0].astype(int)
    counts = range(recorded, (recorded - 1) // 2, -1)  # the longest first, which wins a tie
    return last_revolutions(waveform, max(counts, key=lambda n: int(np.sum(n % periods == 0))))


def spectrum_data(store: xr.Dataset, signal: str, over: str | None = None) -> xr.DataArray:
    """Return the spectrum of a signal, or of the "whirl", with the coordinate `frequency` (Hz); lazy.

    Parameters
    ----------
    store : Dataset
        One case (and one stator, for a stator's signals), or cases along the axis `over`.
    """
    spread = [find_axis(store, over)] if over else []
    spectrum, data = periodic_spectrum(store, signal, spread)
    period = proven_period(store, spread)
    if period is not None and bool((period > 0).any()):
        spectrum = spectrum.assign_coords(period=period)
    return with_frequency(spectrum, data["spin_speed"].compute())


def proven_period(store: xr.Dataset, spread: Iterable[str] = ()) -> xr.DataArray | None:
    """Return the revolutions after which each case repeats, 0 where it does not or had not settled.

    None for a store without periods.
    """
    if "period" not in store:
        return None
    data = narrow(store, [name for name in ("period", "settled") if name in store], spread).compute()
    is_settled = data["settled"] != 0 if "settled" in data else True
    return data["period"].where(is_settled, 0).drop_attrs()


def with_frequency(spectrum: xr.DataArray, spin_speed: xr.DataArray) -> xr.DataArray:
    """Return the spectrum with the coordinate `frequency` (Hz) of its orders at the spin speed (rad/s)."""
    rate = spin_speed.astype(float) / (2 * math.pi)
    frequency = (rate * spectrum["order"]).assign_attrs(units="Hz", long_name="frequency")
    dims = [d for d in spectrum.dims if d in frequency.dims]
    return spectrum.assign_coords(frequency=frequency.transpose(*dims))


def default_signal(store: xr.Dataset, wanted: str) -> str:
    """Return the signal that a figure draws by default: the one `wanted`, or the first that was measured."""
    if MEASURED not in store.attrs or wanted in store:
        return wanted
    return next(str(name) for name in store.data_vars if is_signal(str(name)))


def check_signal(signal: str, store: xr.Dataset | None = None) -> None:
    """Refuse a name that is not a recorded signal; a probe of `store` may have been meant."""
    if not is_signal(signal):
        if store is not None and PROBE + signal in store:
            raise InputError(f"{signal}: no such signal; did you mean {PROBE}{signal}?")
        velocity = " (a velocity has a section alone)" if signal.endswith("_velocity") else ""
        raise InputError(
            f"{signal}: no such signal{velocity}; there are {', '.join(SIGNAL_NAMES)}, and probe_NAME"
        )


def _over_orders(function: Any, orders: NDArray[np.floating[Any]], *waveforms: xr.DataArray) -> xr.DataArray:
    spectrum: xr.DataArray = xr.apply_ufunc(
        function,
        *waveforms,
        input_core_dims=[["sample"]] * len(waveforms),
        output_core_dims=[["order"]],
        dask="parallelized",
        output_dtypes=[float],
        dask_gufunc_kwargs={"output_sizes": {"order": orders.size}, "allow_rechunk": True},
    )
    return spectrum.assign_coords(
        order=("order", orders, {"units": "1", "long_name": "order (multiples of the spin speed)"}),
    )


def _two_sided(
    vertical: NDArray[np.floating[Any]], horizontal: NDArray[np.floating[Any]]
) -> NDArray[np.float64]:
    """(..., n_sample) -> (..., n_sample), amplitudes from the lowest (backward) order to the highest."""
    whirl = vertical.astype(np.float64) + 1j * horizontal
    lines = np.fft.fftshift(np.fft.fft(whirl, axis=-1), axes=-1)
    amplitude: NDArray[np.float64] = np.abs(lines) / whirl.shape[-1]
    return amplitude
