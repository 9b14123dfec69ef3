"""Waveforms of cases: the last revolutions of some signals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from postproc.signals.spectra import check_signal, last_revolutions
from postproc.store.axes import find_axis
from postproc.store.select import narrow

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

DEFAULT_SIGNALS = ("vertical", "horizontal", "torsion", "contact_force")


def waveform_data(
    store: xr.Dataset,
    signals: Sequence[str] = DEFAULT_SIGNALS,
    revolutions: int | None = 4,
    over: str | None = None,
) -> xr.Dataset:
    """Return the last revolutions of some signals; lazy.

    Parameters
    ----------
    store : Dataset
        One case (and one stator, for a stator's signals), or cases along the axis `over`.
    revolutions : int, optional
        How many; None for all that were recorded.

    Returns
    -------
    Dataset
        The signals over `sample`, with the coordinate `revolution` and, where all cases turn at one speed,
        `time` (s) from the first sample kept.
    """
    for signal in signals:
        check_signal(signal)
    data = narrow(store, [*dict.fromkeys(signals), "spin_speed"], [find_axis(store, over)] if over else [])
    if revolutions is not None:
        kept = last_revolutions(data[signals[0]], revolutions)
        data = data.isel(sample=slice(-kept.sizes["sample"], None))
    spin = np.unique(data["spin_speed"].values)
    if spin.size == 1 and spin[0] > 0:
        time = (data["revolution"] - data["revolution"][0]) * (2 * math.pi / float(spin[0]))
        data = data.assign_coords(time=time.assign_attrs(units="s", long_name="time"))
    return data


def orbit_data(store: xr.Dataset, revolutions: int | None = None, over: str | None = None) -> xr.Dataset:
    """Return the last revolutions of vertical and horizontal motion, with the clearance; lazy.

    Parameters
    ----------
    store : Dataset
        One case, or cases along the axis `over`.
    revolutions : int, optional
        How many; all that were recorded by default.
    """
    names = ["vertical", "horizontal", "clearance"]
    data = narrow(store, names, [find_axis(store, over)] if over else [])
    if revolutions is not None:
        kept = last_revolutions(data["vertical"], revolutions)
        data = data.isel(sample=slice(-kept.sizes["sample"], None))
    return data
