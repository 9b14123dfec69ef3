"""Poincaré sections: one point a revolution, of one case or along an axis, of velocities too."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.store.run_ups import is_run_up, steady_view
from postproc.store.select import narrow
from postproc.store.variables import require_variables
from rubhpc.schema import SECTION_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

VELOCITIES = {f"{name}_velocity": name for name in SECTION_NAMES}
_REACH = 4  # samples to either side


def section_of(store: xr.Dataset, signal: str) -> xr.DataArray:
    """Return the section of a signal: the stored one, or else every sample at a whole revolution; lazy.

    Velocities ("vertical_velocity") are taken from the waveform. InputError where the signal is unknown, or
    neither its section nor its waveform is stored.
    """
    if signal in VELOCITIES:
        require_variables(store, [VELOCITIES[signal], "spin_speed"])
        velocity = section_velocity(store[VELOCITIES[signal]], store["spin_speed"])
        return velocity.rename(f"section_{signal}")
    check_signal(signal)
    if f"section_{signal}" in store:
        return store[f"section_{signal}"]
    if signal not in store:
        require_variables(store, [f"section_{signal}" if signal in SECTION_NAMES else signal])
    waveform = (steady_view(store, [signal]) if is_run_up(store) else store)[signal]
    points = waveform.isel(sample=slice(None, None, samples_per_revolution(waveform)))
    points = points.rename(sample="section").drop_vars("revolution", errors="ignore")
    points.name = f"section_{signal}"
    return points


def section_data(store: xr.Dataset, signals: Sequence[str]) -> xr.Dataset:
    """Return the sections of some signals of one case; lazy."""
    found = {f"section_{s}": section_of(store, s) for s in signals}
    return narrow(store.assign(found), list(found))


def sections_along(store: xr.Dataset, signal: str, along: str, over: str | None = None) -> xr.Dataset:
    """Return the section of a signal with regime, period and status, over ([over,] along, section); lazy.

    InputError where other axes have several values, or the store keeps neither section nor waveform.
    """
    name = f"section_{signal}"
    store = store.assign({name: section_of(store, signal)})
    spread = [along] if over is None else [over, along]
    data = narrow(store, [name, "regime", "period", "status"], spread).sortby(along)
    return data.transpose(*spread, "section", ...)


def section_velocity(waveform: xr.DataArray, spin_speed: xr.DataArray) -> xr.DataArray:
    """Return the time derivative of a signal (..., sample) at every whole revolution, (..., section); lazy.

    In the unit of the signal per second, at spin speeds (...), rad/s. It is that of the polynomial of degree
    8 through the sample and four on either side; NaN at the first sample, before which there is none. Unlike
    the derivative of a Fourier series, it needs no whole periods. The relative error at order `k` is about
    `(2 pi k / n)^8 / 630` of `n` samples a revolution: 2e-9 at 4X of 256.
    """
    n = samples_per_revolution(waveform)
    near = np.arange(-_REACH, _REACH + 1)
    taps = np.arange(n, waveform.sizes["sample"], n)[:, None] + near
    picked = waveform.drop_vars("revolution").isel(sample=xr.DataArray(taps, dims=("section", "tap")))
    weights = xr.DataArray(_derivative_weights(near), dims="tap")
    per_sample = (picked.astype(float) * weights).sum("tap", skipna=False)
    per_sample = per_sample.pad(section=(1, 0), constant_values=np.nan)
    velocity: xr.DataArray = per_sample * (spin_speed * (n / (2 * math.pi)))
    unit = str(waveform.attrs.get("units", "m"))
    long_name = f"velocity of the {waveform.attrs.get('long_name', waveform.name)}, once a revolution"
    return velocity.assign_attrs(units=f"{unit} s-1", long_name=long_name)


def _derivative_weights(offsets: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the weights of samples at some offsets in the derivative at offset 0, a sample apart."""
    x = offsets.astype(float)
    wanted = np.zeros(x.size)
    wanted[1] = 1.0
    return np.linalg.solve(np.vander(x, increasing=True).T, wanted).astype(np.float64)
