"""Some eighty short cases over all laws and machines, each with its laws named, and what is kept of each.

`python tests/golden/corpus.py` computes what `test_golden.py` compares with and writes `corpus.npz`.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from equal_stators import in_ring
from overhung_pump import SEGMENT, pump
from trial_rig import STEEL, trial_rig

import rubhpc
from rubhpc import Carrier, LumpedStator, Rig
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.reading import with_keys
from rubhpc.rig.rotors import Rotor

if TYPE_CHECKING:
    from collections.abc import Callable

    Arrays = dict[str, np.ndarray[Any, Any]]

STORED = Path(__file__).with_name("corpus.npz")
EARLY, PER_REVOLUTION = 6, 32  # revolutions and samples of the waveforms kept
SIGNALS = (
    "vertical",
    "horizontal",
    "torsion",
    "torsion_acceleration",
    "stator_axial",
    "stator_lateral",
    "contact_force",
)
MEASURES = (
    "contact_fraction",
    "stick_fraction",
    "reversals_per_revolution",
    "contacts_per_revolution",
    "peak_contact_force",
    "contact_impulse",
    "friction_work",
    "minimum_slip_speed",
    "carrier_displacement",
    "peak_torsion",
    "peak_to_peak_vertical",
    "peak_to_peak_horizontal",
    "energy_residual",
)
STABILITY = ("largest_multiplier", "lyapunov_exponent")  # of settled motions
LINEAR = {"geometry": "linear", "normal": "fixed", "friction_law": "sliding"}
COULOMB = LINEAR | {"friction_law": "coulomb"}
STATIC = COULOMB | {"static_friction_ratio": 1.3}
PENALTY = LINEAR | {"law": "penalty", "stiffness": "5e6 N/m", "damping": "400 N s/m"}
BOTH = PENALTY | {"friction_law": "coulomb"}
BOTH_STATIC = BOTH | {"static_friction_ratio": 1.3}
BOUNCING = LINEAR | {"restitution": 0.5}
BOUNCING_COULOMB = COULOMB | {"restitution": 0.5}
STRIBECK = LINEAR | {"friction_law": "stribeck", "static_friction_ratio": 1.3, "stribeck_speed": "0.2 m/s"}
TABLE = LINEAR | {"friction_law": "table", "slip_speed": [0.0, 1.0, 20.0], "friction_ratio": [1.2, 1.0, 0.8]}
UPDATED = LINEAR | {"normal": "updated"}
BENT = LINEAR | {"geometry": "second_order"}
BENT_UPDATED = UPDATED | {"geometry": "second_order"}
CENTRAL = LINEAR | {"method": "central-difference", "step": "2 us"}


@cache
def machine(name: str) -> Rig:
    """Return a rig of the corpus."""
    return _MACHINES[name]()


def _packaged(stiffness: float = 3e9) -> Rig:
    return with_keys(rubhpc.read_rig("mokhtar2017"), {"stator.youngs_modulus": stiffness})


def _ring(count: int, **body: Any) -> Rig:
    body = body or {"mass": 0.02, "stiffness": 2e6, "damping": 60.0, "lateral_stiffness": 1e6}
    stators = tuple(LumpedStator(node=8, angle=0.1 + 2 * np.pi * i / count, **body) for i in range(count))
    return replace(_packaged(), stator=stators)


def _carried() -> Rig:
    casing = Carrier(name="casing", mass=4.0, stiffness=5e6, damping=300.0)
    stators = tuple(
        LumpedStator(
            node=8, angle=a, carrier="casing", mass=0.05, stiffness=4e6, damping=50.0, lateral_stiffness=1e6
        )
        for a in (0.0, 2.5)
    )
    return replace(_packaged(), stator=stators, carrier=(casing,))


def _tabulated() -> Rig:
    speed = (50.0, 150.0, 300.0, 500.0)
    film = {
        "kyy": (9e6, 7e6, 6e6, 5.5e6),
        "kzz": (6e6, 5e6, 4.5e6, 4.2e6),
        "kyz": (1e6, 1.2e6, 1.3e6, 1.4e6),
        "kzy": (-0.6e6, -0.9e6, -1.1e6, -1.2e6),
        "cyy": (4000.0, 2500.0, 1800.0, 1500.0),
        "czz": (3500.0, 2300.0, 1700.0, 1400.0),
    }
    rotor = Rotor(
        shaft=(ShaftSection(length=1.0, outer_diameter=0.035, elements=8, **STEEL),),
        disc=(
            Disc(node=3, diameter=0.2, thickness=0.02, density=7850.0),
            Disc(node=7, diameter=0.2, thickness=0.02, density=7850.0),
        ),
        bearing=tuple(BearingTable(node=node, speed=speed, **film) for node in (1, 5, 9)),
        unbalance=pump().rotor.unbalance,
        torsion=Torsion(fixed_node=1),
        damping=Damping(alpha=5.0),
        gravity=9.81,
    )
    return Rig(name="tabulated", rotor=rotor, stator=(LumpedStator(node=3, angle=np.pi, **SEGMENT),))


def _lone(radius: float = 0.05, **wall: Any) -> Rig:
    stator = LumpedStator(node=1, angle=0.0, radius=radius, **(wall or {"rigid": True}))
    return Rig.from_matrices(
        np.diag([2.0, 2.0]), np.diag([20.0, 20.0]), np.diag([8e4, 8e4]), degrees=[(1, "v"), (1, "w")],
        stators=[stator], unbalance=[rubhpc.Unbalance(node=1, mass=0.004, radius=0.05)],
    )  # fmt: skip


_MACHINES: dict[str, Callable[[], Rig]] = {
    "packaged": _packaged,
    "stiff": lambda: _packaged(30e9),
    "heavy": lambda: with_keys(_packaged(), {"rotor.gravity": 9.81, "stator.angle": 2.6}),
    "pair": lambda: trial_rig(2, cross=5e4),
    "three": lambda: trial_rig(3),
    "ring of 8": lambda: _ring(8),
    "ring of 16": lambda: _ring(16),
    "walls": lambda: _ring(4, rigid=True),
    "carried": _carried,
    "tabulated": _tabulated,
    "lone": _lone,
    "lone, soft": lambda: _lone(mass=0.1, stiffness=1e6, damping=5.0, lateral_stiffness=2e5),
    "lone, slow rim": lambda: _lone(radius=0.004),
    "pump": pump,
    "pump in 8": lambda: in_ring(pump(), 8),
}


def _with_geometry(machine_name: str, law: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """The rig with the geometry of a law, and the other keys of the law."""
    rig = machine(machine_name).with_geometry(law["geometry"])
    return rig, {key: value for key, value in law.items() if key != "geometry"}


def _simulated(machine_name: str, law: dict[str, Any], **given: Any) -> Arrays:
    """Early waveforms and measures of a case from rest, or from where `given` says."""
    rig, law = _with_geometry(machine_name, law)
    options = {
        "transient": 0,
        "revolutions": 12,
        "samples_per_revolution": PER_REVOLUTION,
        "keep": ("waveform",),
    }
    record = rubhpc.simulate(rig, **law, **(options | given))
    n = EARLY * PER_REVOLUTION
    kept = {name: record.signals[name][..., 1:n:2] for name in SIGNALS}
    settled = ("period", "regime", *STABILITY) if given.get("transient") else ()
    return kept | _measures(record, *settled)


def _measures(record: Any, *further: str) -> Arrays:
    """Measures of a record; 0 where one is undefined."""
    return {name: np.nan_to_num(np.atleast_1d(record.measures[name])) for name in (*MEASURES, *further)}


def _settled(machine_name: str, law: dict[str, Any], **given: Any) -> Arrays:
    return _simulated(machine_name, law, **({"transient": 150, "revolutions": 48} | given))


def _run_up(machine_name: str, law: dict[str, Any], **given: Any) -> Arrays:
    """The course of a run-up, a coast-down or a drive: every fourth revolution, and samples."""
    rig, law = _with_geometry(machine_name, law)
    data = rubhpc.run_up(rig, **law, samples_per_revolution=PER_REVOLUTION, **given)
    one = data.sel(order=1.0) if "order" in data.dims else data
    amplitudes = tuple(f"amplitude_{name}" for name in ("vertical", "horizontal", "torsion"))
    names = ("speed", *amplitudes, "peak_contact_force", "friction_work")
    waveforms = {name: data[name].values[..., 1::24] for name in SIGNALS[:4]}
    return waveforms | {name: one[name].values[..., ::4] for name in names}


def _periodic(machine_name: str, law: dict[str, Any], **given: Any) -> Arrays:
    """A motion that is solved for, and its multipliers."""
    rig, law = _with_geometry(machine_name, law)
    motion = rubhpc.periodic(rig, **law, samples_per_revolution=PER_REVOLUTION, **given)
    largest, size = np.sort(np.abs(motion.multipliers))[::-1][:2], np.linalg.norm(motion.monodromy)
    signals = {name: motion.record.signals[name] for name in SIGNALS}
    return _measures(motion.record) | signals | {"multipliers": largest, "monodromy": size}


def _branch(machine_name: str, law: dict[str, Any], **given: Any) -> Arrays:
    """Events of a branch, and what it is at its ends."""
    rig, law = _with_geometry(machine_name, law)
    (curve, *_) = rubhpc.branch(rig, **law, samples_per_revolution=PER_REVOLUTION, doublings=0, **given)
    return {
        "events": np.array([value for _, value in curve.events()]),
        "reached": np.ravel(curve.values)[-1:],
    }


LOW, HIGH = {"speed_ratio": 0.75, "clearance": "84 um"}, {"speed_ratio": 1.7, "clearance": "120 um"}
# Of rigid walls no more: rounding grows by ten in two revolutions.
WALLS = HIGH | {"friction": 0.1, "revolutions": 6}
RUB, PUMP = {"friction": 0.3}, {"speed": "1500 rpm", "clearance": "60 um", "friction": 0.2}
FILM = {"speed": "2400 rpm", "clearance": "3 um", "friction": 0.15}
TWO = {"speed": 180.0, "clearance": "90 um", "friction": 0.2}
LONE = {"speed": 180.0, "clearance": "40 um", "friction": 0.2}
WIDE = {"speed_ratio": 0.75, "clearance": "100 um", "friction": 0.3}
# Multipliers by collocation err in the first order of the accuracy.
SOFT = {"speed_ratio": 1.1, "clearance": "100 um", "friction": 0.1, "accuracy": 1e-7}
STEPS = LOW | RUB | {"revolutions": 6}
TORUS = {"speed_ratio": 4.9, "clearance_ratio": 0.97, "friction": 0.2, "transient": 300}
PASSAGE = {"start": "1300 rpm", "stop": "2300 rpm", "time": "2 s", "clearance": "0.4 mm", "friction": 0.2}
FAST = {"start": "600 rpm", "stop": "4000 rpm", "time": "0.6 s", "clearance": "0.1 mm", "friction": 0.2}
FILM_UP = {"start": "1000 rpm", "stop": "3000 rpm", "time": "3 s", "clearance": "3 um", "friction": 0.1}
DOWN = {"start": "3000 rpm", "stop": "1500 rpm", "time": "2 s", "clearance": "60 um", "friction": 0.1}
TORQUE = {
    "drive": {"torque": "0.5 N m", "start": "1500 rpm", "revolutions": 60},
    "clearance": "0.2 mm",
    "friction": 0.2,
}
PUSH = {
    "drive": {"torque": "40 N m", "start": "900 rpm", "revolutions": 12},
    "clearance": "0.1 mm",
    "friction": 0.2,
}
ALONG = {"along": "clearance", "start": "100 um", "stop": "124 um", "speed_ratio": 0.75, "friction": 0.3}
KNOCK = {"from": "contact_free", "impulse": "0.2 N*s"}
CASES: dict[str, tuple[Callable[..., Arrays], str, dict[str, Any], dict[str, Any]]] = {
    "sliding, below": (_simulated, "packaged", LINEAR, LOW | RUB),
    "sliding, above": (_simulated, "stiff", LINEAR, HIGH | RUB),
    "sliding, reversed": (_simulated, "pair", LINEAR, TWO | {"speed": -180.0}),
    "sliding, two": (_simulated, "pair", LINEAR, TWO),
    "sliding, three": (_simulated, "three", LINEAR, {"speed": 230.0, "clearance": "70 um", "friction": 0.3}),
    "sliding, ring of 8": (_simulated, "ring of 8", LINEAR, HIGH | {"friction": 0.05}),
    "sliding, ring of 16": (_simulated, "ring of 16", LINEAR, HIGH | {"friction": 0.1}),
    "sliding, walls": (_simulated, "walls", LINEAR, WALLS),
    "sliding, carried": (_simulated, "carried", LINEAR, HIGH | RUB),
    "sliding, tabulated": (_simulated, "tabulated", LINEAR, FILM),
    "sliding, slow rim": (_simulated, "lone, slow rim", LINEAR, LONE),
    "sliding, lone": (_simulated, "lone", LINEAR, LONE),
    "sliding, gravity": (_simulated, "heavy", LINEAR, LOW | RUB),
    "sliding, pump": (_simulated, "pump", LINEAR, PUMP),
    "sliding, pump in 8": (_simulated, "pump in 8", LINEAR, PUMP),
    "sliding, knocked": (_simulated, "packaged", LINEAR, LOW | RUB | {"initial": KNOCK}),
    "sliding, fine": (_simulated, "packaged", LINEAR, LOW | RUB | {"accuracy": 1e-4}),
    "sliding, settled": (_settled, "packaged", LINEAR, WIDE),
    "sliding, direct": (_settled, "packaged", LINEAR, LOW | RUB | {"transient": "direct"}),
    "sliding, auto": (_settled, "stiff", LINEAR, HIGH | RUB | {"transient": "auto"}),
    "no contact": (_settled, "packaged", LINEAR, {"speed_ratio": 0.75, "clearance": "1 mm", "friction": 0.3}),
    "sliding, quasi-periodic": (_settled, "stiff", LINEAR, TORUS),
    "coulomb, below": (_simulated, "packaged", COULOMB, LOW | RUB),
    "coulomb, above": (_simulated, "stiff", COULOMB, HIGH | {"friction": 0.6}),
    "coulomb, two": (_simulated, "pair", COULOMB, TWO | {"friction": 0.4}),
    "coulomb, reversed": (_simulated, "pair", COULOMB, TWO | {"speed": -180.0, "friction": 0.4}),
    "coulomb, slow rim": (_simulated, "lone, slow rim", COULOMB, LONE | {"friction": 0.6}),
    "coulomb, lone, soft": (_simulated, "lone, soft", COULOMB, LONE | {"friction": 0.6}),
    "coulomb, lone": (_simulated, "lone", COULOMB, LONE | {"friction": 0.6}),
    "coulomb, ring of 8": (_simulated, "ring of 8", COULOMB, HIGH | RUB),
    "coulomb, ring of 16": (_simulated, "ring of 16", COULOMB, HIGH | {"friction": 0.1}),
    "coulomb, walls": (_simulated, "walls", COULOMB, WALLS | {"revolutions": 3}),
    "coulomb, carried": (_simulated, "carried", COULOMB, HIGH | RUB),
    "coulomb, tabulated": (_simulated, "tabulated", COULOMB, FILM),
    "coulomb, pump in 8": (_simulated, "pump in 8", COULOMB, PUMP),
    "coulomb, settled": (_settled, "packaged", COULOMB, LOW | RUB),
    "coulomb, quasi-periodic": (_settled, "stiff", COULOMB, TORUS),
    "static ratio": (_simulated, "stiff", STATIC, HIGH | {"friction": 0.6}),
    "static ratio, ring of 8": (_simulated, "ring of 8", STATIC, HIGH | RUB),
    "static ratio, penalty": (_simulated, "ring of 8", BOTH_STATIC, HIGH | RUB),
    "penalty, below": (_simulated, "packaged", PENALTY, LOW | RUB),
    "penalty, walls": (_simulated, "walls", PENALTY, WALLS),
    "penalty, ring of 8": (_simulated, "ring of 8", PENALTY, HIGH | {"friction": 0.05}),
    "penalty, tabulated": (_simulated, "tabulated", PENALTY, FILM),
    "penalty, settled": (_settled, "stiff", PENALTY, SOFT),
    "penalty and coulomb": (_simulated, "packaged", BOTH, LOW | {"friction": 0.5}),
    "penalty and coulomb, ring of 8": (_simulated, "ring of 8", BOTH, HIGH | RUB),
    "restitution, below": (_simulated, "packaged", BOUNCING, LOW | RUB),
    "restitution, walls": (_simulated, "walls", BOUNCING, WALLS),
    "restitution, lone": (_simulated, "lone", BOUNCING, LONE),
    "restitution and coulomb": (_simulated, "packaged", BOUNCING_COULOMB, LOW | RUB),
    "restitution and coulomb, lone": (_simulated, "lone", BOUNCING_COULOMB, LONE | {"friction": 0.4}),
    "stribeck": (_simulated, "packaged", STRIBECK, LOW | RUB),
    "table": (_simulated, "packaged", TABLE, LOW | RUB),
    "updated": (_simulated, "packaged", UPDATED, LOW | RUB),
    "updated, two": (_simulated, "pair", UPDATED, TWO),
    "updated, reversed": (_simulated, "pair", UPDATED, TWO | {"speed": -180.0}),
    "updated, coulomb": (_simulated, "packaged", UPDATED | {"friction_law": "coulomb"}, LOW | RUB),
    "bent": (_simulated, "packaged", BENT, LOW | RUB),
    "bent, updated": (_settled, "packaged", BENT_UPDATED, LOW | RUB),
    "bent, updated, gravity": (_simulated, "heavy", BENT_UPDATED, LOW | RUB),
    "central difference": (_simulated, "packaged", CENTRAL, STEPS),
    "central difference, coulomb": (_simulated, "packaged", CENTRAL | COULOMB, STEPS),
    "central difference, penalty": (_simulated, "packaged", CENTRAL | PENALTY, STEPS),
    "central difference, restitution": (_simulated, "packaged", CENTRAL | BOUNCING, STEPS),
    "central difference, updated": (_simulated, "heavy", CENTRAL | UPDATED, STEPS),
    "run-up": (_run_up, "packaged", LINEAR, PASSAGE),
    "run-up, coulomb": (_run_up, "packaged", COULOMB, PASSAGE),
    "run-up, penalty": (_run_up, "packaged", PENALTY, PASSAGE),
    "run-up, tabulated": (_run_up, "tabulated", LINEAR, FILM_UP),
    "run-up, pump": (_run_up, "pump", LINEAR, FAST),
    "run-up, pump, coulomb": (_run_up, "pump", COULOMB, FAST),
    "coast-down, ring of 8": (_run_up, "pump in 8", LINEAR, DOWN),
    "drive": (_run_up, "packaged", LINEAR, TORQUE),
    "drive, coulomb": (_run_up, "packaged", COULOMB, TORQUE),
    "drive, pump": (_run_up, "pump", LINEAR, PUSH),
    "periodic": (_periodic, "packaged", LINEAR, WIDE | {"period": 2}),
    "periodic, coulomb": (_periodic, "packaged", COULOMB, WIDE | {"period": 2}),
    "periodic, penalty": (_periodic, "stiff", PENALTY, SOFT),
    "branch": (_branch, "packaged", LINEAR, ALONG),
}  # fmt: skip


def compute(name: str) -> Arrays:
    """Return what is kept of a case, by name of the signal or measure."""
    kind, machine_name, law, given = CASES[name]
    return kind(machine_name, law, **given)


def stored() -> dict[str, Arrays]:
    """Return what was stored of every case, flattened: as many arrays take three times the room."""
    with np.load(STORED) as data:
        names, ends, values = data["names"].tolist(), np.cumsum(data["sizes"]), data["values"]
    cases: dict[str, Arrays] = {}
    for name, value in zip(names, np.split(values, ends[:-1]), strict=True):
        case, key = name.split("|")
        cases.setdefault(case, {})[key] = value
    return cases


if __name__ == "__main__":
    import time

    found = {}
    for name in CASES:
        began = time.process_time()
        found |= {f"{name}|{key}": np.ravel(value).astype(np.float32) for key, value in compute(name).items()}
        print(f"{time.process_time() - began:6.2f} s  {name}", flush=True)
    sizes, values = [value.size for value in found.values()], np.concatenate(list(found.values()))
    np.savez_compressed(STORED, names=np.array(list(found)), sizes=np.array(sizes), values=values)
