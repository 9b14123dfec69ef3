"""A small rig for tests of the modal scheme: bearings unlike in y and z, any number of stators."""

import math

from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rig import Rig
from rubhpc.rig.rotors import Rotor, Unbalance
from rubhpc.rig.stators import Stator

STEEL = {"youngs_modulus": 2.1e11, "shear_modulus": 8e10, "density": 7800.0}
ANGLES = (0.3, 1.1, -0.9)  # rad


def trial_rig(n_stator=1, *, cross=0.0, **changed):
    """`cross` (N/m) is the skew part of a bearing's stiffness; `changed` goes to every stator."""
    given = {
        "node": 3,
        "length": 0.04,
        "width": 0.005,
        "height": 0.005,
        "elements": 3,
        "youngs_modulus": 3e9,
        "poissons_ratio": 0.3,
        "density": 1157.0,
        "damping": Damping(beta=2e-5),
        "geometry": "linear",
    }
    return Rig(
        name="trial",
        rotor=Rotor(
            shaft=(ShaftSection(length=0.6, outer_diameter=0.018, elements=4, **STEEL),),
            disc=(Disc(node=3, diameter=0.12, thickness=0.025, density=7800.0),),
            bearing=(
                Bearing(node=1, kyy=1e6, kzz=7e5, kyz=cross, kzy=-cross, cyy=60.0, czz=90.0),
                Bearing(node=5, stiffness=9e5, damping=30.0),
            ),
            unbalance=(Unbalance(node=3, mass=0.008, radius=0.045, phase=0.2),),
            torsion=Torsion(fixed_node=1),
            damping=Damping(alpha=25.0),
        ),
        stator=tuple(Stator(angle=angle, **(given | changed)) for angle in ANGLES[:n_stator]),
    )


def turn(speed):
    """Time of a revolution, s."""
    return 2 * math.pi / abs(speed)
