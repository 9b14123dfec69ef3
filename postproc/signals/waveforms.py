"""Waveforms of cases: the last revolutions of some signals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.signals.carried import NEEDED, mean_shift
from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.store.axes import find_axis, source
from postproc.store.rig_of_case import is_carried
from postproc.store.run_ups import is_run_up
from postproc.store.select import narrow
from postproc.store.variables import probe_of
from rubhpc.errors import InputError
from rubhpc.schema import PROBE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_LEAST_SINE = 0.05  # of the angle between two probes: 3 degrees
_RPM = 30.0 / math.pi
_AT_A_SPEED = 4  # revolutions around a speed of a run-up, by default
_ONE_SPEED = 2e-3  # by which the speeds of several cases may differ where one is named
DEFAULT_SIGNALS = ("vertical", "horizontal", "torsion", "contact_force")


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
        Spin speed of a run-up.

    Returns
    -------
    Dataset
        The signals over `sample`, with the coordinate `revolution` and, where all cases turn at one speed,
        `time` (s) from the first sample kept. Of run-ups that reach their end or the speed in different
        revolutions, `revolution` counts from that of each.

    Raises
    ------
    InputError
        The speed is none of the run-up's, or of a study at constant speeds.
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
    probes: tuple[str, str] | None = None,
    at: float | None = None,
) -> xr.Dataset:
    """Return the last revolutions of vertical and horizontal motion, with the clearance; lazy.

    Of one case whose stators stand on a carrier, `carrier_vertical` and `carrier_horizontal` (m, over the
    stators) are where that is on average in these revolutions.

    Parameters
    ----------
    store : Dataset
        One case, or cases along the axis `over`.
    revolutions : int, optional
        How many; all that were recorded by default.
    probes : (name, name), optional
        Two probes at one place whose signals, which need not be at right angles, give the motion there in
        place of that of the disc; the clearance is left out.
    at : float, rad/s, optional
        Spin speed of a run-up, around which revolutions are kept in place of the last ones.

    Raises
    ------
    InputError
        As of `waveform_data`, and for probes that do not give a motion.
    """
    spread = [find_axis(store, over)] if over else []
    if probes is None:
        data = narrow(store, ["vertical", "horizontal", "clearance"], spread)
    else:
        data = seen_by_two(store, probes, spread)
    data = _kept(store, data, revolutions, over, at)
    if probes is None and not spread and is_carried(data) and all(name in store for name in NEEDED):
        tips = _kept(store, narrow(store, NEEDED, ["stator"]), revolutions, None, at)
        moved = zip(("carrier_vertical", "carrier_horizontal"), mean_shift(tips).T, strict=True)
        data = data.assign({name: ("stator", values, {"units": "m"}) for name, values in moved})
    return data


def _kept(
    store: xr.Dataset, data: xr.Dataset, revolutions: int | None, over: str | None, at: float | None
) -> xr.Dataset:
    """Return the last revolutions of each case; of run-ups before their own end, or around a speed."""
    n = samples_per_revolution(data["revolution"])
    if not is_run_up(store):
        if at is not None:
            raise InputError(f"{source(store)}: at: its speeds are constant; select one of them")
        return data if revolutions is None else data.isel(sample=slice(-revolutions * n, None))
    spread = [find_axis(store, over)] if over else []
    speed = (narrow(store, ["speed"], spread) if "status" in store else store)["speed"]
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
    before = {"sample": slice(0, count * n)}
    shifts = xr.DataArray(count - ends, dims=spread)
    rows = [
        data.isel({spread[0]: i}).drop_vars("revolution").shift(sample=int(shift) * n).isel(before)
        for i, shift in enumerate(shifts.values)
    ]
    place = np.arange(count * n) / n - (count if at is None else count // 2)
    where = "the end" if at is None else "that at the speed"
    about = {"units": "1", "long_name": f"revolution, from {where}"}
    return xr.concat(rows, spread[0]).assign_coords(revolution=("sample", place, about))


def _ends_around(
    store: xr.Dataset, speed: xr.DataArray, turned: NDArray[np.int64], count: int, at: float
) -> NDArray[np.int64]:
    """Ends of `count` revolutions around a speed, rad/s, that each case first has; 0 of one without any."""
    ends = np.zeros_like(turned)
    for place in np.ndindex(turned.shape):
        end = int(turned[place])
        own = speed.values[place][:end]
        if not own.size:
            continue
        step, low, high = (float(v) for v in (np.abs(np.diff(own)).max(initial=0.0), own.min(), own.max()))
        if not low - step <= at <= high + step:
            given, least, most = (f"{_RPM * value:.6g}" for value in (at, low, high))
            problem = f"{given} rpm is none of its speeds, {least} to {most} rpm"
            raise InputError(f"{source(store)}: at: {problem}; give one of these")
        first = int(np.argmin(np.abs(own - at))) - count // 2
        ends[place] = np.clip(first, 0, end - count) + count
    return ends


def _speeds(speed: xr.DataArray, until: NDArray[np.int64], revolutions: int) -> list[float]:
    """Mean speed of the first and last revolution before each end, rad/s; [] where that of cases differs."""
    rows, ends = np.atleast_2d(speed.values), np.atleast_1d(until)
    kept = [row[[max(end - revolutions, 0), end - 1]] for row, end in zip(rows, ends, strict=True) if end]
    return kept[0].tolist() if np.allclose(kept, kept[0], rtol=_ONE_SPEED) else []


def seen_by_two(
    store: xr.Dataset, probes: tuple[str, str], spread: Sequence[str] = (), others: Sequence[str] = ()
) -> xr.Dataset:
    """Return vertical and horizontal motion from two displacements along other directions, and `others`."""
    if isinstance(probes, str) or len(probes) != 2:
        raise InputError(f"{source(store)}: probes: {probes}: give the names of two probes at one place")
    first, second = (probe_of(store, name) for name in probes)
    for probe in (first, second):
        if probe["quantity"] not in ("displacement", "velocity", "acceleration"):
            problem = f"measures {probe['quantity'].replace('_', ' ')}, which has no orbit"
            raise InputError(
                f"{source(store)}: probe {probe['name']}: {problem}; choose one of a displacement"
            )
    for key in ("quantity", "node", "stator"):
        if first.get(key) != second.get(key):
            pair = f"{first['name']} and {second['name']}"
            raise InputError(
                f"{source(store)}: probes {pair}: differ in their {key}; choose two at one place"
            )
    a, b = first["angle"], second["angle"]
    sine = math.sin(b - a)
    if abs(sine) < _LEAST_SINE:
        pair = f"{first['name']} and {second['name']}"
        raise InputError(f"{source(store)}: probes {pair}: look in one direction; choose two that do not")
    names = [f"{PROBE}{probe['name']}" for probe in (first, second)]
    data = narrow(store, [*names, *others], spread)
    x, y = (data[name].astype(float) for name in names)
    where = f"node {first['node']}" if "node" in first else f"the tip of stator {first['stator']}"
    for name, value in (
        ("vertical", (x * math.sin(b) - y * math.sin(a)) / sine),
        ("horizontal", (y * math.cos(a) - x * math.cos(b)) / sine),
    ):
        about = {"units": data[names[0]].attrs.get("units", "m"), "of_probes": where}
        about["long_name"] = f"{name} {first['quantity']} of {where}"
        data = data.assign({name: value.assign_attrs(about)})
    data = data.drop_vars(names)
    data.attrs["probes"] = [(probe["name"], probe["angle"]) for probe in (first, second)]
    return data
