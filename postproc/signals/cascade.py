"""Spectrum cascades: the spectra of many cases along one axis, loaded no further than they are drawn."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.signals.spectra import periodic_spectrum, with_frequency
from postproc.store.axes import find_axis, ordered_axes
from rubhpc.study.axes import SPEED_AXES

if TYPE_CHECKING:
    from numpy.typing import NDArray


def cascade(store: xr.Dataset, signal: str = "torsion", along: str | None = None) -> xr.DataArray:
    """Return the spectra of a signal, or the full ones of the "whirl", along one axis; lazy.

    Where waveforms are stored, spectra are taken over whole periods of as many cases as can be.

    Parameters
    ----------
    store : Dataset
        All other axes of more than one value must have been selected.
    along : str, optional
        The axis of the cascade; by default the speed, or else the longest axis.

    Returns
    -------
    (along, order)
        Amplitudes, with the coordinates `spin_speed` (along), rad/s, and `frequency` (along, order), Hz.
    """
    along = find_axis(store, along) if along else default_axis(store)
    spectra, data = periodic_spectrum(store, signal, [along])
    spin = data["spin_speed"].compute().broadcast_like(store[along])
    return with_frequency(spectra.assign_coords(spin_speed=spin), spin).transpose(along, "order")


def default_axis(store: xr.Dataset) -> str:
    """Return the axis that a cascade spreads over by default: the speed, or else the longest."""
    axes = ordered_axes(store, "a cascade")
    return next((a for a in SPEED_AXES if a in axes), max(axes, key=lambda a: store.sizes[a]))


def below(spectra: xr.DataArray, limit: float, abscissa: str = "frequency") -> xr.DataArray:
    """Return the lines up to `limit` (Hz, or orders) in every case, backward too; still lazy."""
    if abscissa == "frequency":
        spin = spectra["spin_speed"].values
        limit *= 2 * math.pi / float(spin[spin > 0].min())
    orders = spectra["order"].values
    first = max(int(np.searchsorted(orders, -limit)) - 1, 0)
    return spectra.isel(order=slice(first, int(np.searchsorted(orders, limit, side="right")) + 1))


def hold_rows(spectra: xr.DataArray, n_row: int) -> xr.DataArray:
    """Return at most `n_row` spectra, each the peaks of as many neighbours as that takes; lazy."""
    along = str(spectra.dims[0])
    together = math.ceil(spectra.sizes[along] / n_row)
    if together == 1:
        return spectra
    floor = spectra.fillna(-np.inf)  # a missing case neither hides its neighbours nor warns
    held: xr.DataArray = floor.coarsen({along: together}, boundary="pad").max()
    held = held.where(held > -np.inf)
    held.name, held.attrs = spectra.name, {**spectra.attrs, "cases_per_row": together}
    for name in set(held.coords) & set(spectra.coords):
        held[name].attrs = spectra[name].attrs
    return held


def hold_peaks(spectra: xr.DataArray, limit: float, n_bin: int, abscissa: str = "frequency") -> xr.DataArray:
    """Return the highest line in each of `n_bin` equal bins up to `limit` (Hz, or orders); lazy, by chunks.

    A bin between two lines takes the nearer one, so that a picture of few lines has no holes. Full spectra
    begin at `-limit`.
    """
    along = str(spectra.dims[0])
    lines = below(spectra, limit, abscissa).drop_vars("frequency", errors="ignore")
    orders = lines["order"].values
    edges = np.linspace(-limit if orders[0] < 0 else 0.0, limit, n_bin + 1)
    spacing = float(orders[1] - orders[0]) * xr.ones_like(spectra["spin_speed"])
    if abscissa == "frequency":
        spacing = spacing * spectra["spin_speed"] / (2 * math.pi)
    held: xr.DataArray = xr.apply_ufunc(
        _hold,
        lines,
        spacing,
        input_core_dims=[["order"], []],
        output_core_dims=[["bin"]],
        vectorize=True,
        dask="parallelized",
        output_dtypes=[float],
        kwargs={"edges": edges, "zero": int(np.argmin(np.abs(orders)))},
        dask_gufunc_kwargs={"output_sizes": {"bin": n_bin}, "allow_rechunk": True},
    )
    unit = {"units": "Hz" if abscissa == "frequency" else "1"}
    held = held.rename(bin=abscissa).assign_coords({abscissa: (abscissa, (edges[1:] + edges[:-1]) / 2, unit)})
    held.name, held.attrs = spectra.name, dict(spectra.attrs)
    return held.transpose(along, abscissa)


def _hold(
    amplitude: NDArray[np.floating[Any]], spacing: float, edges: NDArray[np.float64], zero: int
) -> NDArray[np.float64]:
    """(n_line,) -> (n_bin,), the highest line of each bin; `zero` is order 0."""
    centre = (edges[1:] + edges[:-1]) / 2
    first = zero + np.ceil(edges / spacing - 1e-9).astype(int)
    low, high = first[:-1], first[1:]
    is_empty = high <= low
    low = np.where(is_empty, zero + np.rint(centre / spacing).astype(int), low)
    high = np.where(is_empty, low + 1, high)
    is_inside = (low >= 0) & (low < amplitude.size)
    pairs = np.column_stack((low, np.minimum(high, amplitude.size)))[is_inside]
    held = np.full(centre.size, np.nan)
    # The floor past the end lets the last bin end at the last line.
    held[is_inside] = np.maximum.reduceat(np.append(amplitude.astype(float), -np.inf), pairs.ravel())[::2]
    return held
