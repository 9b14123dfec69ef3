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
from rubhpc.rig.reading import with_keys
from rubhpc.rig.stators import Bore
from rubhpc.study.axis_reading import make_axis
from rubhpc.study.contact_keys import Contact

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rubhpc.identification.comparison import Comparison
    from rubhpc.rig.bearing_table import AnyBearing

_LEFT = 1e-3  # of the bearing's springs
_SAG = 0.3  # of the displacement that counts as divergence, at most under gravity
_CLEARANCE = (0.03, 10.0)  # over the largest deflection that was measured, or is due without contact
_WALL = (0.3, 30.0)  # stiffness of the wall over that of the bearing's springs
_AWAY = 1.0  # m, by which the stators stand off: they keep their bodies, which may be measured
_RADIUS = 0.01  # m, which matters to friction alone


def slack_bearings(machine: Machine, comparison: Comparison) -> Iterator[Rub]:
    """Yield a hypothesis for each bearing of the rotor on springs that stands on the ground.

    Open are the clearance, the stiffness of the wall, and the open keys of the rotor except those of its
    bearings, which are at their medians.
    """
    study, spin, file = machine.study, machine.channels.spin, "slack bearing"
    known = {axis.name: axis.values[0] for axis in study.axes if axis.name.startswith("rotor.")}
    rig = with_keys(study.rig, known)
    model = model_at(assemble(rig), spin)
    deflection = max(contact_free_amplitude(model, spin), machine.channels.deflection)
    # The equilibrium without the wall, where a march begins, has to be within what counts as divergence.
    least = model.rotor.total_mass * rig.rotor.gravity / (_SAG * rig.rotor.displacement_limit)
    own = [prior for prior in machine.priors if prior.name.startswith("rotor.")]
    own = [prior for prior in own if not prior.name.startswith("rotor.bearing.")]
    stators = [replace(one, clearance_offset=_AWAY) for one in rig.stator]
    stiffness_key = f"stator.{len(stators) + 1}.law.stiffness"
    bearings: tuple[AnyBearing, ...] = getattr(rig.rotor, "bearing", ())
    for i, bearing in enumerate(bearings):
        if not isinstance(bearing, Bearing) or bearing.pedestal is not None:
            continue
        (kyy, _), (_, kzz) = bearing.stiffness_matrix
        stiffness, node = math.sqrt(kyy * kzz), rig.rotor.node_of(bearing)
        if not stiffness:
            continue
        left = max(_LEFT * stiffness, least)
        loose = replace(bearing, stiffness=left, kyy=None, kzz=None, kyz=0.0, kzy=0.0)
        wall = Bore(node=node, rigid=True, radius=_RADIUS, law=NormalLaw(kind="penalty", stiffness=stiffness))
        changed: Any = (*bearings[:i], loose, *bearings[i + 1 :])
        # The bore is about the unloaded shaft: a loose shaft sags far.
        rotor = replace(rig.rotor, bearing=changed, clearance_from="unloaded")
        slack = replace(rig, rotor=rotor, stator=(*stators, wall))
        ranges = {"clearance": (deflection, _CLEARANCE), stiffness_key: (stiffness, _WALL)}
        opened = [
            read_prior(name, {"start": low * size, "stop": high * size, "scale": "log"}, slack, file)
            for name, (size, (low, high)) in ranges.items()
        ]
        priors = (*opened, *own)
        settings = {"speed": spin, "friction": 0.0, **{prior.name: prior.at(0.5) for prior in priors}}
        axes = tuple(make_axis(name, [value], slack, file) for name, value in settings.items())
        yield Rub(
            machine=Machine(
                study=replace(study, rig=slack, axes=axes, contact=Contact()),
                tables={"contact": {}, "integrator": {}, "initial": {}},
                channels=machine.channels,
                priors=priors,
            ),
            comparison=comparison,
            name=f"slack bearing at node {node}",
        )
