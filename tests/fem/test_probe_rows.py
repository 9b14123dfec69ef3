"""What probes see of a model: directions, static forces, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.model import Model
from rubhpc.fem.probes import with_probes
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.carriers import Carrier
from rubhpc.rig.parts import Bearing
from rubhpc.rig.probes import Probe
from rubhpc.rig.stators import LumpedStator

SPIN = 150.0


def seen(rig, *probes) -> Model:
    return with_probes(assemble(rig), rig, probes, SPIN)


def test_a_probe_at_an_angle_sees_its_share_of_both_directions():
    rig = trial_rig()
    model = seen(rig, Probe(name="left", node=2, angle=-math.pi / 4), Probe(name="up", node=2))
    v, w = (model.rotor.index(2, name) for name in ("v", "w"))
    motion = np.zeros(model.body_start[-1])
    motion[v], motion[w] = 3e-6, 1e-6
    assert model.probe_rows[0] @ motion == pytest.approx([(3e-6 - 1e-6) / math.sqrt(2), 3e-6])
    assert not model.probe_rows[1:].any()


@pytest.mark.parametrize(
    ("quantity", "place"),
    [("velocity", 1), ("acceleration", 2), ("twist_rate", 1), ("twist_acceleration", 2)],
)
def test_a_quantity_reads_the_motion_of_its_derivative(quantity, place):
    rows = seen(trial_rig(), Probe(name="a", node=4, quantity=quantity)).probe_rows
    assert [bool(part.any()) for part in rows] == [i == place for i in range(3)]


def test_a_tip_moves_along_and_across_its_stator():
    rig = trial_rig(2)
    angle = rig.stator[1].angle
    model = seen(rig, Probe(name="along", stator=2, angle=angle), Probe(name="up", stator=2))
    stator, first = model.stators[1], model.stator_start[1]
    motion = np.zeros(model.body_start[-1])
    motion[first + stator.axial], motion[first + stator.lateral] = 2.0, 5.0
    along, across = (
        np.array([math.cos(angle), math.sin(angle)]),
        np.array([-math.sin(angle), math.cos(angle)]),
    )
    assert model.probe_rows[0] @ motion == pytest.approx([2.0, (2.0 * along + 5.0 * across)[0]])


def test_bearings_carry_the_weight():
    """Three bearings, one with coefficients over the speed: together they bear the rotor."""
    rig = trial_rig()
    table = BearingTable(node=3, speed=(0.0, 400.0), stiffness=(2e5, 6e5), damping=(50.0, 20.0))
    rotor = replace(rig.rotor, gravity=9.81, bearing=(*rig.rotor.bearing, table))
    rig = replace(rig, rotor=rotor)
    nodes = (1, 3, 5)
    probes = [Probe(name=f"b{node}", node=node, quantity="bearing_force") for node in nodes]
    model = with_probes(model_at(assemble(rig), SPIN), rig, probes, SPIN)
    up = np.array([float(name == "v") for _, name in model.rotor.degrees])
    weight = 9.81 * up @ model.rotor.mass @ up
    assert model.probe is not None
    assert model.probe.constant.sum() == pytest.approx(-weight, rel=1e-9)
    assert all(model.probe.constant < 0.0)


@pytest.mark.parametrize("stands", ["ground", "carrier"])
@pytest.mark.parametrize("kind", ["cantilever", "lumped"])
def test_the_foundation_bears_a_constant_force_on_the_tip(kind, stands):
    rig = trial_rig()
    stator = rig.stator[0]
    if kind == "lumped":
        stator = LumpedStator(
            node=3, angle=0.3, mass=0.1, stiffness=2e6, lateral_stiffness=3e5, lateral_mass=0.1, radius=0.06
        )
    carriers = ()
    if stands == "carrier":
        stator = replace(stator, carrier="casing")
        carriers = (Carrier(name="casing", mass=4.0, stiffness=3e6, inertia=0.1, torsional_stiffness=1e5),)
    rig = replace(rig, stator=(stator,), carrier=carriers)
    model = seen(
        rig,
        Probe(name="up", stator=1, quantity="foundation_force"),
        Probe(name="aside", stator=1, angle=math.pi / 2, quantity="foundation_force"),
    )
    force = np.zeros(model.body_start[-1])
    first = model.stator_start[0]
    along, across = 7.0, 2.0
    force[first + model.stators[0].axial], force[first + model.stators[0].lateral] = along, across
    body = slice(first, model.body_start[2])
    motion = np.zeros_like(force)
    motion[body] = np.linalg.solve(model.bodies[1].stiffness, force[body])
    c, s = math.cos(0.3), math.sin(0.3)
    assert model.probe_rows[0] @ motion == pytest.approx([along * c - across * s, along * s + across * c])


def test_a_model_without_probes_is_left_as_it_is():
    rig = trial_rig()
    model = assemble(rig)
    assert with_probes(model, rig, (), SPIN) is model
    probed = with_probes(model, rig, (Probe(name="a", node=2),), SPIN)
    assert with_probes(probed, rig, (Probe(name="a", node=2),), SPIN) is probed
    assert with_probes(probed, rig, (), SPIN).probe is None


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"node": 9}, "probe a: node: 9 is not on the shaft; its nodes run from 1 to 5"),
        ({"stator": 2}, "probe a: stator: 2 is not there; the rig has 1"),
        ({"node": 2, "quantity": "bearing_force"}, "node: 2 has no bearing; nodes with one: 1, 5"),
        ({"node": 1, "quantity": "twist"}, "node: node 1 does not twist; choose another one"),
    ],
)
def test_what_is_not_there_is_refused(keys, says):
    with pytest.raises(InputError, match=says):
        seen(trial_rig(), Probe(name="a", **keys))


def test_a_tip_that_moves_along_its_axis_alone_is_not_seen_across_it():
    rig = trial_rig(lateral=False)
    across = rig.stator[0].angle + math.pi / 2
    with pytest.raises(InputError, match="the tip of stator 1 does not move in this direction"):
        seen(rig, Probe(name="a", stator=1, angle=across))


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"name": "1st"}, 'name: "1st" is not a valid name of a variable'),
        ({"name": "x" * 65}, "up to 64 letters"),
        ({"name": "a b", "node": 1}, "letters, digits and _"),
        ({"name": "a", "node": 1, "stator": 1}, "node: give either node = 1 or stator = 1"),
        ({"name": "a"}, "node: give either"),
        ({"name": "a", "stator": 1, "quantity": "twist"}, "twist is not measured at a stator"),
        ({"name": "a", "node": 1, "quantity": "foundation_force"}, "take bearing_force"),
        ({"name": "a", "node": 1, "quantity": "twist", "angle": 0.1}, "angle: twist has no direction"),
    ],
)
def test_a_probe_that_cannot_be_is_refused(keys, says):
    with pytest.raises(InputError, match=says):
        Probe(**keys)


def test_a_damper_of_a_bearing_counts_with_the_part_of_rayleighs_damping_in_it():
    rig = trial_rig()
    bearing = Bearing(node=1, kyy=1e6, kzz=7e5, kyz=2e5, kzy=-1e5, cyy=60.0, czz=90.0, cyz=7.0)
    rotor = replace(
        rig.rotor, bearing=(bearing, *rig.rotor.bearing[1:]), damping=replace(rig.rotor.damping, beta=1e-4)
    )
    rig = replace(rig, rotor=rotor)
    model = seen(rig, Probe(name="f", node=1, quantity="bearing_force"))
    v, w = (model.rotor.index(1, name) for name in ("v", "w"))
    assert model.probe_rows[0, 0, [v, w]] == pytest.approx([1e6, 2e5])
    assert model.probe_rows[1, 0, [v, w]] == pytest.approx([60.0 + 100.0, 7.0 + 20.0])
