"""A measured file as a dataset with the names, units and attributes of what figures read from a store."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.measured.formats import FORMATS
from postproc.measured.keys import build_keys, read_keys
from postproc.measured.record import read_record
from postproc.signals.places import see_motion, seen_by_two
from postproc.store.attributes import MEASURED
from rubhpc.errors import InputError
from rubhpc.integrate.measuring.orbit_measures import period
from rubhpc.rig.reading import read_rig
from rubhpc.schema import AMPLITUDE, DONE, ORDERS, PHASE, PROBE, TURNED, VARIABLES, run_up_variables
from rubhpc.spectra import track_orders

if TYPE_CHECKING:
    from os import PathLike

    from postproc.measured.keys import MeasuredKeys, Signal
    from postproc.measured.record import Record

_WINDOW = 6  # revolutions over which orders are followed, as in a simulated run-up
_PLAIN_ORDERS = 8  # up to which an orbit is compared with itself: above is noise, for the most part


def measured(
    file: str | PathLike[str],
    *,
    time: Mapping[str, Any] | None = None,
    speed: Mapping[str, Any] | float | str | None = None,
    signals: Mapping[str, Mapping[str, Any]] | None = None,
    slow_roll: Mapping[str, Any] | None = None,
    **keys: Any,
) -> xr.Dataset:
    """Return measured signals as a dataset that has all figures of a store.

    Parameters
    ----------
    file : path
        A measured file (TOML), or the file with the data: .csv, .txt, .parquet, .h5, .hdf5, .nc, .mat, .uff,
        .unv or .wav. The TOML of the same name next to the data is read too, if there is one.
    time, speed, signals, slow_roll : mapping, optional
        Tables of a measured file, in place of those in the file: `speed={"column": "kp", "level": 2.5}`, or
        a constant speed, "1800 rpm"; `signals={"vertical": {"column": "y", "unit": "um"}}`.
    **keys
        Its other keys: `rig`, `samples_per_revolution`, `full_scale`, `data`.

    Returns
    -------
    xarray.Dataset
        At a constant speed as one case of a store: signals over `sample` (SI) with `revolution`,
        `spin_speed` (rad/s) and `period` (revolutions, 0: none found). Where the speed changes by more than
        2 %, as of `run_up`: signals over `sample` with `turned`, `speed` (rad/s) and `time` (s) over
        `revolution`, and amplitude and phase of orders 1/3, 1/2, 1 and 2 over `revolution` and `order`. Of
        several files of data, signals and `spin_speed` over `speed`. Signals are `vertical`, `horizontal` and
        others of a store where they have these names, else `probe_NAME`. What is wrong with the record, such
        as missing or clipped samples, is in the attribute `note`, one problem a line; `rate` (Hz) is that of
        the samples in the file, and `has_absolute_phase` is 1 where phases count from straight up.

    Raises
    ------
    InputError
        A file cannot be read, or says too little; its text says what to do.

    Examples
    --------
    >>> found = measured("probe.csv", speed={"column": "kp", "level": 2.5},
    ...                  signals={"vertical": {"column": "y", "unit": "um"}})  # doctest: +SKIP
    >>> found.rub.spectrum("vertical")  # doctest: +SKIP
    """
    path = Path(file)
    if path.is_dir() or path.suffix.lower() not in (".toml", *FORMATS):
        raise InputError(
            f"{path}: is no measured file; give a .toml, or convert it to one of {', '.join(FORMATS)}"
        )
    described = path if path.suffix.lower() == ".toml" else path.with_suffix(".toml")
    tables = read_keys(described) if described == path or described.is_file() else {}
    if path.suffix.lower() != ".toml":
        tables |= {"data": [path.name]}
    given = {"time": time, "slow_roll": slow_roll, "signal": signals, **keys}
    given["speed"] = speed if isinstance(speed, Mapping | None) else {"value": speed}
    tables |= {name: value for name, value in given.items() if value is not None}
    if "signal" not in tables and path.suffix.lower() != ".toml":
        fix = "write it with [speed] and a [signal.NAME] for each column"
        raise InputError(f"{path}: there is no {described.name} that describes its columns; {fix}")
    wanted = build_keys(tables, str(described if described.is_file() else path))
    if not wanted.data:
        wanted = build_keys(tables | {"data": _beside(path)}, str(path))
    one = [_one(wanted, path.parent / name) for name in wanted.data]
    found = one[0] if len(one) == 1 else _along_speeds(one, path)
    found.encoding["source"] = str(path)
    return found


def _beside(path: Path) -> list[str]:
    """The file with the data that a measured file does not name: the one of the same name."""
    names = [path.with_suffix(kind).name for kind in FORMATS if path.with_suffix(kind).is_file()]
    if len(names) != 1:
        problem = f"{', '.join(names)} are there" if names else f"there is no {path.stem}.csv"
        raise InputError(f'{path}: data: missing, and {problem}; add data = "{path.stem}.csv"')
    return names


def _one(keys: MeasuredKeys, path: Path) -> xr.Dataset:
    """The dataset of one file."""
    record, n = read_record(keys, path), keys.samples_per_revolution
    variables: dict[str, Any] = {
        signal.name: ("sample", values, {**signal.about, "place": _place(signal, path)})
        for signal, values in record.signals.items()
    }
    at = np.arange(record.speed.size * n) / n
    coords: dict[str, Any] = {}
    if record.is_steady:
        coords["revolution"] = "sample", at, {"units": "1", "long_name": "revolution"}
        mean = record.speed.size * 2.0 * math.pi / (record.begins[-1] - record.begins[0])
        variables["spin_speed"] = (), mean, {"units": "rad s-1", "long_name": "spin speed"}
    else:
        coords[TURNED] = "sample", at, {"units": "1", "long_name": "revolutions turned"}
        variables |= _revolutions(variables, n, record)
        coords["revolution"] = np.arange(record.speed.size)
        about = {"units": "1", "long_name": "order of the spin frequency"}
        coords["order"] = "order", np.array(ORDERS), about
    probes = [dict(signal.probe) for signal in keys.signals if signal.probe]
    found = xr.Dataset(variables, coords=coords, attrs={"study": {"record": {"probe": probes}}})
    found.attrs |= {MEASURED: str(path), "note": "\n".join(record.notes)}
    found.attrs |= {"rate": record.rate, "has_absolute_phase": int(record.is_absolute)}
    if keys.rig is not None:
        found.attrs["rig"] = read_rig(_rig_path(keys)).as_dict()
    found = _with_orbit(found, keys, probes)
    if record.is_steady:
        about = {"units": "1", "long_name": VARIABLES["period"].long_name}
        found["period"] = (), _period(found, n), about
    elif "vertical" in found and AMPLITUDE + "vertical" not in found:
        moved = {
            name: ("sample", found[name].values, found[name].attrs) for name in ("vertical", "horizontal")
        }
        found = found.assign(_revolutions(moved, n, record))
    return found


def _place(signal: Signal, path: Path) -> str:
    """Where a signal was measured, for captions."""
    return f"measured: {'' if signal.node is None else f'node {signal.node} in '}{path.name}"


def _rig_path(keys: MeasuredKeys) -> str:
    """A rig by its name, or a path relative to the measured file."""
    near = Path(keys.file).parent / str(keys.rig)
    return str(near) if near.is_file() else str(keys.rig)


def _revolutions(signals: Mapping[str, Any], n: int, record: Record) -> dict[str, Any]:
    """What a run-up has of every revolution: speed, time, and amplitude and phase of orders."""
    names = [(name.removeprefix(PROBE), "displacement") for name in signals if name.startswith(PROBE)]
    own = run_up_variables(names)
    found: dict[str, Any] = {}
    for name, values in (("speed", record.speed), ("time", record.begins[:-1])):
        about = own[f"revolution_{name}"]
        found[name] = "revolution", values, {"units": about.unit, "long_name": about.long_name}
    for name, (_, values, about) in signals.items():
        lines = track_orders(values, n, ORDERS, _WINDOW)
        dims, text = ("revolution", "order"), about["long_name"]
        found[AMPLITUDE + name] = dims, np.abs(lines), {**about, "long_name": f"amplitude of the {text}"}
        found[PHASE + name] = dims, np.angle(lines), {"units": "rad", "long_name": f"phase of the {text}"}
    return found


def _with_orbit(found: xr.Dataset, keys: MeasuredKeys, probes: list[dict[str, Any]]) -> xr.Dataset:
    """The dataset with the motion that the first two probes at one place see, if it states none."""
    if "vertical" in found or "horizontal" in found:
        node = next((s.node for s in keys.signals if s.name in ("vertical", "horizontal") and s.node), None)
        return found if node is None else found.assign_attrs(node=node)
    pair = next((pair for pair in combinations(probes, 2) if see_motion(*pair)), None)
    return found if pair is None else seen_by_two(found, *pair)


def _period(found: xr.Dataset, n: int) -> int:
    """Revolutions after which the orbit, or the first signal, repeats; 0: none.

    The rule is that of a simulation; orders above 8 are left out first.
    """
    names = [str(name) for name, values in found.data_vars.items() if "sample" in values.dims]
    orbit = [name for name in ("vertical", "horizontal") if name in found]
    pair = orbit if len(orbit) == 2 else [orbit[0] if orbit else names[0]] * 2
    turns = found.sizes["sample"] // n
    low = []
    for name in pair:
        lines = np.fft.rfft(found[name].values)
        lines[_PLAIN_ORDERS * turns + 1 :] = 0.0
        low.append(np.fft.irfft(lines, turns * n))
    return period(low[0], low[1], n) if np.ptp(low[0]) else 0


def _along_speeds(each: Sequence[xr.Dataset], path: Path) -> xr.Dataset:
    """Several records, each at its own speed, along an axis of the speed; the last revolutions of each."""
    for one in each:
        if "spin_speed" not in one:
            problem = f"the speed of {one.attrs[MEASURED]} changes; several files of data have one each"
            raise InputError(f"{path}: data: {problem}; describe it in a file of its own")
    each = sorted(each, key=lambda one: float(one["spin_speed"]))
    least = min(one.sizes["sample"] for one in each)
    rows = [
        one.isel(sample=slice(-least, None)).assign_coords(revolution=each[0]["revolution"][:least])
        for one in each
    ]
    speeds = [float(one["spin_speed"]) for one in each]
    if min(np.diff(speeds)) <= 0.0:
        raise InputError(f"{path}: data: two files have one speed; leave out one of them")
    found = xr.concat(rows, "speed", combine_attrs="override", coords="minimal", compat="override")
    for values in found.data_vars.values():
        values.attrs |= {"place": f"measured: {path.name}"} if "place" in values.attrs else {}
    about = {"units": "rad s-1", "long_name": "spin speed"}
    found = found.assign_coords(speed=("speed", speeds, about))
    found["status"] = "speed", np.full(len(each), DONE, dtype=np.int8)
    found.attrs["note"] = "\n".join(one.attrs["note"] for one in each if one.attrs["note"])
    return found
