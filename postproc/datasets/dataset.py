"""Writes a data set: a Parquet file a split, a card and a README, in a directory that comes whole."""

from __future__ import annotations

import json
import math
import shutil
from itertools import pairwise, product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from postproc.datasets.card import Made, croissant, readme
from postproc.datasets.columns import case_columns, window_columns
from postproc.datasets.sensor_file import read_sensors
from postproc.datasets.splits import SPLITS, check_shares, keys_of, split_cases
from postproc.datasets.table_file import TableFile
from postproc.datasets.windows import Windows
from postproc.signals.indicators import rms_about_mean
from postproc.signals.sensors import Sensor, check_rate
from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.store.attributes import MEASURED
from postproc.store.axes import axes_of, refusal
from postproc.store.branch_points import is_of_points
from postproc.store.case_table import import_parquet, metadata_of
from postproc.store.run_ups import is_run_up
from postproc.store.variables import require_results, require_variables
from rubhpc.errors import InputError, writing
from rubhpc.schema import DONE, PROBE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    Waves = dict[str, xr.DataArray]  # signals by column

USUAL = ("vertical", "horizontal", "torsion")  # signals of a store without probes
N_SAMPLE, N_DRAW, LEVELS, SHARES = 1024, 10, (0.05,), (0.7, 0.15, 0.15)
_FORCE = "contact_force"


def write_dataset(
    store: xr.Dataset,
    output: str | Path,
    *,
    signals: Sequence[str] = (),
    rate: float | None = None,
    n_sample: int = N_SAMPLE,
    n_draw: int = N_DRAW,
    levels: Sequence[float] = (),
    sensors: str | Path | None = None,
    shares: Sequence[float] = SHARES,
    seed: int = 1,
    say: Callable[[str], None] = lambda _: None,
) -> Made:
    """Write labelled windows of the cases of a store as a data set, and return what it is made of.

    Equal arguments give equal bytes. Parameters and seed decide split, places and noise of a case, whatever
    other cases there are; only the reference of the noise is a median over all.

    Parameters
    ----------
    store : Dataset
        Waveforms of cases at constant speeds, or of run-ups; cases without a result are left out.
    output : path
        A directory that is not there, or is empty.
    signals : sequence of str
        By default all probes, or the motion of the disc.
    rate : float, optional
        Of the samples, Hz; by default the lowest with which a case is stored.
    n_sample, n_draw : int
        Samples of a window, and windows of a case at each level of the noise.
    levels : sequence of float
        White noise as shares of the median rms of each signal in the cases that touch; by default 0.05.
    sensors : path, optional
        A file of sensors (`postproc.datasets.sensor_file`) in place of levels.
    shares : three floats
        Of the cases for training, validation and test.
    say : callable
        Takes how far it is.

    Raises
    ------
    InputError
        The directory holds something, the records are too short, or an argument does not fit the store.
    """
    output = Path(output)
    import_parquet(str(output))
    _check_output(output)
    check_shares(shares)
    if is_of_points(store) or MEASURED in store.attrs:
        problem = "has no simulated waveforms, whose contacts are known"
        raise refusal(store, f"{problem}; give the store of a study of cases or run-ups")
    waves = _waves_of(store, signals)
    is_done = store["status"].values.ravel() == DONE
    require_results(np.where(is_done, 0.0, math.nan), store)
    cases = case_columns(store)
    keys, groups = keys_of(cases.parameters, cases.touches)
    split = np.full(is_done.size, -1, dtype=np.intp)
    done = np.flatnonzero(is_done)
    split[done] = split_cases([groups[i] for i in done], cases.touches[done], shares, seed)
    say("reading the level of each signal")
    if sensors and levels:
        raise InputError("sensors: have noise of their own; remove --noise, or --sensors")
    units = {name: str(wave.attrs.get("units", "1")) for name, wave in waves.items()}
    given = read_sensors(sensors, units) if sensors else {}
    windows = Windows(
        sensors=given or dict.fromkeys(waves, Sensor()),
        reference={} if given else _reference(store, waves, is_done, cases.touches),
        levels=() if given else tuple(dict.fromkeys(levels or LEVELS)),
        n_draw=n_draw,
        n_sample=n_sample,
        rate=_rate(store, n_sample, rate),
        seed=seed,
    )
    columns = window_columns(store, waves, has_levels=bool(windows.levels))
    columns += [c for c in cases.columns if c.name not in {own.name for own in columns}]
    made = Made(
        about=metadata_of(store),
        columns=columns,
        windows=windows,
        n_left_out=is_done.size - done.size,
        files={},
    )
    with writing(output, "--output"):
        partial = output.absolute().with_name(f".{output.name}.part")
        shutil.rmtree(partial, ignore_errors=True)  # of a run that was killed
        partial.mkdir()
        try:
            files = {
                name: TableFile(partial / f"{name}.parquet", columns, n_sample, made.about)
                for name, share in zip(SPLITS, shares, strict=True)
                if share
            }
            n_done = 0
            for flat, case in _cases(store, waves):
                if is_done[flat]:
                    seen = {name: case[name].values for name in waves}
                    rows = windows.of_case(case, seen, np.atleast_2d(case[_FORCE].values), keys[flat])
                    known = {"case": flat, **cases.of(flat)}
                    files[SPLITS[split[flat]]].add([known | row for row in rows])
                    n_done += 1
                    say(f"{n_done}/{done.size} cases")
            made.files.update({name: file.close() for name, file in files.items()})
            (partial / "README.md").write_text(readme(made))
            card = json.dumps(croissant(made, partial), indent=1, ensure_ascii=False)
            (partial / "croissant.json").write_text(card + "\n")
            partial.replace(output)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
    return made


