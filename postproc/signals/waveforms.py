"""Waveforms of cases: the last revolutions of some signals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from postproc.signals.carried import NEEDED, mean_shift
from postproc.signals.spectra import check_signal, last_revolutions
from postproc.store.axes import find_axis, source
from postproc.store.rig_of_case import is_carried
from postproc.store.run_ups import is_run_up
from postproc.store.select import narrow
from postproc.store.variables import probe_of
from rubhpc.errors import InputError
from rubhpc.schema import PROBE

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

_LEAST_SINE = 0.05  # of the angle between two probes: 3 degrees
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
    names = [*dict.fromkeys(signals), *(() if is_run_up(store) else ("spin_speed",))]
    data = narrow(store, names, [find_axis(store, over)] if over else [])
    if revolutions is not None:
        kept = last_revolutions(data[signals[0]], revolutions)
        data = data.isel(sample=slice(-kept.sizes["sample"], None))
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
    if revolutions is not None:
        kept = last_revolutions(data["vertical"], revolutions)
        data = data.isel(sample=slice(-kept.sizes["sample"], None))
    if probes is None and not spread and is_carried(data) and all(name in store for name in NEEDED):
        tips = narrow(store, NEEDED, ["stator"]).isel(sample=slice(-data.sizes["sample"], None))
        moved = zip(("carrier_vertical", "carrier_horizontal"), mean_shift(tips).T, strict=True)
        data = data.assign({name: ("stator", values, {"units": "m"}) for name, values in moved})
    return data


def seen_by_two(
    store: xr.Dataset, probes: tuple[str, str], spread: Sequence[str] = (), others: Sequence[str] = ()
) -> xr.Dataset:
    """Return vertical and horizontal motion from two displacements along other directions, and `others`."""
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
