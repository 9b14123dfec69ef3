"""A measured file as a dataset with the names, units and attributes of what figures read from a store."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.measured.clock import Sampled, clipped, runs, sampled
from postproc.measured.formats import FORMATS, read_columns
from postproc.measured.keys import MeasuredKeys, Signal, build_keys, read_keys, unit_factor
from postproc.measured.shaft import Turning, at_constant_speed, by_key_phasor, by_speed_column
from postproc.measured.tracking import by_angle
from postproc.signals.places import seen_by_two
from postproc.store.attributes import MEASURED
from rubhpc.errors import InputError
from rubhpc.input.messages import place
from rubhpc.integrate.measuring.orbit_measures import period
from rubhpc.rig.reading import read_rig
from rubhpc.schema import AMPLITUDE, DONE, ORDERS, PHASE, PROBE, TURNED, VARIABLES, run_up_variables
from rubhpc.spectra import track_orders

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

_ONE_SPEED = 0.02  # by which the speed of revolutions varies about their mean, at one speed
_GAP = 0.05  # of a revolution: more samples that are missing in a row cut the record
_FEWEST = 4  # whole revolutions
_START = 6  # revolutions of a run-up, whose mean position is 0 where no gap voltage is given
_WINDOW = 6  # revolutions over which orders are followed, as in a simulated run-up
_PLAIN_ORDERS = 8  # up to which an orbit is compared with itself: above is noise, for the most part
_RPM = 30.0 / math.pi


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
        as missing or clipped samples, is in the attribute `note`, one problem a line.

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
    turned, speed, begins, notes = _by_revolution(keys, path)
    n = keys.samples_per_revolution
    is_steady = float(np.ptp(_smooth(speed))) <= _ONE_SPEED * float(speed.mean())
    turned = {signal: _zeroed(values, signal, is_steady, n) for signal, values in turned.items()}
    if keys.slow_roll:
        turned = _without_run_out(keys, path, turned, speed)
    variables: dict[str, Any] = {
        signal.name: ("sample", values, {**signal.about, "place": _place(signal, path)})
        for signal, values in turned.items()
    }
    at = np.arange(speed.size * n) / n
    coords: dict[str, Any] = {}
    if is_steady:
        coords["revolution"] = "sample", at, {"units": "1", "long_name": "revolution"}
        own = VARIABLES["spin_speed"]
        mean = speed.size * 2.0 * math.pi / (begins[-1] - begins[0])
        variables["spin_speed"] = (), mean, {"units": own.unit, "long_name": own.long_name}
    else:
        coords[TURNED] = "sample", at, {"units": "1", "long_name": "revolutions turned"}
        variables |= _revolutions(variables, n, speed, begins)
        coords["revolution"] = np.arange(speed.size)
        coords["order"] = (
            "order",
            np.array(ORDERS),
            {"units": "1", "long_name": "order of the spin frequency"},
        )
    probes = [dict(signal.probe) for signal in keys.signals if signal.probe]
    found = xr.Dataset(variables, coords=coords, attrs={"study": {"record": {"probe": probes}}})
    found.attrs |= {MEASURED: str(path), "note": "\n".join(notes)}
    if keys.rig is not None:
        found.attrs["rig"] = read_rig(_rig_path(keys)).as_dict()
    found = _with_orbit(found, keys, probes)
    if is_steady:
        own = VARIABLES["period"]
        found["period"] = (), _period(found, n), {"units": "1", "long_name": own.long_name}
    elif "vertical" in found and AMPLITUDE + "vertical" not in found:
        moved = {
            name: ("sample", found[name].values, found[name].attrs) for name in ("vertical", "horizontal")
        }
        found = found.assign(_revolutions(moved, n, speed, begins))
    return found


def _place(signal: Signal, path: Path) -> str:
    """Where a signal was measured, for captions."""
    angle = f" at {math.degrees(signal.probe['angle']):.4g}\N{DEGREE SIGN}" if signal.probe else ""
    node = "" if signal.node is None else f"node {signal.node}{angle} in "
    return f"measured{angle if not node else ''}: {node}{path.name}"


def _rig_path(keys: MeasuredKeys) -> str:
    """A rig by its name, or a path relative to the measured file."""
    near = Path(keys.file).parent / str(keys.rig)
    return str(near) if near.is_file() else str(keys.rig)


def _by_revolution(keys: MeasuredKeys, path: Path) -> tuple[dict[Signal, Floats], Floats, Floats, list[str]]:
    """Signals at uniform angles, the speed (rad/s) of each revolution, their ends (s), and what is wrong."""
    record, turning = _read(keys, path)
    notes = [*record.notes, *turning.notes]
    for signal in keys.signals:
        raw = record.values[signal.column]
        if not np.ptp(raw):
            notes.append(f"column {signal.column}: is {raw[0]:g} throughout; check the sensor")
        share, levels = clipped(raw)
        if levels:
            ends = " and ".join(f"{level:.4g}" for level in levels)
            notes.append(
                f"column {signal.column}: {100 * share:.2g} % of the samples are clipped, at {ends}; "
                "amplitudes are too low, raise the range"
            )
    first, end = math.ceil(turning.first - 1e-9), math.floor(turning.last + 1e-9)
    if end - first < _FEWEST:
        problem = f"holds {max(end - first, 0)} whole revolutions, fewer than {_FEWEST}"
        raise InputError(f"{path}: {problem}; give a longer record, or check [time] and [speed]")
    begins = turning.time_at(np.arange(first, end + 1).astype(float))
    begins = np.clip(begins, 0.0, record.time[-1])
    if not (np.diff(begins) > 0.0).all():
        raise InputError(f"{path}: [speed]: the shaft does not turn forward throughout; check the column")
    low, high = _longest_part(keys, record, begins)
    if (low, high) != (0, begins.size - 1):
        kept = f"{begins[low]:.3f} to {begins[high]:.3f} s, {high - low} of {begins.size - 1} revolutions"
        notes.append(f"drop-outs: only the longest part without them is used, {kept}")
    if high - low < _FEWEST:
        raise InputError(f"{path}: drop-outs leave no {_FEWEST} revolutions in a row; give another record")
    n, begins = keys.samples_per_revolution, begins[low : high + 1]
    rows = {
        signal: by_angle(record.values[signal.column], record.step, turning, first + low, first + high, n)
        for signal in keys.signals
    }
    return rows, 2.0 * math.pi / np.diff(begins), begins, [f"{path.name}: {note}" for note in notes]


def _read(keys: MeasuredKeys, path: Path) -> tuple[Sampled, Turning]:
    """The columns of a file at uniform times, and how the shaft turned."""
    assert keys.speed is not None
    of_time, of_speed = keys.time.column, keys.speed.column
    names = [signal.column for signal in keys.signals] + [name for name in (of_time, of_speed) if name]
    columns, rate = read_columns(path, names)
    if path.suffix.lower() == ".wav":
        columns = {name: values * keys.full_scale for name, values in columns.items()}
    rate = rate if keys.time.rate is None else keys.time.rate
    time = None
    if of_time is not None:
        where = place(keys.file, "time", "unit")
        time = columns.pop(of_time) * unit_factor(keys.time.unit, "s", where)
    elif rate is None:
        fix = 'add [time] with column = "t" or rate = "25.6 kHz"'
        raise InputError(f"{keys.file}: [time]: {path.suffix} states no sampling rate; {fix}")
    record = sampled(columns, time, rate, str(path), of_time or "")
    if of_speed is None:
        turning = at_constant_speed(float(keys.speed.value or 0.0), float(record.time[-1]))
    elif keys.speed.is_key_phasor:
        turning = by_key_phasor(
            record.values[of_speed], record.step, keys.speed, f"{path}: column {of_speed}"
        )
    else:
        where = place(keys.file, "speed", "unit")
        factor = unit_factor(str(keys.speed.unit), "rad/s", where)
        turning = by_speed_column(factor * record.values[of_speed], record.step, f"{path}: column {of_speed}")
    return record, turning


def _longest_part(keys: MeasuredKeys, record: Sampled, begins: Floats) -> tuple[int, int]:
    """The longest part, as revolutions from and to, in which no signal lacks a twentieth of a revolution."""
    bad = np.zeros(begins.size - 1, dtype=bool)
    lasts = np.diff(begins)
    for column in {signal.column for signal in keys.signals}:
        first, end = (at * record.step for at in runs(record.absent[column]))
        held = [np.clip(np.searchsorted(begins, at) - 1, 0, bad.size - 1) for at in (first, end)]
        for is_long, start, stop in zip(end - first > _GAP * lasts[held[0]], *held, strict=True):
            if is_long:
                bad[start : stop + 1] = True
    parts = [(int(first), int(end)) for first, end in zip(*runs(~bad), strict=True)]
    return max(parts, key=lambda part: part[1] - part[0], default=(0, 0))


def _smooth(speed: Floats) -> Floats:
    """Speeds without the scatter of single pulses: means over eight revolutions."""
    width = min(8, speed.size)
    return np.convolve(speed, np.full(width, 1.0 / width), mode="valid")


def _zeroed(values: Floats, signal: Signal, is_steady: bool, n: int) -> Floats:
    """A signal in SI, with the position 0 at its gap voltage, or else at its mean."""
    offset = signal.offset
    if offset is None:
        offset = float((values if is_steady else values[: _START * n]).mean())
    return (values - offset) * signal.factor


def _without_run_out(
    keys: MeasuredKeys, path: Path, turned: dict[Signal, Floats], speed: Floats
) -> dict[Signal, Floats]:
    """Signals less the mean revolution at slow roll, whose own mean is kept."""
    assert keys.slow_roll is not None
    n = keys.samples_per_revolution
    if keys.slow_roll.data is not None:
        slow, *_ = _by_revolution(keys, Path(keys.file).parent / keys.slow_roll.data)
        slow = {signal: values * signal.factor for signal, values in slow.items()}
        picked = np.ones(next(iter(slow.values())).size // n, dtype=bool)
    else:
        slow, picked = turned, speed < float(keys.slow_roll.below or 0.0)
    if not picked.any():
        lowest = f"{_RPM * float(speed.min()):.4g} rpm"
        raise InputError(
            f"{path}: [slow_roll] below: the lowest speed is {lowest}; give one above it, or data"
        )
    found = {}
    for signal, values in turned.items():
        mean = slow[signal].reshape(-1, n)[picked].mean(axis=0)
        found[signal] = values - np.tile(mean - mean.mean(), values.size // n)
    return found


def _revolutions(signals: Mapping[str, Any], n: int, speed: Floats, begins: Floats) -> dict[str, Any]:
    """What a run-up has of every revolution: speed, time, and amplitude and phase of orders."""
    names = [(name.removeprefix(PROBE), "displacement") for name in signals if name.startswith(PROBE)]
    own = run_up_variables(names)
    found: dict[str, Any] = {}
    for name, values in (("speed", speed), ("time", begins[:-1])):
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
    seen = [probe for probe in probes if probe["quantity"] == "displacement"]
    for first, second in combinations(seen, 2):
        if (
            all(first.get(key) == second.get(key) for key in ("node", "stator"))
            and abs(math.sin(second["angle"] - first["angle"])) > _GAP
        ):
            return seen_by_two(found, first, second)
    return found


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
    about = {"units": "rad s-1", "long_name": "spin speed"}
    found = xr.concat(
        rows, "speed", combine_attrs="override", coords="minimal", compat="override", join="override"
    )
    found = found.assign_coords(speed=("speed", speeds, about))
    found["status"] = "speed", np.full(len(each), DONE, dtype=np.int8)
    found.attrs["note"] = "\n".join(one.attrs["note"] for one in each if one.attrs["note"])
    return found