def _check_output(output: Path) -> None:
    """Refuse a directory that holds something."""
    if output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise InputError(f"{output}: exists already; choose another --output, or remove it")
    if not output.absolute().parent.is_dir():
        raise InputError(f"{output}: no directory {output.parent}; make it first")


def _waves_of(store: xr.Dataset, signals: Sequence[str]) -> Waves:
    """The signals by column, lazy, over axes and sample: those of several stators each by itself."""
    probes = [str(name) for name in store.data_vars if str(name).startswith(PROBE)]
    names = list(dict.fromkeys(signals)) or probes or list(USUAL)
    for name in names:
        check_signal(name, store)
    require_variables(store, [*names, _FORCE])
    found: Waves = {}
    for name in names:
        if "stator" not in store[name].dims:
            found[name] = store[name]
            continue
        each = {f"{name}_stator_{int(store['stator'][i])}": i for i in range(store.sizes["stator"])}
        for column, i in each.items() if len(each) > 1 else ((name, 0),):
            found[column] = store[name].isel(stator=i, drop=True)
    return found


def _rate(store: xr.Dataset, n_sample: int, rate: float | None) -> float:
    """The sampling rate, Hz: as given, or the lowest of those with which the cases are stored.

    InputError where the shortest record holds no window.
    """
    per_revolution = samples_per_revolution(store)
    if is_run_up(store):
        speeds, begins = (store[name].transpose(..., "revolution").values for name in ("speed", "time"))
        turned = np.isfinite(speeds).any(axis=-1)
        shortest = float((np.nanmax(begins[turned], axis=-1) - np.nanmin(begins[turned], axis=-1)).min())
    else:
        speeds = np.abs(store["spin_speed"].values)
        shortest = store.sizes["sample"] / per_revolution * 2.0 * math.pi / float(speeds.max())
    if rate is None:
        rate = float(f"{per_revolution * float(np.nanmin(speeds)) / (2.0 * math.pi):.3g}")
    check_rate(rate)
    if n_sample > int(shortest * rate):
        problem = f"{n_sample} samples at {rate:g} Hz take longer than the shortest record, {shortest:.3g} s"
        raise refusal(store, f"{problem}; use at most --samples {int(shortest * rate)}")
    return rate


def _reference(
    store: xr.Dataset, waves: Waves, is_done: NDArray[np.bool_], touches: NDArray[np.bool_]
) -> dict[str, float]:
    """Median rms of each signal, of the cases that touch, or of all where none does."""
    of = is_done & touches if (is_done & touches).any() else is_done
    rms = {n: rms_about_mean(w).transpose(*axes_of(store)).values.ravel() for n, w in waves.items()}
    return {name: float(np.median(values[of])) for name, values in rms.items()}


def _cases(store: xr.Dataset, waves: Waves) -> Iterator[tuple[int, xr.Dataset]]:
    """Each case, loaded, with its place in the grid; read block by block as they lie on the disk.

    The columns of `waves` take the place of the signals.
    """
    axes = axes_of(store)
    beside = [name for name in store.data_vars if "revolution" in store[name].dims]
    beside += [name for name in ("spin_speed",) if name in store and not is_run_up(store)]
    data = store[[*beside, _FORCE]].assign(waves)
    chunks = dict(zip(data[_FORCE].dims, data[_FORCE].chunks or (), strict=False))
    edges = [np.cumsum([0, *chunks.get(axis, (store.sizes[axis],))]).tolist() for axis in axes]
    shape = tuple(store.sizes[axis] for axis in axes)
    for corner in product(*(pairwise(ends) for ends in edges)):
        box = {axis: slice(*ends) for axis, ends in zip(axes, corner, strict=True)}
        block = data.isel(box).load()
        for index in product(*(range(*ends) for ends in corner)):
            within = {axis: i - ends[0] for axis, i, ends in zip(axes, index, corner, strict=True)}
            flat = int(np.ravel_multi_index(index, shape)) if axes else 0
            yield flat, block.isel(within)
