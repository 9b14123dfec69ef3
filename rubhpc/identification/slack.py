"""Slack bearings as what may be behind a measurement: a bore takes the place of a bearing's springs.

The journal is free within the clearance, but for a thousandth of the bearing's springs, which centres it, and
for the bearing's dampers. Beyond, the wall has the bearing's stiffness, and no friction, since the inner ring
turns with the shaft. The rotor touches no stator.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.response import contact_free_amplitude
from rubhpc.identification.candidates import Machine, Rub
from rubhpc.identification.priors import read_prior
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.rig.parts import Bearing
from rubhpc.rig.stators import Bore
from rubhpc.study.axis_reading import make_axis
from rubhpc.study.contact_keys import Contact

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rubhpc.identification.comparison import Comparison
    from rubhpc.rig.bearing_table import AnyBearing

_LEFT = 1e-3  # of the bearing's springs
_CLEARANCE = (0.03, 3.0)  # over the largest deflection that was measured, or is due without contact
_RADIUS = 0.01  # m, which matters to friction alone


def slack_bearings(machine: Machine, comparison: Comparison) -> Iterator[Rub]:
    """Yield a hypothesis for each bearing of the rotor on springs that stands on the ground."""
    rig, file = machine.study.rig, "slack bearing"
    spin = machine.channels.spin
    deflection = contact_free_amplitude(model_at(assemble(rig), spin), spin)
    bearings: tuple[AnyBearing, ...] = getattr(rig.rotor, "bearing", ())
    for i, bearing in enumerate(bearings):
        if not isinstance(bearing, Bearing) or bearing.pedestal is not None:
            continue
        (kyy, _), (_, kzz) = bearing.stiffness_matrix
        stiffness, node = math.sqrt(kyy * kzz), bearing.node
        if not stiffness or node is None:
            continue
        (cyy, cyz), (czy, czz) = bearing.damping_matrix
        loose = Bearing(node=node, kyy=_LEFT * kyy, kzz=_LEFT * kzz, cyy=cyy, cyz=cyz, czy=czy, czz=czz)
        wall = Bore(node=node, rigid=True, radius=_RADIUS, law=NormalLaw(kind="penalty", stiffness=stiffness))
        changed: Any = (*bearings[:i], loose, *bearings[i + 1 :])
        rotor = replace(rig.rotor, bearing=changed)
        slack = replace(rig, rotor=rotor, stator=(wall,))
        low, high = (share * deflection for share in _CLEARANCE)
        own = tuple(prior for prior in machine.priors if prior.name.startswith("rotor."))
        clearance = {"start": low, "stop": high, "scale": "log"}
        priors = (read_prior("clearance", clearance, slack, file), *own)
        settings = {
            "speed": spin,
            "friction": 0.0,
            "clearance": math.sqrt(low * high),
            **{prior.name: prior.at(0.5) for prior in own},
        }
        axes = tuple(make_axis(name, [value], slack, file) for name, value in settings.items())
        yield Rub(
            machine=Machine(
                study=replace(machine.study, rig=slack, axes=axes, contact=Contact()),
                tables={"contact": {}, "integrator": {}, "initial": {}},
                channels=machine.channels,
                priors=priors,
            ),
            comparison=comparison,
            name=f"slack bearing at node {node}",
        )
