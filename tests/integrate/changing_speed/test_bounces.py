"""Bounces that come to rest while the modes of a rotor follow its speed."""

import numpy as np
from closed_form import run_up
from trial_rig import STEEL

from rubhpc import LumpedStator, Rig, Unbalance
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor

END = {"kyy": 1e7, "kzz": 9e6, "cyy": 1e3, "czz": 1e3}


def test_bounces_come_to_rest_at_the_default_accuracy():
    """What is lost as a flight enters its mode does not sustain bounces."""
    rotor = Rotor(
        shaft=(ShaftSection(length=0.52, outer_diameter=0.0248, elements=2, **STEEL),),
        disc=(Disc(node=2, diameter=0.158, thickness=0.0268, density=7850.0),),
        bearing=(
            Bearing(node=1, kyz=4.4e5, kzy=-2.6e5, **END),
            Bearing(node=3, kyz=9.6e5, kzy=-6.7e5, **END),
        ),
        unbalance=(Unbalance(node=2, mass=0.01, radius=0.0236, phase=-2.45),),
        torsion=Torsion(fixed_node=1),
        damping=Damping(alpha=10.7, beta=1.25e-5),
        gravity=9.81,
    )
    stator = LumpedStator(
        node=2,
        angle=1.8,
        mass=0.052,
        stiffness=2.12e6,
        damping=60.0,
        lateral_stiffness=5e5,
        lateral_damping=30.0,
    )
    rough, fine = (
        run_up(
            Rig(name="bouncing", rotor=rotor, stator=(stator,)),
            start=651.0,
            stop=525.0,
            time=0.11,
            clearance=1.19e-4,
            friction=0.25,
            restitution=0.54,
            initial={"from": "rest"},
            samples_per_revolution=64,
            **accuracy,
        )
        for accuracy in ({}, {"accuracy": 1e-5})
    )
    assert fine.contact_fraction.max() > 0.2
    assert np.abs(rough.contact_fraction - fine.contact_fraction).max() < 5e-3
    assert np.abs(rough.vertical - fine.vertical).max() < 2e-3 * np.abs(fine.vertical).max()
