"""Stores as `jobs/paper` makes them, of known content instead of a simulation.

Contact forces are half sines at chosen places; torsion and the stator are linear oscillators that answer
them, solved over whole periods in the frequency domain; the disc moves along chosen lines of the spectrum.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from rubhpc.rig.reading import read_rig
from rubhpc.schema import DONE, VARIABLES

SAMPLES = 1024  # a revolution
TURNS = 12
LATERAL, TORSIONAL, STATOR = 31.5596, 128.047, 803.15  # Hz, of the packaged rig
TORSIONAL_STIFFNESS, RADIUS, AXIAL_STIFFNESS = 3125.88, 0.06, 1.875e6  # N m/rad, m, N/m at 3 GPa
LATERAL_STIFFNESS = 7300.0  # N/m of the stator's tip at 3 GPa
SOFT, MIDDLE, STIFF = 3e9, 15e9, 30e9
MICRO = 1e-6

Lines = dict[float, float]  # order: amplitude, m


@dataclass
class Motion:
    """What one case holds: contacts as (revolution, duration in s, peak in N) that repeat with the period."""

    rate: float  # Hz
    period: int
    contacts: list[tuple[float, float, float]]
    vertical: Lines
    horizontal: Lines
    mean: float = 0.0  # of the horizontal motion, m
    friction: float = 0.3
    modulus: float = SOFT
    torsional: float = TORSIONAL  # Hz, natural frequencies of what rings
    stator: float = STATOR


def oscillator(
    force: np.ndarray, step: float, frequency: float, ratio: float, stiffness: float
) -> np.ndarray:
    """Steady answer of a damped oscillator to a force that repeats with the record."""
    f = np.fft.rfftfreq(force.size, step) / frequency
    return np.fft.irfft(np.fft.rfft(force) / (stiffness * (1 - f**2 + 2j * ratio * f)), force.size)


def waves(motion: Motion, turns: int) -> dict[str, np.ndarray]:
    """Every recorded signal of a motion."""
    revolution = np.arange(turns * SAMPLES) / SAMPLES
    step = 1 / (motion.rate * SAMPLES)
    force = np.zeros(revolution.size)
    for start, duration, peak in motion.contacts:
        since = (revolution - start) % motion.period / motion.rate
        force += np.where(since < duration, peak * np.sin(np.pi * since / duration), 0.0)
    stiffening = motion.modulus / SOFT
    angle = 2 * np.pi * revolution
    torque = -motion.friction * RADIUS * force
    twist = oscillator(torque, step, motion.torsional, 0.02, TORSIONAL_STIFFNESS)
    speed = np.fft.rfftfreq(force.size, step) * 2 * np.pi
    tip = oscillator(
        motion.friction * force,
        step,
        motion.stator * math.sqrt(stiffening),
        0.05 * math.sqrt(stiffening),
        LATERAL_STIFFNESS * stiffening,
    )
    return {
        "vertical": sum(a * np.cos(o * angle) for o, a in motion.vertical.items()),
        "horizontal": sum(a * np.sin(o * angle) for o, a in motion.horizontal.items()) + motion.mean,
        "torsion": twist,
        "torsion_acceleration": np.fft.irfft(-(speed**2) * np.fft.rfft(twist), force.size),
        "stator_axial": force / (AXIAL_STIFFNESS * stiffening),
        "stator_lateral": tip,
        "contact_force": force,
    }


def scalars(motion: Motion) -> dict[str, float]:
    """The measures that a run would have taken."""
    per_revolution = len(motion.contacts) / motion.period
    duration = float(np.mean([c[1] for c in motion.contacts]))
    return {
        "status": DONE,
        "regime": 1,
        "period": motion.period,
        "contacts_per_revolution": per_revolution,
        "contact_duration": duration,
        "contact_fraction": per_revolution * duration * motion.rate,
        "peak_contact_force": max(c[2] for c in motion.contacts),
        "peak_to_peak_vertical": 2 * sum(motion.vertical.values()),
        "peak_torsion": 1e-4,
        "force_over_euler_load": max(c[2] for c in motion.contacts) / 241,
        "tip_deflection_ratio": 0.1,
        "minimum_slip_speed": -1.0,
    }


def store(
    axes: dict[str, list[float]], motions: list[Motion], turns: int = TURNS, **changes: float
) -> xr.Dataset:
    """Return the dataset of a study whose grid is `axes`, the last of which runs fastest over `motions`.

    `changes` hold for every motion.
    """
    motions = [replace(motion, **changes) for motion in motions]
    dims = [name.replace(".", "_") for name in axes]
    shape = tuple(map(len, axes.values()))
    assert math.prod(shape) == len(motions)
    found: dict[str, list[np.ndarray]] = {}
    for motion in motions:
        signals = waves(motion, turns)
        for name, value in (*signals.items(), *scalars(motion).items()):
            found.setdefault(name, []).append(np.asarray(value))
    data = {}
    for name, values in found.items():
        variable = VARIABLES[name]
        extent = (*shape, *(1 for d in variable.dims if d == "stator"), *values[0].shape)
        array = np.stack(values).reshape(extent).astype(variable.dtype)
        data[name] = (
            (*dims, *variable.dims),
            array,
            {"units": variable.unit, "long_name": variable.long_name},
        )
    rates = np.array([m.rate for m in motions]).reshape(shape)
    data["spin_speed"] = (dims, 2 * np.pi * rates, {"units": "rad s-1", "long_name": "spin speed"})
    settings = {"contact_free_amplitude": 174 * MICRO, "clearance": 85 * MICRO}
    data |= {n: ((), value, {"units": "m"}) for n, value in settings.items() if n not in axes}
    units = {"clearance": "m", "speed": "rad s-1", "stator.youngs_modulus": "Pa"}
    coords = {
        dim: (dim, np.array(values, dtype=float), {"units": units.get(name, "1")})
        for (name, values), dim in zip(axes.items(), dims, strict=True)
    }
    revolution = np.arange(turns * SAMPLES) / SAMPLES
    coords |= {
        "revolution": ("sample", revolution, {"units": "1"}),
        "stator": ("stator", [1], {"units": "1"}),
    }
    grid = {name: {"unit": units.get(name, "1"), "values": values} for name, values in axes.items()}
    study = {"title": "synthetic", "rig": "mokhtar2017", "grid": grid}
    return xr.Dataset(
        data, coords, {"title": "synthetic", "rig": read_rig("mokhtar2017").as_dict(), "study": study}
    )


def looping(period: int, size: float, narrow: float = 0.6) -> tuple[Lines, Lines]:
    """Lines of an orbit that whirls `period` times round its centre before it closes."""
    if period == 1:
        return {1: size}, {1: narrow * size}
    return {1: size, 1 / period: 0.4 * size}, {1: narrow * size, 1 / period: 0.4 * narrow * size}


def subcritical(**changes: float) -> xr.Dataset:
    """Two gaps, of period 1 and 2; three frictions; three moduli."""
    rate = 0.75 * LATERAL
    axes = {
        "clearance": [84e-6, 100e-6],
        "friction": [0.1, 0.3, 0.5],
        "stator.youngs_modulus": [SOFT, MIDDLE, STIFF],
    }
    motions = []
    for gap, friction, modulus in itertools.product(*axes.values()):
        harder = (modulus / SOFT) ** 0.5
        if gap > 90e-6:
            contacts = [(0.95, 3.6e-3 / harder, 19.7 * harder), (2.01, 3.2e-3 / harder, 10.6 * harder)]
            vertical = {1: 98 * MICRO, 0.5: 4.6 * MICRO, 1.5: 14.4 * MICRO, 2: 8.1 * MICRO}
            horizontal = {1: 122 * MICRO, 0.5: 1.4 * MICRO, 1.5: 4.3 * MICRO}
            period = 2
        else:
            contacts = [(0.95, 3.6e-3 / harder**0.8, 22.1 * harder)]
            vertical = {1: 83 * MICRO, 2: 13.9 * MICRO, 3: 4.1 * MICRO}
            horizontal, period = {1: 122 * MICRO, 2: 4.2 * MICRO}, 1
        motions.append(
            Motion(rate, period, contacts, vertical, horizontal, friction=friction, modulus=modulus)
        )
    return store(axes, motions, **changes)


def speed() -> xr.Dataset:
    """Forces that peak at r = 1.7, 3.5 and 5.3, once in one, two and three revolutions."""
    axes = {
        "speed_ratio": [round(0.9 + 0.1 * i, 1) for i in range(53)],
        "stator.youngs_modulus": [SOFT, STIFF],
    }
    motions = []
    for ratio, modulus in itertools.product(*axes.values()):
        period = 1 if ratio < 2.6 else 2 if ratio < 4.4 else 3
        near = math.exp(-(((ratio - (1.7, 3.5, 5.3)[period - 1]) / 0.2) ** 2))
        vertical, horizontal = looping(period, (100 + 600 * near) * MICRO)
        contacts = [(0.3, 1.3e-3, 200 + 2000 * near)]
        motions.append(Motion(ratio * LATERAL, period, contacts, vertical, horizontal, modulus=modulus))
    return store(axes, motions, turns=12)


def sixth_harmonic() -> xr.Dataset:
    """Three speeds, 6X below, at and above the torsional natural frequency."""
    rates, contacts = (20.0, 21.34, 22.0), ((3.9e-3, 15.8), (4.1e-3, 24.2), (4.2e-3, 27.1))
    motions = [
        Motion(rate, 1, [(0.95, *contact)], *looping(1, 60 * MICRO))
        for rate, contact in zip(rates, contacts, strict=True)
    ]
    return store({"speed": [2 * np.pi * rate for rate in rates]}, motions)


def friction(**changes: float) -> xr.Dataset:
    """At r = 3, one contact in two revolutions; sideways motion grows with friction."""
    frictions = [0.1, 0.3, 0.5]
    motions = []
    for mu in frictions:
        vertical = {0.5: 816 * MICRO, 1: 120 * MICRO}
        horizontal = {0.5: 820 * mu * MICRO, 1: 780 * mu * MICRO, 1.5: 36 * mu * MICRO}
        contacts = [(0.6, 4.4e-3, 576.0)]
        motions.append(Motion(3 * LATERAL, 2, contacts, vertical, horizontal, friction=mu))
    return store({"friction": frictions}, motions, **changes)


def clearance(**changes: float) -> xr.Dataset:
    """At r = 2 on the stiff stator, three gaps."""
    motions = [
        Motion(2 * LATERAL, 1, [(0.4, 1.15e-3, force)], {1: size * MICRO}, {1: 120 * MICRO}, mean * MICRO,
               modulus=STIFF)
        for force, size, mean in ((705, 277, -70), (494, 230, -48), (266, 183, -24))
    ]  # fmt: skip
    return store({"clearance": [70e-6, 90e-6, 110e-6]}, motions, **changes)


def resonance() -> xr.Dataset:
    """At r = 1.5, three moduli."""
    moduli = [SOFT, MIDDLE, STIFF]
    motions = [
        Motion(
            1.5 * LATERAL, 1, [(0.2, duration, force)], {1: size * MICRO}, {1: 130 * MICRO}, modulus=modulus
        )
        for modulus, duration, force, size in zip(
            moduli, (4.2e-3, 2.0e-3, 1.4e-3), (552, 813, 1039), (820, 490, 420), strict=True
        )
    ]
    return store({"stator.youngs_modulus": moduli}, motions)


def lateral_freedom() -> xr.Dataset:
    """Three speeds, the stator free to bend and held; orbits upright where it is held."""
    axes = {"speed_ratio": [0.75, 1.5, 3.0], "stator.1.lateral": [1.0, 0.0]}
    motions = [
        Motion(ratio * LATERAL, 1, [(0.2, 3e-3, 50)], {1: (300 - 100 * free) * MICRO}, {1: 150 * MICRO})
        for ratio, free in itertools.product(*axes.values())
    ]
    return store(axes, motions)


def penalty() -> xr.Dataset:
    """The smaller gap again, in six revolutions."""
    vertical = {1: 80 * MICRO, 2: 13 * MICRO, 1 / 6: 1 * MICRO}
    contacts = [(0.95, 0.6e-3, 239), (4.0, 0.6e-3, 200)]
    return store({"clearance": [84e-6]}, [Motion(0.75 * LATERAL, 6, contacts, vertical, {1: 122 * MICRO})])


def stores() -> dict[str, xr.Dataset]:
    """Every store of `jobs/paper`, by its study."""
    made = (subcritical, speed, sixth_harmonic, friction, clearance, resonance, lateral_freedom, penalty)
    return {make.__name__: make() for make in made}
