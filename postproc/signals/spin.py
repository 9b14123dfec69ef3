"""The spin of run-ups and driven rotors over the time: speed, and the torques that drive and brake it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from postproc.store.axes import find_axis, source
from postproc.store.run_ups import is_run_up
from postproc.store.select import narrow
from rubhpc.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

_PREFIX = "revolution_"
_TORQUES = ("drive_work", "braking_torque")


def spin_over_time(store: xr.Dataset, over: str | None = None) -> xr.Dataset:
    """Return the speed of every revolution, in its middle, and of a driven rotor the mean torques, loaded.

    Parameters
    ----------
    store : Dataset
        Of `rubhpc.run_up`, or a store of run-ups or driven rotors in which axes but `over` have been
        selected.
    over : str, optional
        An axis along which the cases are to be kept.

    Returns
    -------
    Dataset
        `time` (s) and `speed` (rad/s), and where a drive turns the rotor `driving_torque` and
        `braking_torque` (N m), over `revolution` and `over`; NaN beyond the last revolution of a case.

    Raises
    ------
    InputError
        The speed is constant, or several cases are left.
    """
    if not is_run_up(store):
        raise InputError(f"{source(store)}: its speeds are constant; give a store with [run_up] or [drive]")
    prefix = _PREFIX if _PREFIX + _TORQUES[1] in store else ""
    is_driven = prefix + _TORQUES[1] in store
    names = ["speed", "time", *([prefix + name for name in _TORQUES] if is_driven else [])]
    if "status" in store:
        store = narrow(store, names, [find_axis(store, over)] if over else [])
    found = store[names].drop_vars(["order", "stator"], errors="ignore").load()
    shown = found[["speed"]]
    shown["time"] = found["time"] + math.pi / found["speed"]
    shown["time"].attrs |= {"units": "s", "long_name": "time, in the middle of the revolution"}
    if is_driven:
        shown["driving_torque"] = found[prefix + _TORQUES[0]] / (2.0 * math.pi)
        shown["driving_torque"].attrs |= {"units": "N m", "long_name": "mean torque of the drive"}
        shown["braking_torque"] = found[prefix + _TORQUES[1]]
    return shown
