"""Machines under Coulomb's law, held to time stepping of all their degrees by another code."""

import math

import numpy as np
import pytest
from closed_form import simulate
from independent_contact import run
from trial_rig import STEEL

from rubhpc import Rig
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor, Unbalance
from rubhpc.rig.stators import Stator

SIGNALS = ("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral", "contact_force")
REVOLUTIONS = 10


def machine(seed):
    """Two or three bearings, one or two discs, overhung or between them, up to eight stators; and a case."""
    random = np.random.default_rng(seed)
    n = int(random.integers(6, 12))
    length, diameter = random.uniform(0.5, 1.2), random.uniform(0.014, 0.03)
    is_overhung = random.random() < 0.3
    far = n - 1 if is_overhung else n + 1
    node = n + 1 if is_overhung else int(random.integers(3, n))
    shape = {"diameter": random.uniform(0.1, 0.18), "thickness": random.uniform(0.01, 0.03)}
    disc = [Disc(node=node, density=7800.0, **shape)]
    unbalance = [
        Unbalance(node=node, mass=random.uniform(0.003, 0.015), radius=0.05, phase=random.uniform(-3, 3))
    ]
    nodes = [node]
    if random.random() < 0.4:
        other = int(random.choice([k for k in range(2, far) if k != node]))
        disc.append(Disc(node=other, diameter=random.uniform(0.08, 0.15), thickness=0.015, density=7800.0))
        unbalance.append(Unbalance(node=other, mass=0.004, radius=0.04, phase=random.uniform(-3, 3)))
        nodes = [other, node]
    stiff = 10 ** random.uniform(5.5, 7, 3)
    bearing = [
        Bearing(node=1, kyy=stiff[0], kzz=stiff[1], cyy=100.0, czz=60.0),
        Bearing(node=far, stiffness=stiff[2], damping=80.0),
    ]
    if random.random() < 0.4:
        middle = int(random.integers(2, far))
        bearing.append(Bearing(node=middle, stiffness=10 ** random.uniform(4.5, 5.5), damping=50.0))
    beta = 10 ** random.uniform(-6.5, -5) if random.random() < 0.5 else 0.0
    rotor = Rotor(
        shaft=(ShaftSection(length=length, outer_diameter=diameter, elements=n, **STEEL),),
        disc=tuple(disc),
        bearing=tuple(bearing),
        unbalance=tuple(unbalance),
        torsion=Torsion(fixed_node=1),
        damping=Damping(alpha=10 ** random.uniform(0.7, 1.8), beta=beta),
        gravity=9.81 if random.random() < 0.35 else 0.0,
    )
    count, first = int(random.choice([1, 2, 3, 5, 8])), random.uniform(0, 2 * math.pi)
    given = {
        "length": random.uniform(0.03, 0.06),
        "width": 0.006,
        "height": 0.004,
        "elements": int(random.integers(2, 5)),
        "youngs_modulus": 10 ** random.uniform(9.3, 10.6),
        "poissons_ratio": 0.35,
        "density": 1300.0,
        "damping": Damping(alpha=20.0, beta=1e-5),
    }
    ring = tuple(
        Stator(node=nodes[i % len(nodes)], angle=first + 2 * math.pi * i / count, **given)
        for i in range(count)
    )
    case = {
        "speed_ratio": random.uniform(0.6, 3) * random.choice([1, -1]),
        "clearance_ratio": random.uniform(0.4, 0.8),
        "friction": random.uniform(0.1, 0.6),
    }
    return Rig(name="trial", rotor=rotor, stator=ring), case


def distance(found, known, name):
    """Rms distance of a signal over its rms."""
    one, other = (np.atleast_2d(of) for of in (found, known))
    return math.sqrt(np.mean((one - other) ** 2) / np.mean(other**2)), name


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "static_ratio"), [(1, 1.0), (4, 1.0), (5, 1.0), (13, 1.0), (13, 1.4), (14, 1.5)]
)
def test_ten_revolutions_are_those_of_time_stepping(seed, static_ratio):
    """Stick, slip that turns and gravity; motions in which a disturbance grows a hundredfold at most."""
    rig, case = machine(seed)
    given = case | {
        "friction_law": "coulomb",
        "static_friction_ratio": static_ratio,
        "transient": 0,
        "revolutions": REVOLUTIONS,
        "keep": ("waveform",),
    }
    usual, whole = simulate(rig, **given), simulate(rig, **given, accuracy=1e-10)
    assert usual.stick_fraction.max() > 0.1
    assert usual.left_closed_form == 0
    assert usual.energy_residual < 1e-6
    case |= {"speed": usual.spin_speed, "clearance": usual.clearance, "samples_per_revolution": 256}
    coarse, known = (run(rig, given | case, step) for step in (0.5e-6, 0.1e-6))
    halved = max(distance(coarse[name], known[name], name) for name in SIGNALS)
    exact = max(distance(getattr(whole, name), known[name], name) for name in SIGNALS)
    found = max(distance(getattr(usual, name), known[name], name) for name in SIGNALS)
    print(f"halved {halved}, all modes {exact}, by default {found}")
    assert exact[0] < max(1e-4, halved[0])
    assert found[0] < 1e-3
    assert halved[0] < 1e-3
    assert whole.peak_contact_force == pytest.approx(known["peak_contact_force"], rel=1e-4)
    assert usual.peak_contact_force == pytest.approx(known["peak_contact_force"], rel=1e-3)
    assert whole.stick_fraction == pytest.approx(known["stick_fraction"], abs=1e-3)
