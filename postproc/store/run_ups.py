"""A store of cases that run up, as its figures read it: the highest speed is no axis of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

_NAMES = {"revolution_speed": "speed", "revolution_time": "time"}


def is_run_up(store: xr.Dataset) -> bool:
    """Whether a dataset holds run-ups, revolution by revolution."""
    return "revolution" in store.dims


def as_run_ups(store: xr.Dataset) -> xr.Dataset:
    """Return a store of run-ups with `speed` (rad/s) and `time` (s) over `revolution` and its axes."""
    opened = store.isel(speed=0, drop=True).rename(_NAMES)
    opened.encoding.update(store.encoding)
    return opened
