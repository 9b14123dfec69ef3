"""A store of run-ups as its figures read it: the highest speed is not an axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.store.axes import source
from rubhpc.errors import InputError
from rubhpc.schema import TURNED

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

_CONTACT = ("peak_contact_force", "contact_force")  # by which the most loaded stator is chosen
STEADY = (  # measures of a motion at one speed, which run-ups lack
    "regime",
    "period",
    "settled",
    "transient_revolutions",
    "whirl_ratio",
    "lyapunov_exponent",
    "largest_multiplier",
    "multiplier_angle",
)
_HIGHEST = (
    "spin_speed",
    "contact_free_amplitude",
)  # of a run-up at its highest speed, of a drive at its first
_NAMES = {"revolution_speed": "speed", "revolution_time": "time"}


def is_run_up(store: xr.Dataset) -> bool:
    """Whether a dataset holds run-ups, revolution by revolution."""
    return "revolution" in store.dims


def as_run_ups(store: xr.Dataset) -> xr.Dataset:
    """Return a store of run-ups with `speed` (rad/s) and `time` (s) over `revolution` and its axes."""
    opened = store.isel(speed=0, drop=True).rename(_NAMES)
    opened.encoding.update(store.encoding)
    return opened


def steady_view(store: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Return a store of run-ups for figures of variables `names`: signals have their coordinate `revolution`.

    Raises
    ------
    InputError
        The figure needs one speed.
    """
    if "spin_speed" in names or any(name.startswith("spectrum_") for name in names):
        fix = "draw it with rubhpc waterfall or rubhpc bode"
        raise InputError(f"{source(store)}: the speed changes, and this figure needs a constant one; {fix}")
    if any("revolution" in store[name].dims for name in names if name in store):
        return store
    status = ["status"] if "status" in store else []
    kept = store[[name for name in [*names, *status, *_CONTACT] if name in store]]
    kept = kept.drop_vars("revolution", errors="ignore")
    seen = kept.rename({TURNED: "revolution"}) if TURNED in kept.coords else kept
    seen.encoding.update(store.encoding)
    return seen


def measures_alone(store: xr.Dataset) -> xr.Dataset:
    """Return a store of run-ups without its signals, revolutions and the measures that they lack."""
    kept = store.drop_dims(["sample", "revolution", "order"], errors="ignore")
    kept = kept.drop_vars([*STEADY, *_HIGHEST], errors="ignore")
    kept.encoding.update(store.encoding)
    return kept
