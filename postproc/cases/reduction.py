"""Reductions of stores too big to be loaded: mean spectra, worst-case envelopes, quantiles, histograms.

Spectra are read in pieces of whole chunks, reduced piece by piece and combined in a tree, so that memory
holds a few pieces and the result. Reductions of spectra are lazy; `computed` computes them on the workers of
`postproc.cases.workers`, with a progress bar. Of the measures, 8 bytes a case, one is loaded at a time.
"""

from __future__ import annotations

import math
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import dask.array as da
import numpy as np
import xarray as xr

from postproc.cases.workers import computed as computed
from postproc.signals.spectra import spectrum_of, with_frequency
from postproc.store.axes import axes_of, find_axis, refusal
from postproc.store.open import open_arrays, open_store
from postproc.store.select import select, worst_of_stators
from postproc.store.variables import LONG_ROLES, require_measure
from rubhpc.schema import DONE, HAS_VALUES, role_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence


_MEMORY = 1e9  # bytes of all pieces together, each counted four times: as stored, as read, in between
_SMALLEST, _LARGEST = 4e6, 64e6  # bytes of a piece: below, the scheduler's 1 ms a piece counts


def open_in_pieces(path: str | Path, n_byte: float | None = None) -> xr.Dataset:
    """Return the store as `open_store` does, with waveforms, spectra and sections in larger pieces.

    Parameters
    ----------
    n_byte : float, optional
        Approximate size of a piece, which is at least one whole chunk. Default: all cores work within 1 GB.
    """
    if n_byte is None:
        n_byte = min(max(_MEMORY / (4 * (os.cpu_count() or 1)), _SMALLEST), _LARGEST)
    store = open_store(path)
    bare = open_arrays(Path(path), chunks=None)
    pieces: dict[str, xr.DataArray] = {}
    for name in map(str, store.data_vars):
        # Those of branches and run-ups, in another form than stored, are few.
        if role_of(name) in LONG_ROLES and name in bare and bare[name].dims == store[name].dims:
            pieces[name] = bare[name].chunk(_piece(store[name], axes_of(store), n_byte))
    found: xr.Dataset = store.assign(pieces)
    found.encoding = store.encoding
    return found


def reduce_store(
    path: str | Path,
    what: str,
    of: str,
    over: Iterable[str] = (),
    choice: Mapping[str, Any] | None = None,
    *,
    levels: Sequence[float] = (0.05, 0.5, 0.95),
    bins: int | Sequence[float] = 50,
) -> xr.Dataset:
    """Return one reduction of a store, loaded; it runs on the current workers (`postproc.cases.workers`).

    Parameters
    ----------
    what : str
        "mean" or "envelope" of the spectra of a signal, "quantiles" or "histogram" of a measure.
    of : str
        The signal, or the measure.
    over, choice
        Axes to reduce (none: all), and the cases to take, as in `postproc.store.select.select`.
    levels, bins
        Of `quantiles` and `histogram`.
    """
    store = select(open_in_pieces(path), choice or {})
    if of_spectra(what):
        return computed(_OF_SPECTRA[what](store, of, over))
    return quantiles(store, of, levels, over) if what == "quantiles" else histogram(store, of, bins, over)


def of_spectra(what: str) -> bool:
    """Return whether a reduction is one of spectra; the others are of measures."""
    return what in _OF_SPECTRA


def mean_spectrum(store: xr.Dataset, signal: str, over: Iterable[str] = ()) -> xr.Dataset:
    """Return the mean over cases of a signal's amplitude spectrum; lazy.

    Parameters
    ----------
    store : Dataset
        From `open_in_pieces`, whole or selected.
    over : iterable of axes
        To average over; none: all of them. "stator" may be one.

    Returns
    -------
    Dataset over the other axes and `order`
        The spectrum in the unit of the signal, with `frequency` (Hz) where the axes that set the spin speed
        are kept, and `cases`: how many it is taken over. Cases that are not done have no part in it; NaN
        where none is done.
    """
    return _spectrum(store, signal, over, _mean, "mean over cases of the ")


def envelope(store: xr.Dataset, signal: str, over: Iterable[str] = ()) -> xr.Dataset:
    """Return the largest amplitude of a signal's spectrum over cases, order by order; lazy.

    To find where the worst value lies along an axis, keep that axis and use `idxmax` of the result. Arguments
    and result as of `mean_spectrum`.
    """
    return _spectrum(store, signal, over, _largest, "largest over cases of the ")


_OF_SPECTRA = {"mean": mean_spectrum, "envelope": envelope}


def quantiles(
    store: xr.Dataset, measure: str, levels: Sequence[float], over: Iterable[str] = ()
) -> xr.Dataset:
    """Return quantiles of a measure over cases that are done, exact and loaded.

    Parameters
    ----------
    levels : sequence of float
        0 to 1.
    over : iterable of axes
        None: all of them. Of several stators, the worst is taken unless "stator" is one of the axes.

    Returns
    -------
    Dataset over `quantile` and the other axes
        The measure, and `cases`.
    """
    values, axes = _done(store, measure, over)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN", RuntimeWarning)  # `cases` is 0 there
        found = values.quantile(list(levels), axes, keep_attrs=True)
    return found.to_dataset(name=measure).assign(cases=_count(values.notnull(), axes))


