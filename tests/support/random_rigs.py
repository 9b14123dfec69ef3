"""Rigs drawn at random: the packaged shaft with beams or masses anywhere along it, and a case of each."""

import math
from dataclasses import replace

import numpy as np
from closed_form import read_rig

from rubhpc.rig.reading import with_keys
from rubhpc.rig.rig import Rig
from rubhpc.rig.stators import LumpedStator

SIGNALS = (
    "vertical",
    "horizontal",
    "torsion",
    "torsion_acceleration",
    "stator_axial",
    "stator_lateral",
    "contact_force",
)
PACKAGED = read_rig("mokhtar2017")


def random_rig(seed: int) -> tuple[Rig, dict[str, float]]:
    """One or three stators on a node, beams of 1 to 50 GPa or masses of 1 g to 1 kg; speed and clearance."""
    random = np.random.default_rng(seed)
    angles = [2 * math.pi * i / n for n in [random.choice([1, 1, 3])] for i in range(n)]
    node, radius = int(random.integers(3, 14)), float(random.choice([0.01, 0.03, 0.06]))
    if random.random() < 0.3:
        mass, stiffness = 10 ** random.uniform(-3, 0), 10 ** random.uniform(5, 6.5)
        kind = LumpedStator(node=node, radius=radius, mass=mass, stiffness=stiffness)
    else:
        modulus = 10 ** random.uniform(9, 10.7)
        kind = replace(PACKAGED.stator[0], node=node, radius=radius, youngs_modulus=modulus)
    rig = replace(PACKAGED, stator=tuple(replace(kind, angle=angle) for angle in angles))
    rig = with_keys(rig, {"rotor.damping.alpha": 10 ** random.uniform(0.5, 1.8)})
    return rig, {"speed_ratio": random.uniform(0.6, 4.0), "clearance_ratio": random.uniform(0.5, 0.9)}


def found_error(record, exact) -> float:
    """Largest rms difference of a signal, as a share of its rms."""
    pairs = [(getattr(record, name), getattr(exact, name)) for name in SIGNALS]
    return max(math.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)) for a, b in pairs if np.any(b))
