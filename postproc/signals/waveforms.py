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
_ONE_SPEED = 2e-3  # by which the speeds of several cases may differ where one is named
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
        `time` (s) from the first sample kept. Of run-ups that differ in length, `revolution` counts from
        the end of each.
    """
    for signal in signals:
        check_signal(signal, store)
    names = [*dict.fromkeys(signals), *(() if is_run_up(store) else ("spin_speed",))]
    data = narrow(store, names, [find_axis(store, over)] if over else [])
    data = _last_of_each(store, data, revolutions, over)
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
    """
    spread = [find_axis(store, over)] if over else []
    if probes is None:
        data = narrow(store, ["vertical", "horizontal", "clearance"], spread)
    else:
        data = seen_by_two(store, probes, spread)
    data = _last_of_each(store, data, revolutions, over)
    if probes is None and not spread and is_carried(data) and all(name in store for name in NEEDED):
        tips = _last_of_each(store, narrow(store, NEEDED, ["stator"]), revolutions, None)
        moved = zip(("carrier_vertical", "carrier_horizontal"), mean_shift(tips).T, strict=True)
        data = data.assign({name: ("stator", values, {"units": "m"}) for name, values in moved})
    return data


def _last_of_each(
    store: xr.Dataset, data: xr.Dataset, revolutions: int | None, over: str | None
) -> xr.Dataset:
    """Return the last revolutions of each case; of run-ups, which differ in length, before its own end."""
    n = samples_per_revolution(data["revolution"])
    if not is_run_up(store):
        return data if revolutions is None else data.isel(sample=slice(-revolutions * n, None))
    spread = [find_axis(store, over)] if over else []
    speed = (narrow(store, ["speed"], spread) if "status" in store else store)["speed"]
    turned = speed.notnull().sum("revolution").values
    ends, longest = np.unique(turned[turned > 0]), data.sizes["sample"] // n
    if ends.size and (kept := _speeds(speed, turned, revolutions or longest)):
        data.attrs["spin_speeds"] = kept
    if not ends.size or (revolutions is None and ends.size > 1):
        return data
    count = min(revolutions or longest, int(ends[0]))
    if ends.size == 1:
        return data.isel(sample=slice((int(ends[0]) - count) * n, int(ends[0]) * n))
    before = {"sample": slice(0, count * n)}
    shifts = xr.DataArray(count - turned, dims=spread)
    rows = [
        data.isel({spread[0]: i}).drop_vars("revolution").shift(sample=int(shift) * n).isel(before)
        for i, shift in enumerate(shifts.values)
    ]
    place = np.arange(count * n) / n - count
    about = {"units": "1", "long_name": "revolution, from the end"}
    return xr.concat(rows, spread[0]).assign_coords(revolution=("sample", place, about))


def _speeds(speed: xr.DataArray, turned: NDArray[np.int64], revolutions: int) -> list[float]:
    """Mean speed of the first and last of the last revolutions, rad/s; [] where that of cases differs."""
    rows, ends = np.atleast_2d(speed.values), np.atleast_1d(turned)
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
