"""Waveforms of cases: the last revolutions of some signals, and where stators on a carrier are on average."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.store.attributes import MEASURED
from postproc.store.axes import find_axis, refusal
from postproc.store.rig_of_case import bores_around, is_carried, rig_of, stator_places, stators_around
from postproc.store.run_ups import first_around, is_run_up
from postproc.store.select import narrow
from rubhpc.schema import CONTACT_ANGLE, is_signal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_AT_A_SPEED = 4  # revolutions around a speed of a run-up, by default
_ONE_SPEED = 2e-3  # by which the speeds of several cases may differ where one is named
DEFAULT_SIGNALS = ("vertical", "horizontal", "torsion", "contact_force")
NEEDED = ("stator_axial", "stator_lateral", "contact_force")


def default_signals(store: xr.Dataset) -> tuple[str, ...]:
    """Return the signals that are drawn by default: motion and contact force, or all that were measured."""
    if MEASURED not in store.attrs:
        return DEFAULT_SIGNALS
    return tuple(str(name) for name in store.data_vars if is_signal(str(name)))


def waveform_data(
    store: xr.Dataset,
    signals: Sequence[str] = DEFAULT_SIGNALS,
    revolutions: int | None = 4,
    over: str | None = None,
    at: float | None = None,
) -> xr.Dataset:
    """Return the last revolutions of some signals, or those of a run-up around a speed; lazy.

    Parameters
    ----------
    store : Dataset
        One case (and one stator, for a stator's signals), or cases along the axis `over`.
    revolutions : int, optional
        How many; None for all that were recorded.
    at : float, rad/s, optional
        Spin speed of a run-up; InputError where it is none of its speeds.

    Returns
    -------
    Dataset
        The signals over `sample`, with the coordinate `revolution` and, where all cases turn at one speed,
        `time` (s) from the first sample kept. Of run-ups that reach their end or the speed in different
        revolutions, `revolution` counts from that of each.
    """
    for signal in signals:
        check_signal(signal, store)
    names = [*dict.fromkeys(signals), *(() if is_run_up(store) else ("spin_speed",))]
    data = narrow(store, names, [find_axis(store, over)] if over else [])
    data = _kept(store, data, revolutions, over, at)
    spin = np.unique(data["spin_speed"].values) if "spin_speed" in data else np.zeros(0)
    if spin.size == 1 and spin[0] > 0:
        time = (data["revolution"] - data["revolution"][0]) * (2 * math.pi / float(spin[0]))
        data = data.assign_coords(time=time.assign_attrs(units="s", long_name="time"))
    return data


def orbit_data(
    store: xr.Dataset,
    revolutions: int | None = None,
    over: str | None = None,
    at: float | None = None,
) -> xr.Dataset:
    """Return the last revolutions of vertical and horizontal motion, with the clearance; lazy.

    Arguments are those of `waveform_data`, of a store with the motion of a place as `moved_at` returns it. Of
    one case whose stators stand on a carrier, `carrier_vertical` and `carrier_horizontal` (m, over the
    stators) are where that is on average in these revolutions; of bores, where the hole is. There
    `rim_vertical` and `rim_horizontal` (m, over the bores and samples) are the centre of a rim that touches
    the hole at the contact point.
    """
    spread = [find_axis(store, over)] if over else []
    names = ["vertical", "horizontal", *([] if MEASURED in store.attrs else ["clearance"])]
    data = narrow(store, names, spread)
    data = _kept(store, data, revolutions, over, at)
    bores = bores_around(data)
    if not spread and (is_carried(data) or bores) and all(name in store for name in NEEDED):
        needed = [*NEEDED, *([CONTACT_ANGLE] if CONTACT_ANGLE in store and bores else [])]
        tips = _kept(store, narrow(store, needed, ["stator"]), revolutions, None, at)
        moved = zip(("carrier_vertical", "carrier_horizontal"), mean_shift(tips).T, strict=True)
        data = data.assign({name: ("stator", values, {"units": "m"}) for name, values in moved})
        if CONTACT_ANGLE in tips:
            data = data.assign(_rims(tips, float(data["clearance"].values), bores))
    return data


def _rims(tips: xr.Dataset, clearance: float, bores: list[int]) -> dict[str, Any]:
    """Return the centres of rims that touch some bores where the contact is, NaN without contact."""
    reach = {i: clearance + stator.clearance_offset for i, stator in enumerate(rig_of(tips).stator)}
    centres = dict(zip(stators_around(tips), stator_places(tips), strict=True))
    turns = (("vertical", "stator_axial", np.cos, 3), ("horizontal", "stator_lateral", np.sin, 2))
    found = {}
    for name, moved, along, k in turns:
        hole, angle = (tips[signal].transpose("stator", "sample") for signal in (moved, CONTACT_ANGLE))
        at = [hole.values[i] + centres[i][k] + reach[i] * along(angle.values[i]) for i in bores]
        found[f"rim_{name}"] = (("bore", "sample"), np.array(at, dtype=float), {"units": "m"})
    return found


def _kept(
    store: xr.Dataset, data: xr.Dataset, revolutions: int | None, over: str | None, at: float | None
) -> xr.Dataset:
    """Return the last revolutions of each case; of run-ups before their own end, or around a speed."""
    n = samples_per_revolution(data["revolution"])
    if not is_run_up(store):
        if at is not None:
            raise refusal(store, "at: its speeds are constant; select one of them")
        return data if revolutions is None else data.isel(sample=slice(-revolutions * n, None))
    spread = [find_axis(store, over)] if over else []
    speed = narrow(store, ["speed"], spread)["speed"]
    turned = speed.notnull().sum("revolution").values
    if not turned.any() or (revolutions is None and at is None and np.unique(turned[turned > 0]).size > 1):
        return data
    wanted = (revolutions or _AT_A_SPEED) if at is not None else (revolutions or data.sizes["sample"] // n)
    count = min(wanted, int(turned[turned > 0].min()))
    ends = turned if at is None else _ends_around(store, speed, turned, count, at)
    if shown := _speeds(speed, ends, count):
        data.attrs["spin_speeds"] = shown
    same = np.unique(ends[turned > 0])
    if same.size == 1:
        return data.isel(sample=slice((int(same[0]) - count) * n, int(same[0]) * n))
    first = xr.DataArray(np.maximum(ends - count, 0) * n, dims=spread)  # where a case has no revolution: NaN
    rows = data.drop_vars("revolution").isel(sample=first + xr.DataArray(np.arange(count * n), dims="sample"))
    place = np.arange(count * n) / n - (count if at is None else count // 2)
    where = "the end" if at is None else "that at the speed"
    about = {"units": "1", "long_name": f"revolution, from {where}"}
    return rows.assign_coords(revolution=("sample", place, about))


def _ends_around(
    store: xr.Dataset, speed: xr.DataArray, turned: NDArray[np.int64], count: int, at: float
) -> NDArray[np.int64]:
    """Ends of `count` revolutions around a speed, rad/s, that each case first has; 0 of one without any."""
    ends = np.zeros_like(turned)
    for place in np.ndindex(turned.shape):
        if end := int(turned[place]):
            ends[place] = first_around(store, speed.values[place][:end], count, at) + count
    return ends


def _speeds(speed: xr.DataArray, until: NDArray[np.int64], revolutions: int) -> list[float]:
    """Mean speed of the first and last revolution before each end, rad/s; [] where that of cases differs."""
    rows, ends = np.atleast_2d(speed.values), np.atleast_1d(until)
    kept = [row[[max(end - revolutions, 0), end - 1]] for row, end in zip(rows, ends, strict=True) if end]
    return kept[0].tolist() if np.allclose(kept, kept[0], rtol=_ONE_SPEED) else []


def mean_shift(tips: xr.Dataset) -> NDArray[np.float64]:
    """Return how far the carrier of each stator has moved up and to +z on average, (n_stator, 2), m.

    It is read from the tips (of one case, over stator and sample) that touch nothing, which move with it:
    `v cos a + w sin a` outwards and `w cos a - v sin a + s` along the rim, where s is a turn. Stators on the
    ground have not moved. Of a bore it is how far the hole has moved.
    """
    stators = rig_of(tips).stator
    axial, lateral, force = (tips[name].transpose("stator", "sample").values.mean(axis=1) for name in NEEDED)
    shift = np.zeros((len(stators), 2))
    is_bore = np.array([stator.is_bore for stator in stators])
    shift[is_bore] = np.stack([axial, lateral], axis=1)[is_bore]
    for name in {stator.carrier for stator in stators if not stator.is_bore} - {None}:
        carried = np.flatnonzero([stator.carrier == name and not stator.is_bore for stator in stators])
        free = carried[force[carried] == 0.0]
        seen = free if free.size > 1 else carried
        c, s = (f(np.array([stators[i].angle for i in seen])) for f in (np.cos, np.sin))
        rows = np.concatenate([np.stack([c, s, 0.0 * c], 1), np.stack([-s, c, np.ones_like(c)], 1)])
        found, *_ = np.linalg.lstsq(rows, np.concatenate([axial[seen], lateral[seen]]))
        shift[carried] = found[:2]
    return shift
