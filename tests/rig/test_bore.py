"""Round bores in rigs: their keys, their model, and laws of single stators."""

from dataclasses import replace

import numpy as np
import pytest

import rubhpc
from rubhpc import Bore, InputError, LumpedStator, Rig, Stator, assemble, read_rig, simulate
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.rig.reading import rig_from_dict, with_keys

PACKAGED = read_rig("mokhtar2017")
SPRUNG = {"kind": "bore", "node": 8, "mass": "2 kg", "stiffness": "1e6 N/m", "damping": 30.0}


def rig_with(*stators, **more):
    return rig_from_dict(PACKAGED.as_dict() | {"stator": list(stators)} | more)


def test_a_bore_is_read_with_units_and_goes_through_a_store():
    law = {"kind": "hertz", "stiffness": "1e10 N/m^1.5", "damping": "0.1 s/m"}
    rig = rig_with(SPRUNG | {"centre": ["20 um", "-35 um"], "friction_factor": 0.5, "law": law})
    (bore,) = rig.stator
    assert bore == Bore(
        node=8,
        mass=2.0,
        stiffness=1e6,
        damping=30.0,
        centre=(2e-5, -3.5e-5),
        friction_factor=0.5,
        law=NormalLaw(kind="hertz", stiffness=1e10, damping=0.1),
    )
    assert rig.contact_radius(bore) == 0.06
    assert rig_from_dict(rig.as_dict()) == rig
    assert Bore(node=8, rigid=True, law=law).law == bore.law
    with pytest.raises(InputError, match=r"Bore: \[law\] stiffness: missing; kind = .penalty. needs one"):
        Bore(node=8, rigid=True, law={"kind": "penalty"})
    assert with_keys(rig, {"stator.law.stiffness": 2e10}).stator[0].law.stiffness == 2e10
    assert with_keys(rig, {"stator.stiffness_z": 5e5}).stator[0].springs == (1e6, 5e5)
    split = with_keys(rig, {"stator.stiffness_z": 5e5})
    assert with_keys(split, {"stator.stiffness": 3e5}).stator[0].springs == (3e5, 3e5)


def test_a_kind_is_optional_elsewhere_and_leaves_no_trace():
    beam = PACKAGED.as_dict()["stator"][0]
    assert rig_with(beam | {"kind": "beam"}) == rig_with(beam)
    assert rig_with(beam | {"kind": "beam"}).as_dict() == PACKAGED.as_dict()
    lumped = {"node": 8, "mass": 1e-3, "stiffness": 1e5}
    assert rig_with(lumped | {"kind": "lumped"}) == rig_with(lumped)


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"kind": "bush"}, r'stator\.1\] kind: "bush" is not available; choose one of "beam", "lumped"'),
        ({"angle": 0.1}, r"stator\.1\] angle: a bore surrounds the rotor and has none; remove it"),
        ({"count": 3}, r"stator\.1\] count: a bore surrounds the rotor"),
        ({"rigid": True}, r"stator\.1\] mass: conflicts with rigid = true"),
        (
            {"stiffness_y": 1e5},
            r"stiffness_y: conflicts with stiffness; give either stiffness or stiffness_y and",
        ),
        ({"centre": [1e-5]}, r'centre: not two numbers; write \["20 um", "-35 um"\]'),
        ({"length": 0.1}, r"stator\.1\] length: unknown key"),
        ({"law": {"kind": "penalty"}}, r"stator\.1\.law\] stiffness: missing; kind"),
        ({"law": {"stiffness": 1e5}}, r"law\] stiffness: a multiplier has none"),
        (
            {"law": {"kind": "penalty", "stiffness": 1e5, "restitution": 0.5}},
            r"restitution: the rebound of a spring",
        ),
        (
            {"law": {"kind": "penalty", "stiffness": "1e5 N/m^1.5"}},
            r"stiffness: 100000 N/m\^1\.5: kind",
        ),
        ({"law": {"restitution": 1.5}}, r"law\] restitution: 1\.5 is out of range"),
    ],
)
def test_what_is_no_bore_is_refused_in_a_line(changed, problem):
    with pytest.raises(InputError, match=problem):
        rig_with(SPRUNG | changed)


