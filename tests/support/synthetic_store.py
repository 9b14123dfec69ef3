"""A store by the schema, filled with sines instead of physics: known amplitudes at known orders."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from closed_form import read_rig

from rubhpc.schema import DIVERGED, DONE, FAILED, VARIABLES

SAMPLES, REVOLUTIONS = 32, 8
FIRST_LATERAL = 31.5596  # Hz
AXES = {
    "speed_ratio": ("speed_ratio", "1", (0.75, 1.0, 1.25, 1.5, 1.7)),
    "clearance": ("clearance", "m", (70e-6, 84e-6, 100e-6)),
    "friction": ("friction", "1", (0.1, 0.3)),
    "stator.youngs_modulus": ("stator_youngs_modulus", "Pa", (3e9, 30e9)),
}
NOT_DONE = {(0, 0, 0, 0): DIVERGED, (1, 0, 0, 0): FAILED, (2, 0, 0, 0): 0}
REGIMES = (1, 1, 2, 3, 0)  # by speed
AMPLITUDES = {0.5: 2e-5, 1.0: 1e-4, 2.0: 3e-5}  # of the vertical motion, m, by order
TORSION_PEAK = 4e-4  # rad, times the friction, at 2X


def make(keep: tuple[str, ...] = ("waveform", "spectrum", "section"), n_stator: int = 1) -> xr.Dataset:
    """Return the dataset of a whole study, in memory."""
    dims = tuple(dim for dim, _, _ in AXES.values())
    shape = tuple(len(values) for _, _, values in AXES.values())
    sizes = {
        "sample": SAMPLES * REVOLUTIONS,
        "order": SAMPLES * REVOLUTIONS // 2 + 1,
        "section": REVOLUTIONS,
        "stator": n_stator,
    }
    status = np.full(shape, DONE, dtype=np.int8)
    for index, code in NOT_DONE.items():
        status[index] = code
    speed, clearance, friction, modulus = (
        np.asarray(values).reshape([-1 if i == j else 1 for j in range(4)])
        for i, (_, _, values) in enumerate(AXES.values())
    )
    revolution = np.arange(sizes["sample"]) / SAMPLES
    turn = 2 * math.pi * revolution
    waves = {
        "vertical": sum(a * np.cos(o * turn) for o, a in AMPLITUDES.items()) + np.zeros((*shape, 1)),
        "horizontal": 1e-4 * np.sin(turn) + np.zeros((*shape, 1)),
        "torsion": (friction * TORSION_PEAK + 0 * (speed + clearance + modulus))[..., None]
        * np.sin(2 * turn),
        "contact_force": np.maximum(0, 20 * np.cos(turn) - 15) + np.zeros((*shape, 1)),
    }
    data: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}
    for name, variable in VARIABLES.items():
        attrs = {"units": variable.unit, "long_name": variable.long_name}
        if variable.role in ("waveform", "spectrum", "section", "state") and variable.role not in keep:
            continue
        extent = tuple(sizes[d] for d in variable.dims)
        signal = name.removeprefix("spectrum_").removeprefix("section_")
        wave = waves.get(signal, 1e-5 * np.cos(turn) + np.zeros((*shape, 1)))
        if variable.role == "waveform":
            values = wave
        elif variable.role == "spectrum":
            values = np.abs(np.fft.rfft(wave)) * 2 / sizes["sample"]
            values[..., [0, -1]] /= 2
        elif variable.role == "section":
            values = wave[..., ::SAMPLES]
        elif name == "status":
            data[name] = (dims, status, attrs)
            continue
        else:
            values = np.zeros((*shape, *extent)) + _scalar(name, speed, clearance, shape).reshape(
                *shape, *(1 for _ in extent)
            )
        if "stator" in variable.dims and variable.role in ("waveform", "spectrum"):
            values = np.repeat(values[..., None, :], n_stator, axis=-2)
        if variable.dtype.startswith("float") and variable.role != "setting":
            values = values.astype(variable.dtype)
            values[status != DONE] = np.nan
        data[name] = ((*dims, *variable.dims), values.astype(variable.dtype), attrs)
    data["spin_speed"] = (dims[:1], 2 * math.pi * FIRST_LATERAL * speed.ravel(), {"units": "rad s-1"})
    del data["clearance"]  # an axis of this study
    coords = {
        dim: (dim, np.array(values), {"units": unit, "long_name": name})
        for name, (dim, unit, values) in AXES.items()
    }
    coords |= {
        "revolution": ("sample", revolution, {"units": "1"}),
        "order": ("order", np.arange(sizes["order"]) / REVOLUTIONS, {"units": "1"}),
        "section": ("section", np.arange(REVOLUTIONS), {"units": "1"}),
        "stator": ("stator", np.arange(1, n_stator + 1), {"units": "1"}),
    }
    grid = {name: {"unit": unit, "values": list(values)} for name, (_, unit, values) in AXES.items()}
    study = {"title": "synthetic", "rig": "mokhtar2017", "grid": grid}  # as `Study.as_dict` has it
    attrs = {"title": "synthetic", "rig": read_rig("mokhtar2017").as_dict(), "study": study}
    return xr.Dataset(data, coords=coords, attrs=attrs)


def _scalar(name: str, speed: np.ndarray, clearance: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Peak force rises with the speed and falls with the gap; the faster half leaves the model's range."""
    full = np.zeros(shape)
    return {
        "peak_contact_force": full + 100 * speed / (clearance / 84e-6),
        "minimum_slip_speed": full + np.where(speed > 1.4, -0.5, 4.0),
        "force_over_euler_load": full + np.where(speed > 1.6, 1.2, 0.2),
        "tip_deflection_ratio": full + 0.02,
        "foreshortening_ratio": full + 0.05,
        "normal_angle": full + 0.005,
        "force_over_strength": full,
        "bearing_clearance_ratio": full,
        "peak_to_peak_vertical": full + 2.1e-4,
        "peak_to_peak_horizontal": full + 2e-4,
        "peak_torsion": full + 0.3 * TORSION_PEAK,
        "regime": full + np.array(REGIMES).reshape(-1, 1, 1, 1),
        "period": full + np.where(speed < 1, 2, np.where(speed < 1.4, 1, 0)),
    }.get(name, full + 1.0)


def write(path, dataset: xr.Dataset, chunk: tuple[int, ...] = (1, 1, 2, 1)) -> None:
    """Write it as a store: one chunk a block of cases for the long arrays, one chunk for each scalar."""
    n_axis = len(AXES)
    encoding = {
        name: {"chunks": (*chunk, *variable.shape[n_axis:])}
        for name, variable in dataset.data_vars.items()
        if VARIABLES[str(name)].role in ("waveform", "spectrum", "section")
    }
    dataset.to_zarr(path, zarr_format=3, consolidated=False, encoding=encoding)
