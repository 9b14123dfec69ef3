"""Poincaré sections: one point a revolution, of one case or along an axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.signals.velocity import VELOCITIES, section_velocity
from postproc.store.run_ups import is_run_up, steady_view
from postproc.store.select import narrow
from postproc.store.variables import require_variables
from rubhpc.schema import SECTION_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr


def section_of(store: xr.Dataset, signal: str) -> xr.DataArray:
    """Return the section of a signal: the stored one, or else every sample at a whole revolution; lazy.

    Velocities ("vertical_velocity") are taken from the waveform.

    Raises
    ------
    InputError
        The signal is unknown, or neither its section nor its waveform is stored.
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

    Raises
    ------
    InputError
        Other axes than these have several values, or the store keeps neither section nor waveform.
    """
    name = f"section_{signal}"
    store = store.assign({name: section_of(store, signal)})
    spread = [along] if over is None else [over, along]
    data = narrow(store, [name, "regime", "period", "status"], spread).sortby(along)
    return data.transpose(*spread, "section", ...)
