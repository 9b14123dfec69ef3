"""Cases of every gap, law and kind of machine, and their answers by `independent_contact`.

`python tests/support/contact_answers.py` makes `tests/data/contact_answers.npz` anew: some 20 minutes.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from independent_contact import solve
from overhung_pump import pump

from rubhpc import Bore, Carrier, LumpedStator, read_rig
from rubhpc.rig.reading import with_keys

DATA = Path(__file__).parent.parent / "data" / "contact_answers.npz"
SIGNALS = ("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral", "contact_force")
MEASURES = (
    "peak_contact_force",
    "contact_impulse",
    "friction_work",
    "contact_fraction",
    "stick_fraction",
)
PACKAGED = read_rig("mokhtar2017").with_geometry("linear")
BENT = with_keys(PACKAGED, {"stator.geometry": "second_order"})
SLOW_RIM = {"stator.radius": 0.004}  # m: sticks
CASING = {"mass": 2.0, "stiffness": 5e5, "inertia": 0.02, "torsional_stiffness": 2e4, "damping": 50.0}


def masses(count, **changed):
    """A ring of masses on springs about the disc's hub."""
    of = {"mass": 5e-3, "stiffness": 5e5, "damping": 5.0, "lateral_stiffness": 1e5, "lateral_damping": 1.0}
    of["radius"] = 0.01
    return replace(PACKAGED, stator=(LumpedStator(node=8, count=count, **(of | changed)),))


def beams(count, rig=BENT, carriers=(), **changed):
    """A ring of cantilevers."""
    return replace(rig, stator=(replace(rig.stator[0], count=count, **changed),), carrier=carriers)


def two_nodes():
    """A cantilever at the disc, one at the shaft."""
    (one,) = BENT.stator
    return replace(BENT, stator=(one, replace(one, node=5, radius=0.01, angle=2.5, clearance_offset=-2e-5)))


def bore(node=8, **given):
    """A round hole about the disc, or about its hub."""
    return replace(PACKAGED, stator=(Bore(node=node, **given),))