def histogram(
    store: xr.Dataset, measure: str, bins: int | Sequence[float] = 50, over: Iterable[str] = ()
) -> xr.Dataset:
    """Return how many cases that are done have a measure in each bin, loaded.

    Parameters
    ----------
    bins : int or sequence of float
        How many of equal width from the least value to the largest, or their edges, rising, in SI units.
        The last bin holds its upper edge; values outside are in none.
    over : iterable of axes
        As of `quantiles`.

    Returns
    -------
    Dataset over the other axes and `bin`
        `count`, and `cases`, inside the edges or not; `bin` is the middle of a bin, `lower` and `upper` are
        its edges.
    """
    values, axes = _done(store, measure, over)
    known = values.values[np.isfinite(values.values)]
    if not known.size:
        raise refusal(store, f"{measure}: no selected case has a value; select others")
    edges = np.histogram_bin_edges(known, bins)
    others = [d for d in values.dims if d not in axes]
    rows = values.transpose(*others, *axes)
    table = rows.values.reshape(math.prod(rows.sizes[d] for d in others), -1)
    # One bincount of (cell, bin) for all cells; outside the edges, or NaN, is a bin that is dropped.
    n = edges.size - 1
    at = np.searchsorted(edges, table, side="right") - 1
    at[table == edges[-1]] = n - 1
    at = np.where((at >= 0) & (at < n), at, n) + (n + 1) * np.arange(len(table))[:, None]
    counts = np.bincount(at.ravel(), minlength=len(table) * (n + 1)).reshape(len(table), n + 1)[:, :n]
    about = {"units": values.attrs.get("units", "1"), "long_name": values.attrs.get("long_name", measure)}
    shape = [rows.sizes[d] for d in others]
    kept = {str(d): rows[d] for d in others}
    count = (*others, "bin"), counts.reshape(*shape, n), {"units": "1", "long_name": "cases in the bin"}
    return xr.Dataset(
        {"count": count, "cases": _count(values.notnull(), axes)},
        coords={
            **kept,
            "bin": ("bin", (edges[:-1] + edges[1:]) / 2, about),
            "lower": ("bin", edges[:-1], about),
            "upper": ("bin", edges[1:], about),
        },
    )


def _spectrum(store: xr.Dataset, signal: str, over: Iterable[str], reduction: Any, before: str) -> xr.Dataset:
    spectra = spectrum_of(store, signal)
    axes = _axes(store, spectra, over)
    found: xr.DataArray = spectra.reduce(reduction, axes, keep_attrs=True)
    found.attrs["long_name"] = before + str(spectra.attrs.get("long_name", spectra.name))
    cases = _count(store["status"] == DONE, [a for a in axes if a != "stator"])
    if "spin_speed" in store and set(store["spin_speed"].dims) <= set(found.dims):
        found = with_frequency(found, store["spin_speed"].compute())
    return found.to_dataset(name=str(spectra.name)).assign(cases=cases)


def _axes(store: xr.Dataset, values: xr.DataArray, over: Iterable[str]) -> list[str]:
    """Return the dimensions to reduce; all of the study's axes when none is named."""
    axes = [find_axis(store, name) for name in over] or list(axes_of(store))
    if lost := [a for a in axes if a not in values.dims]:
        raise refusal(store, f"{values.name}: does not depend on {lost[0]}; leave that one out")
    return axes


def _done(store: xr.Dataset, measure: str, over: Iterable[str]) -> tuple[xr.DataArray, list[str]]:
    """Return a measure of the cases that have it, loaded, NaN for others, and the dimensions to reduce."""
    require_measure(store, measure)
    over = list(over)
    if "stator" not in over:
        store = worst_of_stators(store, [measure])
    values = (
        store[measure]
        .astype(float)
        .where(store["status"].isin(HAS_VALUES))
        .assign_attrs(store[measure].attrs)
    )
    return values.rename(measure).compute(), _axes(store, values.rename(measure), over)


def _count(is_there: xr.DataArray, axes: list[str]) -> xr.DataArray:
    return is_there.sum(axes).assign_attrs(units="1", long_name="cases")


def _mean(values: Any, axis: tuple[int, ...]) -> Any:
    """Mean of what is no NaN; in double precision, since 100 000 singles lose three digits of their sum."""
    return da.nanmean(_lazy(values), axis=axis, dtype=np.float64)


def _largest(values: Any, axis: tuple[int, ...]) -> Any:
    """Largest of what is no NaN; NaN, without a warning, where nothing else is."""
    values = _lazy(values)
    return da.reduction(values, _fmax, _fmax, axis=axis, dtype=values.dtype)  # type: ignore[no-untyped-call]


def _fmax(values: Any, **along: Any) -> Any:
    """Largest along axes; dask reads the arguments of what reduces, which numpy itself states from 2.4 on."""
    return np.fmax.reduce(values, **along)


def _lazy(values: Any) -> Any:
    return da.asarray(values)  # type: ignore[no-untyped-call]  # dask leaves it untyped


def _piece(values: xr.DataArray, axes: tuple[str, ...], n_byte: float) -> dict[str, int]:
    """Return lengths of a piece: as many stored chunks as fit, along the last axes first."""
    length = dict(zip(map(str, values.dims), values.data.chunksize, strict=True))
    budget = n_byte / (math.prod(length.values()) * values.dtype.itemsize)
    for axis in reversed(axes):
        most = -(-values.sizes[axis] // max(length[axis], 1))  # chunks along it
        take = max(min(most, int(budget)), 1)
        length[axis] *= take
        budget /= take
    return length
