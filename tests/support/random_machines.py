"""Machines drawn at random: bearings, discs, stators, laws and probes of every kind, and a case of each."""

from dataclasses import replace
from typing import Any

import numpy as np
from equal_stators import in_ring
from random_rigs import PACKAGED

from rubhpc.rig.reading import with_keys
from rubhpc.rig.rig import Rig
from rubhpc.rig.stators import LumpedStator

LAWS = {
    "sliding": {},
    "coulomb": {"friction_law": "coulomb"},
    "penalty": {"law": "penalty"},
    "restitution": {},
    "updated": {"normal": "updated"},
    "bent": {"normal": "updated"},
    "coulomb penalty": {"friction_law": "coulomb", "law": "penalty"},
    "coulomb restitution": {"friction_law": "coulomb"},
}
DISC, OVERHUNG = 8, 13  # nodes


def random_machine(seed: int) -> tuple[Rig, dict[str, Any]]:
    """One to eight stators on the disc, an overhung disc or the shaft, and the arguments of `simulate`.

    Of them `probes` see displacements, forces, velocities and accelerations of shaft, bearings and stator.
    """
    random = np.random.default_rng(seed)
    law = list(LAWS)[random.integers(len(LAWS))]
    place = random.choice(["disc", "shaft", "overhung"], p=[0.4, 0.4, 0.2])
    node = {"disc": DISC, "overhung": OVERHUNG}.get(place) or int(random.choice([3, 5, 6, 7, 9, 10, 12]))
    rotor, far = PACKAGED.rotor, 15
    if random.random() < 0.35:
        first, middle = rotor.bearing[0], int(random.choice([4, 11]))
        softer = replace(first, node=middle, stiffness=10 ** random.uniform(4.5, 5.7))
        rotor = replace(rotor, bearing=(*rotor.bearing, softer))
    if place == "overhung":
        left, right, *others = rotor.bearing
        far = 9
        rotor = replace(
            rotor,
            bearing=(left, replace(right, node=far), *others),
            disc=(replace(rotor.disc[0], node=node),),
            unbalance=(replace(rotor.unbalance[0], node=node),),
        )
    gravity = 9.81 if random.random() < 0.3 else 0.0
    radius = float(random.choice([0.01, 0.03])) if place == "shaft" else 0.06
    kind: Any = replace(
        PACKAGED.stator[0],
        node=node,
        radius=radius,
        youngs_modulus=10 ** random.uniform(9.0, 10.7),
        length=random.uniform(0.025, 0.07),
        geometry="second_order" if law == "bent" else "linear",
    )
    if law != "bent" and random.random() < 0.2:
        mass, stiffness = 10 ** random.uniform(-3.0, -2.0), 10 ** random.uniform(5.0, 6.5)
        kind = LumpedStator(node=node, radius=radius, mass=mass, stiffness=stiffness, damping=5.0)
    n_most = 2 if "normal" in LAWS[law] else 8
    n_stator = int(random.choice([n for n in (1, 1, 2, 3, 5, 8) if n <= n_most]))
    rig = in_ring(replace(PACKAGED, rotor=replace(rotor, gravity=gravity), stator=(kind,)), n_stator)
    damping = {"rotor.damping.alpha": 10 ** random.uniform(0.5, 1.6)}
    if random.random() < 0.4:
        damping["rotor.damping.beta"] = 10 ** random.uniform(-6.0, -4.5)
    case = LAWS[law] | {
        "speed_ratio": random.uniform(0.6, 3.0),
        "friction": random.uniform(0.05, 0.4 if n_stator <= 3 else 0.2),
        "probes": [
            {"name": "displacement", "node": 1, "angle": "30 deg"},
            {"name": "bearing", "node": 1, "quantity": "bearing_force"},
            {"name": "foundation", "stator": 1, "quantity": "foundation_force"},
            {"name": "velocity", "node": node, "quantity": "velocity", "angle": "90 deg"},
            {"name": "acceleration_far", "node": far, "quantity": "acceleration"},
            {"name": "acceleration_there", "node": node, "quantity": "acceleration"},
            {"name": "acceleration_twist", "node": 11, "quantity": "twist_acceleration"},
        ],
    }
    if "penalty" in law:
        case |= {"stiffness": 10 ** random.uniform(5.5, 8.0), "damping": float(random.choice([0.0, 50.0]))}
    if "restitution" in law:
        case |= {"restitution": random.uniform(0.2, 0.8)}
    return with_keys(rig, damping), case
