"""An overhung pump with one segment of its wear ring."""

from trial_rig import STEEL

from rubhpc import LumpedStator, Rig, Unbalance
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor

SEGMENT = {"mass": 0.3, "stiffness": 1e6, "damping": 300.0}


def pump():
    """An impeller beyond the second of two bearings, under gravity, and a wear ring below it."""
    rotor = Rotor(
        shaft=(ShaftSection(length=0.5, outer_diameter=0.03, elements=5, **STEEL),),
        disc=(Disc(node=6, diameter=0.18, thickness=0.03, density=7850.0),),
        bearing=(
            Bearing(node=1, stiffness=2e7, damping=400.0),
            Bearing(node=4, kyy=2e7, kzz=1e7, kyz=2e6, kzy=-2e6, cyy=900.0, czz=700.0),
        ),
        unbalance=(Unbalance(node=6, mass=0.01, radius=0.06, phase=1.0),),
        torsion=Torsion(fixed_node=1),
        damping=Damping(alpha=10.0, beta=1e-5),
        gravity=9.81,
    )
    return Rig(name="pump", rotor=rotor, stator=(LumpedStator(node=6, angle=2.9, **SEGMENT),))