def test_missing_halves_are_named():
    with pytest.raises(InputError, match="mass: missing; give mass and stiffness, or rigid = true"):
        Bore(node=8)
    with pytest.raises(
        InputError, match="stiffness: missing; give stiffness, or stiffness_y and stiffness_z"
    ):
        Bore(node=8, mass=1.0)
    with pytest.raises(InputError, match="damping_z: missing; give damping, or damping_y and damping_z"):
        Bore(node=8, mass=1.0, stiffness=1.0, damping_y=1.0)
    with pytest.raises(InputError, match=r'"bore" is another stator; use rubhpc\.Bore'):
        LumpedStator(node=8, kind="bore", mass=1.0, stiffness=1.0)


def test_its_body_moves_up_and_across():
    one = Bore(node=8, mass=2.0, stiffness_y=3.0, stiffness_z=4.0, damping=0.5, centre=(1e-5, 2e-5))
    model = assemble(replace(PACKAGED, stator=(one, Bore(node=8, rigid=True)))).stators
    body = model[0].body
    assert body.degrees == ((1, "axial"), (1, "lateral"))
    np.testing.assert_array_equal(body.mass, np.diag([2.0, 2.0]))
    np.testing.assert_array_equal(body.stiffness, np.diag([3.0, 4.0]))
    np.testing.assert_array_equal(body.damping, np.diag([0.5, 0.5]))
    assert model[0].centre == (1e-5, 2e-5)
    assert (model[1].body.n_dof, model[1].axial, model[1].lateral) == (0, -1, -1)


def test_it_stands_on_a_carrier():
    casing = rubhpc.Carrier(name="casing", mass=5.0, stiffness=1e6, inertia=0.1, torsional_stiffness=1e5)
    bores = (
        Bore(node=8, rigid=True, carrier="casing"),
        Bore(node=8, mass=1.0, stiffness=1e6, carrier="casing"),
    )
    model = assemble(replace(PACKAGED, stator=bores, carrier=(casing,)))
    first, second = model.stators
    assert (first.axial, first.lateral, first.torsion) == (0, 1, 2)
    assert (second.axial, second.lateral, second.torsion) == (3, 4, 2)
    np.testing.assert_array_equal(np.diag(first.body.mass), [5.0, 5.0, 0.1, 1.0, 1.0])
    np.testing.assert_array_equal(first.body.stiffness[0], [2e6, 0.0, 0.0, -1e6, 0.0])
    held = rubhpc.MatrixCarrier(name="casing", mass=[[5.0]], stiffness=[[1e6]], degrees=["w"])
    (only,) = assemble(replace(PACKAGED, stator=bores[:1], carrier=(held,))).stators
    assert (only.axial, only.lateral) == (-1, 0)


def test_fixed_normals_and_the_central_difference_are_refused():
    rig, case = rig_with(SPRUNG), {"speed": 100.0, "clearance": 1e-4}
    with pytest.raises(InputError, match=r"normal: stator\.1 is a bore, whose contact point moves around"):
        simulate(rig, normal="fixed", **case)
    with pytest.raises(InputError, match="central-difference needs one law"):
        simulate(rig, normal="updated", method="central-difference", **case)
    factor = replace(PACKAGED, stator=(replace(PACKAGED.stator[0], friction_factor=0.5),))
    with pytest.raises(InputError, match=r"stator\.1 is a bore, or has a law or friction_factor of its own"):
        simulate(factor, method="central-difference", model="mokhtar2017", **case)
    with pytest.raises(InputError, match="leave no gap in a bore"):
        simulate(rig, normal="updated", speed=100.0, clearance=0.0)
    assert isinstance(PACKAGED.stator[0], Stator)
    assert isinstance(rig, Rig)
