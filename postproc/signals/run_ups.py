"""Run-ups: spectra over windows of a few revolutions, mean positions, and the spin over the time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.signals.spectra import WHIRL, check_signal, samples_per_revolution
from postproc.store.axes import find_axis, refusal
from postproc.store.run_ups import first_around, is_run_up
from postproc.store.select import narrow

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

FEWEST = 8  # revolutions in which a spectrum separates 1X and 1/2X
MEANS = 6  # revolutions, whole periods of 1/2X and 1/3X
_PREFIX = "revolution_"
_TORQUES = ("drive_work", "braking_torque")


def run_up_spectra(
    store: xr.Dataset, signal: str, window: int, count: int, at: float | None = None
) -> xr.Dataset:
    """Return amplitude spectra of a run-up at `count` places, each over `window` revolutions, loaded.

    A window is at most half of the run-up, but for one of less than twice `FEWEST` revolutions. Windows are
    Hann's: a line of a steady amplitude has its height, zero to peak. Those of the "whirl" are full spectra,
    as of `full_spectrum`. With a speed `at`, rad/s, there is the one spectrum around it, where it is first
    reached.

    Returns
    -------
    Dataset
        `amplitude` over (place, order) in the unit of the signal, `frequency` (Hz) likewise, and over `place`
        the mean `speed`, rad/s, and the `revolution` in the middle.

    Raises
    ------
    InputError
        It is no run-up of one case, has no more than `FEWEST` revolutions or no such signal.
    """
    is_full = signal == WHIRL
    data, per_revolution, n = _case(store, ["vertical", "horizontal"] if is_full else [signal])
    if n <= FEWEST:
        problem = f"this run-up has {n} revolutions, too few for spectra over its speed"
        raise refusal(store, f"{problem}; draw it with rubhpc waveform")
    window = min(window, max(n // 2, FEWEST))
    speed = data["speed"].values[:n]
    starts = np.unique(np.linspace(0, n - window, count).round().astype(int))
    if at is not None:
        starts = np.array([first_around(store, speed, window, at)])
    values = data["vertical"].values + 1j * data["horizontal"].values if is_full else data[signal].values
    n_sample = window * per_revolution
    shape = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(n_sample) + 0.5) / n_sample)
    rows, speeds = [], []
    for first in starts:
        part = values[first * per_revolution : (first + window) * per_revolution]
        part = (part - part.mean()) * (shape / shape.sum())
        rows.append(np.abs(np.fft.fftshift(np.fft.fft(part)) if is_full else 2.0 * np.fft.rfft(part)))
        speeds.append(window / np.sum(1.0 / speed[first : first + window]))
    order = (np.arange(rows[0].size) - (n_sample // 2 if is_full else 0)) / window
    about = data["vertical" if is_full else signal].attrs
    found = xr.Dataset(
        {"amplitude": (("place", "order"), np.array(rows), dict(about))},
        coords={name: at for name, at in data.coords.items() if at.ndim == 0}
        | {
            "order": ("order", order, {"units": "1", "long_name": "order of the spin frequency"}),
            "speed": ("place", np.array(speeds), {"units": "rad s-1", "long_name": "spin speed"}),
            "revolution": ("place", starts + 0.5 * window, {"units": "1", "long_name": "revolution"}),
            "frequency": (
                ("place", "order"),
                np.outer(speeds, order) / (2.0 * math.pi),
                {"units": "Hz", "long_name": "frequency"},
            ),
        },
    )
    if is_full:
        found["amplitude"].attrs["long_name"] = "whirl amplitude"
    return found


def mean_positions(store: xr.Dataset, signals: Sequence[str]) -> xr.Dataset:
    """Return the mean position during a run-up, with its `speed` (rad/s), loaded.

    It is the mean over six revolutions of means over six, one for each revolution: components at 1/2X and
    1/3X cancel, and whirl at any other order contributes little.
    """
    data, per_revolution, n = _case(store, signals)
    half = max(min(MEANS, n // 2), 1)
    width = min(half, n) * per_revolution
    count = n - 2 * half + 1 if n > 1 else 1

    def smooth(values: Floats) -> Floats:
        for _ in range(2 if n > 1 else 1):
            total = np.concatenate([[0.0], np.cumsum(values)])
            values = (total[width:] - total[:-width]) / width
        return values[::per_revolution][:count]

    means = {}
    for name in signals:
        rows = data[name].values.astype(float)[: n * per_revolution]
        means[name] = "revolution", smooth(rows - rows.mean()) + rows.mean(), data[name].attrs
    speed = data["speed"].values[:n]
    means["speed"] = "revolution", smooth(np.repeat(speed, per_revolution)), data["speed"].attrs
    return xr.Dataset(means, coords={name: at for name, at in data.coords.items() if at.ndim == 0})


def _case(store: xr.Dataset, signals: Sequence[str]) -> tuple[xr.Dataset, int, int]:
    """Signals and speed of one run-up, the samples in a revolution, and how many revolutions it has."""
    for signal in signals:
        check_signal(signal, store)
    if not is_run_up(store):
        raise refusal(store, "its speed is constant; give a run-up, as of a study with [run_up]")
    data = narrow(store, [*signals, "speed"]).load()
    n = int(np.isfinite(data["speed"].values).sum())
    if not n:
        raise refusal(store, "this run-up has no whole revolution; select another case")
    return data, samples_per_revolution(data), n


def spin_over_time(store: xr.Dataset, over: str | None = None) -> xr.Dataset:
    """Return the speed of every revolution, in its middle, and of a driven rotor the mean torques, loaded.

    Parameters
    ----------
    store : Dataset
        Of `rubhpc.run_up`, or a store of run-ups or driven rotors in which axes but `over` have been
        selected.

    Returns
    -------
    Dataset
        `time` (s) and `speed` (rad/s), and where a drive turns the rotor `driving_torque` and
        `braking_torque` (N m), over `revolution` and `over`; NaN beyond the last revolution of a case.

    Raises
    ------
    InputError
        The speed is constant, or several cases are left.
    """
    if not is_run_up(store):
        raise refusal(store, "its speeds are constant; give a store with [run_up] or [drive]")
    prefix = _PREFIX if _PREFIX + _TORQUES[1] in store else ""
    is_driven = prefix + _TORQUES[1] in store
    names = ["speed", "time", *([prefix + name for name in _TORQUES] if is_driven else [])]
    store = narrow(store, names, [find_axis(store, over)] if over else [])
    found = store.drop_vars(["order", "stator"], errors="ignore").load()
    shown = found[["speed"]]
    shown["time"] = found["time"] + math.pi / found["speed"]
    shown["time"].attrs |= {"units": "s", "long_name": "time, in the middle of the revolution"}
    if is_driven:
        shown["driving_torque"] = found[prefix + _TORQUES[0]] / (2.0 * math.pi)
        shown["driving_torque"].attrs |= {"units": "N m", "long_name": "mean torque of the drive"}
        shown["braking_torque"] = found[prefix + _TORQUES[1]]
    return shown
