"""A store of run-ups as its figures read it: the highest speed is not an axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.store.axes import refusal
from rubhpc.schema import TURNED
from rubhpc.units import RPM

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

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

    InputError where the figure needs one speed.
    """
    if "spin_speed" in names or any(name.startswith("spectrum_") for name in names):
        fix = "draw it with rubhpc waterfall, bode, or spectrum --at SPEED"
        raise refusal(store, f"the speed changes, and this figure needs a constant one; {fix}")
    if any("revolution" in store[name].dims for name in names if name in store):
        return store
    status = ["status"] if "status" in store else []
    kept = store[[name for name in [*names, *status, *_CONTACT] if name in store]]
    kept = kept.drop_vars("revolution", errors="ignore")
    seen = kept.rename({TURNED: "revolution"}) if TURNED in kept.coords else kept
    seen.encoding.update(store.encoding)
    return seen


def first_around(store: xr.Dataset, speed: NDArray[np.float64], count: int, at: float) -> int:
    """Return the first of `count` revolutions around the one that first has the speed `at`, rad/s.

    `speed` (n_revolution,), rad/s, is that of one run-up of the store. InputError where it does not pass
    `at`.
    """
    step, low, high = float(np.abs(np.diff(speed)).max(initial=0.0)), float(speed.min()), float(speed.max())
    if not low - step <= at <= high + step:
        given, least, most = (f"{RPM.factor * value:.6g}" for value in (at, low, high))
        problem = f"{given} rpm is none of its speeds, {least} to {most} rpm"
        raise refusal(store, f"at: {problem}; give one of these")
    first = int(np.argmin(np.abs(speed - at))) - count // 2
    return int(np.clip(first, 0, speed.size - count))


def measures_alone(store: xr.Dataset) -> xr.Dataset:
    """Return a store of run-ups without its signals, revolutions and the measures that they lack."""
    kept = store.drop_dims(["sample", "revolution", "order"], errors="ignore")
    kept = kept.drop_vars([*STEADY, *_HIGHEST], errors="ignore")
    kept.encoding.update(store.encoding)
    return kept
