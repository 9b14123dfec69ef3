"""Ways to spoil the synthetic stores, so that a claim on them becomes false."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np
import synthetic_paper
import xarray as xr
from synthetic_paper import MICRO, SOFT

Stores = dict[str, xr.Dataset]
Spoil = Callable[[Stores], Stores]


def changed(study: str, change: Callable[[xr.Dataset], xr.Dataset]) -> Spoil:
    """Change one store."""
    return lambda stores: stores | {study: change(stores[study])}


def remade(study: str, **changes: float) -> Spoil:
    """Make one store again, with other natural frequencies."""
    return changed(study, lambda _: getattr(synthetic_paper, study)(**changes))


def scaled(study: str, name: str, factor: float, **where: float) -> Spoil:
    """Multiply a variable, in the cases where axes have some values."""

    def change(store: xr.Dataset) -> xr.Dataset:
        chosen = xr.ones_like(store["status"], dtype=bool)
        for axis, value in where.items():
            chosen = chosen & (abs(store[axis] - value) <= 1e-6 * value)
        return store.assign({name: (store[name] * xr.where(chosen, factor, 1)).transpose(*store[name].dims)})

    return changed(study, change)


def level(study: str, name: str, axis: str) -> Spoil:
    """Let a variable have everywhere on an axis what it has first on it."""

    def change(store: xr.Dataset) -> xr.Dataset:
        return store.assign(
            {name: store[name].isel({axis: [0] * store.sizes[axis]}).assign_coords(store[axis].coords)}
        )

    return changed(study, change)


def without(study: str, name: str, *orders: float) -> Spoil:
    """Take lines out of a signal."""

    def change(store: xr.Dataset) -> xr.Dataset:
        lines = np.fft.rfft(store[name].values.astype(float))
        turns = store.sizes["sample"] // synthetic_paper.SAMPLES
        lines[..., [round(order * turns) for order in orders]] = 0
        return store.assign({name: store[name].copy(data=np.fft.irfft(lines).astype("float32"))})

    return changed(study, change)


def added(study: str, name: str, order: float, amplitude: float) -> Spoil:
    """Add a line to a signal."""
    return changed(
        study, lambda s: s.assign({name: s[name] + amplitude * np.cos(2 * np.pi * order * s["revolution"])})
    )


def pure(study: str, name: str, frequency: float) -> Spoil:
    """Put a sine of some frequency (Hz) in the place of a signal."""

    def change(store: xr.Dataset) -> xr.Dataset:
        time = 2 * np.pi * store["revolution"] / store["spin_speed"]
        wave = 1e-3 * np.sin(2 * np.pi * frequency * time)
        return store.assign({name: (wave + 0 * store[name]).transpose(*store[name].dims).astype("float32")})

    return changed(study, change)


def rig(key: str, value: float) -> Spoil:
    """Change the first shaft section, bearing or stator of the rig in the store of r = 0.75."""

    def change(store: xr.Dataset) -> xr.Dataset:
        attrs = copy.deepcopy(store.attrs)
        part, name = key.split(".")
        table = attrs["rig"]["stator"] if part == "stator" else attrs["rig"]["rotor"][part]
        table[0][name] = value
        return store.assign_attrs(attrs)

    return changed("subcritical", change)


HALVES = tuple(k / 2 for k in range(1, 80, 2))
SMALL, LARGE = {"clearance": 84e-6}, {"clearance": 100e-6}
MODULUS = "stator_youngs_modulus"

# claim: what makes it false, one at a time
SPOILED: dict[str, list[Spoil]] = {
    "C01": [rig("shaft.youngs_modulus", 200e9)],
    "C02": [rig("shaft.shear_modulus", 70e9)],
    "C03": [rig("stator.density", 1250.0)],
    "C04": [scaled("speed", "vertical", 20, speed_ratio=1.3), scaled("speed", "period", 2, speed_ratio=1.7)],
    "C05": [scaled("speed", "vertical", 20, speed_ratio=3.0), scaled("speed", "period", 3, speed_ratio=3.5)],
    "C06": [scaled("speed", "vertical", 20, speed_ratio=5.9), scaled("speed", "period", 2, speed_ratio=5.3)],
    "C10": [scaled("subcritical", "period", 2, **LARGE)],
    "C11": [without("subcritical", "vertical", order) for order in (0.5, 1.5, 2)],
    "C12": [without("subcritical", "horizontal", 1.5), added("subcritical", "horizontal", 0.5, 300 * MICRO)],
    "C13": [scaled("subcritical", "period", 2, **LARGE)],
    "C14": [without("subcritical", "torsion", 5.5)],
    "C16": [without("subcritical", "torsion", *HALVES), scaled("subcritical", "torsion", 10)],
    "C17": [level("subcritical", "contact_force", "clearance")],
    "C18": [scaled("subcritical", "contact_duration", 2)],
    "C19": [
        scaled("subcritical", "contacts_per_revolution", 2),
        changed("subcritical", lambda s: s.assign(contact_force=s["contact_force"] + 1)),
    ],
    "C20": [pure("subcritical", "torsion_acceleration", 128)],
    "C21": [remade("subcritical", stator=830)],
    "C22": [remade("subcritical", torsional=120)],
    "C23": [remade("subcritical", stator=830), pure("subcritical", "stator_lateral", 803)],
    "C24": [without("sixth_harmonic", "torsion", 6)],
    "C25": [
        scaled("sixth_harmonic", "torsion", 0.5, speed=2 * np.pi * 21.34),
        scaled("sixth_harmonic", "torsion", 1.5),
    ],
    "C30": [
        scaled("subcritical", "torsion", 1.1, friction=0.5),
        scaled("subcritical", "stator_lateral", 0.9, friction=0.3),
        level("subcritical", "torsion", "friction"),
    ],
    "C31": [
        scaled("friction", "vertical", 1.1, friction=0.5),
        level("friction", "torsion", "friction"),
        level("friction", "horizontal", "friction"),
    ],
    "C32": [without("friction", "horizontal", 0.5), without("friction", "horizontal", 1.5)],
    "C33": [remade("friction", torsional=100)],
    "C34": [without("friction", "horizontal", 1), scaled("friction", "period", 2)],
    "C40": [scaled("subcritical", "period", 2, **SMALL)],
    "C41": [scaled("subcritical", name, 0.7, **SMALL) for name in ("contact_force", "stator_axial")],
    "C44": [added("subcritical", "vertical", 0.5, 2 * MICRO), without("subcritical", "vertical", 3)],
    "C45": [without("subcritical", "torsion", 5), without("subcritical", "torsion", 6)],
    "C46": [
        remade("subcritical", torsional=120),
        remade("subcritical", stator=830),
        pure("subcritical", "stator_lateral", 803),
    ],
    "C50": [
        level("clearance", name, "clearance")
        for name in ("vertical", "torsion", "peak_contact_force", "stator_axial", "stator_lateral")
    ],
    "C51": [scaled("clearance", "horizontal", -1), scaled("clearance", "horizontal", 1.3, clearance=70e-6)],
    "C52": [without("clearance", "torsion", 2)],
    "C53": [remade("clearance", torsional=110)],
    "C60": [level("subcritical", "contact_duration", MODULUS)],
    "C61": [
        *(level("subcritical", n, MODULUS) for n in ("peak_contact_force", "stator_axial", "torsion")),
        scaled("subcritical", "vertical", 1.3, **{MODULUS: SOFT}),
    ],
    "C62": [level("resonance", "vertical", MODULUS), level("resonance", "stator_axial", MODULUS)],
    "C63": [level(study, "stator_lateral", MODULUS) for study in ("subcritical", "resonance")],
    "C70": [without("speed", "torsion", order) for order in (1, 2, 3)],
    "C71": [scaled("speed", "torsion", 20, speed_ratio=r) for r in (1.3, 2.9, 5.9)],
    "C72": [without("speed", "torsion", order) for order in (1 / 3, 1.5)],
    "C73": [scaled("subcritical", "period", 2, **SMALL), scaled("subcritical", "period", 2, **LARGE)],
}  # fmt: skip
