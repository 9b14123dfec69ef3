"""Files of a data logger: analytic signals of a turning shaft, in every format that is read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

SPEED = 47.3  # Hz
FULL_SCALE = 250.0  # of a WAV file: um and V of its channels alike
LINES = {1: (100e-6, -0.5), 2: (20e-6, 0.0)}  # order: amplitude (m) and phase of the vertical motion
SPEED_TABLE = {"column": "kp", "level": 2.5}
SIGNALS = {"vertical": {"column": "y", "unit": "um"}, "horizontal": {"column": "z", "unit": "um"}}
TIME = {"column": "t"}


def steady(duration=1.0, rate=12800.0, half=40e-6, noise=0.5e-6):
    """Columns t (s), y and z (um), kp (V) at a constant speed; `half` is the amplitude of 1/2X."""
    t = np.arange(int(duration * rate)) / rate
    angle = 2 * np.pi * SPEED * t + 0.7
    rng = np.random.default_rng(1)
    y = sum(a * np.cos(order * angle + phase) for order, (a, phase) in LINES.items())
    y = y + half * np.cos(angle / 2 + 0.3)
    z = 90e-6 * np.sin(angle - 0.5) - half * np.sin(angle / 2 + 0.3)
    y, z = ((x + noise * rng.standard_normal(t.size)) * 1e6 for x in (y, z))
    return {"t": t, "y": y, "z": z, "kp": pulses(angle)}


def run_up(duration=8.0, rate=6400.0, run_out=0.0):
    """The same while the speed rises from 10 to 50 Hz through a resonance at 30 Hz; and the true 1X of y."""
    t = np.arange(int(duration * rate)) / rate
    angle = 2 * np.pi * (10 * t + 20 * t**2 / duration)
    ratio = (10 + 40 * t / duration) / 30
    vector = 50e-6 * ratio**2 / (1 - ratio**2 + 0.1j * ratio)
    y = np.real(vector * np.exp(1j * angle)) + run_out * np.cos(angle + 1.0)
    z = np.real(-1j * vector * np.exp(1j * angle)) + run_out * np.sin(angle + 1.0)
    return {"t": t, "y": 1e6 * y, "z": 1e6 * z, "kp": pulses(angle)}, (t, vector)


def pulses(angle):
    return np.where(angle % (2 * np.pi) < 0.2, 5.0, 0.0)


def write(path: Path, columns, full_scale=FULL_SCALE) -> Path:
    """Write columns by the extension; WAV without the time, at full scale."""
    kind, table = path.suffix, np.column_stack(list(columns.values()))
    if kind == ".csv":
        np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    elif kind == ".parquet":
        import pandas

        pandas.DataFrame(columns).to_parquet(path)
    elif kind in (".h5", ".hdf5"):
        import h5py

        with h5py.File(path, "w") as file:
            for name, values in columns.items():
                file[name] = values
    elif kind == ".mat":
        from scipy.io import savemat

        savemat(path, dict(columns))
    elif kind == ".uff":
        path.write_text(
            "".join(_data_set_58(name, x, columns["t"]) for name, x in columns.items() if name != "t")
        )
    else:
        from scipy.io import wavfile

        rate = round(1.0 / (columns["t"][1] - columns["t"][0]))
        volts = np.column_stack([columns["y"], columns["z"], columns["kp"]]) / full_scale
        wavfile.write(path, rate, np.rint(volts * (2**31 - 1)).astype(np.int32))
    return path


def _data_set_58(name, values, time):
    """A time response of the Universal File Format as text, by its definition, in double precision."""
    step = time[1] - time[0]
    axes = (f"{kind:10d}    0    0    0 {label:>20s} {unit:>20s}" for kind, label, unit in AXES_58)
    rows = (values[i : i + 4] for i in range(0, values.size, 4))
    lines = [
        "    -1",
        "    58",
        *(name, "NONE", "NONE", "NONE", "NONE"),
        "    1         0    0         0       NONE         1   3       NONE         1   3",
        f"{4:10d}{values.size:10d}{1:10d}{0.0:13.5e}{step:13.5e}{0.0:13.5e}",
        *axes,
        *("".join(f"{x:20.12e}" for x in row) for row in rows),
        "    -1",
    ]
    return "\n".join(lines) + "\n"


AXES_58 = ((17, "Time", "s"), (8, "y", "um"), (0, "NONE", "NONE"), (0, "NONE", "NONE"))