SPRUNG = {"mass": 1.5, "stiffness_y": 4e6, "stiffness_z": 2e6, "damping": 200.0}
UPDATED = {"normal": "updated"}
COULOMB = {"friction_law": "coulomb"}
STICK = COULOMB | {"static_friction_ratio": 1.3}
PENALTY = {"law": "penalty", "stiffness": 1e7}
HERTZ = {"law": "hertz", "stiffness": 1e9}
STRIBECK = {"friction_law": "stribeck", "static_friction_ratio": 1.5, "stribeck_speed": 0.1}
TABLE = {"friction_law": "table", "slip_speed": (0.0, 0.2, 1.0), "friction_ratio": (1.5, 1.1, 0.9)}
BASE = {"speed_ratio": 0.75, "clearance": 84e-6, "friction": 0.3, "revolutions": 3}
BASE |= {"normal": "fixed", "friction_law": "sliding"}
SLIM = with_keys(BENT, SLOW_RIM)
HIGH = {"friction": 0.5}
WEIGHT = {"rotor.gravity": 9.81}
# name: rig, arguments of `simulate` besides BASE
CASES = {
    "linear, sliding": (PACKAGED, {}),
    "linear, stick": (with_keys(PACKAGED, SLOW_RIM), STICK),
    "linear, penalty": (PACKAGED, PENALTY | {"damping": 100.0}),
    "linear, hertz": (PACKAGED, HERTZ),
    "updated, sliding": (PACKAGED, UPDATED),
    "bent, fixed": (BENT, {}),
    "bent, sliding": (BENT, UPDATED | {"revolutions": 6}),
    "bent, fast": (with_keys(BENT, {"stator.youngs_modulus": 30e9}), UPDATED | {"speed_ratio": 1.7}),
    "bent, coulomb": (BENT, UPDATED | COULOMB),
    "bent, coulomb, backward": (BENT, UPDATED | COULOMB | {"speed_ratio": -1.2}),
    "bent, fixed, stick": (SLIM, COULOMB | HIGH),
    "bent, stick": (SLIM, UPDATED | STICK | HIGH),
    "bent, stick at high speed": (
        with_keys(BENT, {"stator.radius": 0.001, "stator.youngs_modulus": 30e9}),
        UPDATED | COULOMB | HIGH | {"speed_ratio": 1.2},
    ),
    "bent, restitution": (BENT, UPDATED | {"restitution": 0.4}),
    "bent, restitution, stick": (SLIM, UPDATED | COULOMB | {"restitution": 0.4}),
    "updated, penalty": (PACKAGED, UPDATED | PENALTY),
    "bent, penalty, stick": (SLIM, UPDATED | PENALTY | COULOMB | {"damping": 100.0}),
    "updated, hertz": (PACKAGED, UPDATED | HERTZ | {"damping": 1.0}),
    "bent, hertz, stick": (SLIM, UPDATED | HERTZ | STICK | {"damping": 1.0}),
    "updated, stribeck": (with_keys(PACKAGED, SLOW_RIM), UPDATED | STRIBECK),
    "bent, stribeck": (BENT, UPDATED | STRIBECK | {"stribeck_speed": 3.0}),
    "bent, table": (SLIM, UPDATED | TABLE),
    "three masses, penalty": (masses(3), UPDATED | PENALTY | COULOMB),
    "four masses, hertz": (masses(4), UPDATED | HERTZ | COULOMB | {"damping": 1.0}),
    "four masses, restitution": (masses(4, mass=0.05), UPDATED | COULOMB | {"restitution": 0.5}),
    "four masses": (masses(4), UPDATED | COULOMB | {"clearance": 70e-6}),
    "four masses, stick": (
        masses(4, radius=0.004, lateral_stiffness=2e3, mass=1e-3),
        COULOMB | {"clearance": 70e-6},
    ),
    "eight masses": (masses(8), UPDATED | COULOMB | {"clearance": 70e-6, "revolutions": 2}),
    "four beams, stick": (beams(4, radius=0.004), UPDATED | COULOMB | {"clearance": 70e-6}),
    "eight beams": (beams(8), UPDATED | COULOMB | {"clearance": 90e-6, "friction": 0.15, "revolutions": 2}),
    "wall": (
        replace(PACKAGED, stator=(LumpedStator(node=8, rigid=True),)),
        UPDATED | COULOMB | {"restitution": 0.6},
    ),
    "overhung": (pump(), UPDATED | COULOMB | {"clearance": 30e-6, "speed": 300.0}),
    "gravity": (with_keys(BENT, WEIGHT | {"stator.angle": math.pi}), UPDATED | COULOMB),
    "carrier": (beams(4, PACKAGED, (Carrier(name="casing", **CASING),), carrier="casing"), UPDATED | COULOMB),
    "carrier, bent": (
        beams(4, carriers=(Carrier(name="casing", **CASING),), carrier="casing"),
        UPDATED | COULOMB,
    ),
    "two nodes": (two_nodes(), UPDATED | COULOMB),
    "bore": (bore(**SPRUNG), UPDATED | {"friction": 0.1}),
    "bore, coulomb": (bore(**SPRUNG, radius=2e-3), UPDATED | COULOMB),
    "bore, restitution": (bore(**SPRUNG), UPDATED | COULOMB | {"restitution": 0.4, "friction": 0.1}),
    "bore, penalty": (bore(**SPRUNG, radius=5e-3), UPDATED | PENALTY | COULOMB | {"damping": 100.0}),
    "bore, hertz, gravity": (
        with_keys(bore(rigid=True, radius=3e-3), WEIGHT | {"stator.clearance_offset": "-60 um"}),
        UPDATED | HERTZ | STICK | {"damping": 1.0},
    ),
}


def case_of(name):
    """Rig and arguments of `simulate`."""
    rig, given = CASES[name]
    case = BASE | {"samples_per_revolution": 64} | given
    if "speed" in given:
        del case["speed_ratio"]
    return rig, case


def answers():
    """Of every case, by name: samples, measures and the error of each."""
    with np.load(DATA) as stored:
        found = {name: {} for name in CASES}
        for key, value in stored.items():
            name, of = key.split(": ")
            found[name][of] = value
    return found


def shortened(values):
    """To 18 bits each, so that they pack well."""
    return ((values.astype(np.float32).view(np.uint32) + 32) & 0xFFFFFFC0).astype(np.uint32).view(np.float32)


def main(names):
    """Solve the cases named, or all, and store them."""
    found = {}
    if names:
        with np.load(DATA) as stored:
            found = {key: value for key, value in stored.items() if key.split(": ")[0] in CASES}
    for name in names or CASES:
        begun = time.perf_counter()
        rig, case = case_of(name)
        solved = solve(rig, case)
        worst = {of: solved["error"][of] for of in SIGNALS + MEASURES}
        for of in SIGNALS:
            found[f"{name}: {of}"] = shortened(solved[of])
        for of in MEASURES:
            found[f"{name}: {of}"] = solved[of]
        found[f"{name}: error"] = np.array(list(worst.values()))
        print(
            f"{name}: {time.perf_counter() - begun:.0f} s, error {max(worst.values()):.0e}, peak",
            *(f"{value:.5g}" for value in solved["peak_contact_force"]),
            "stick",
            *(f"{value:.3f}" for value in solved["stick_fraction"]),
            flush=True,
        )
    np.savez_compressed(DATA, **found)


if __name__ == "__main__":
    main(sys.argv[1:])
