"""The assembled stator, and what a model takes from the rig."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.beam import shear_coefficient_circle, shear_coefficient_rectangle
from rubhpc.fem.stator import assemble_stator
from rubhpc.rig.parts import Damping, Disc
from rubhpc.rig.stators import Stator

STATOR = Stator(
    node=8,
    length=0.05,
    width=0.004,
    height=0.007,
    youngs_modulus=3e9,
    density=1200.0,
    damping=Damping(alpha=2.0, beta=1e-5),
)


def tip_stiffness(model, row):
    return 1 / np.linalg.inv(model.body.stiffness)[row, row]


@pytest.mark.parametrize("elements", [1, 6])
def test_cantilever_yields_as_a_timoshenko_beam(elements):
    model = assemble_stator(replace(STATOR, elements=elements), 0.06)
    area, second_moment = 0.004 * 0.007, 0.004 * 0.007**3 / 12
    shear_rigidity = shear_coefficient_rectangle(0.3) * 3e9 / 2.6 * area
    compliance = 0.05**3 / (3 * 3e9 * second_moment) + 0.05 / shear_rigidity
    assert tip_stiffness(model, model.axial) == pytest.approx(3e9 * area / 0.05)
    assert tip_stiffness(model, model.lateral) == pytest.approx(1 / compliance)


def test_a_screw_yields_as_a_round_beam():
    model = assemble_stator(replace(STATOR, width=None, height=None, diameter=0.006), 0.06)
    area, second_moment = np.pi / 4 * 0.006**2, np.pi / 64 * 0.006**4
    compliance = 0.05**3 / (3 * 3e9 * second_moment) + 0.05 / (
        shear_coefficient_circle(0.3) * 3e9 / 2.6 * area
    )
    assert tip_stiffness(model, model.axial) == pytest.approx(3e9 * area / 0.05)
    assert tip_stiffness(model, model.lateral) == pytest.approx(1 / compliance)
    assert model.euler_load == pytest.approx(np.pi**2 * 3e9 * second_moment / (4 * 0.05**2))
    body = model.body
    ones = np.array([name == "axial" for _, name in body.degrees], float)
    assert ones @ body.mass @ ones == pytest.approx(1200.0 * area * 0.05 * 8 / 9)  # 1/9 at the clamped node


@pytest.mark.parametrize(
    ("sides", "says"),
    [
        ({"height": None}, "height: missing; add height"),
        ({"diameter": 0.006}, "width: conflicts with diameter"),
        ({"width": None, "diameter": 0.006}, "height: conflicts with diameter"),
    ],
)
def test_a_section_is_round_or_rectangular(sides, says):
    with pytest.raises(InputError, match=says):
        replace(STATOR, **sides)


def test_rows_of_the_tip_are_of_its_free_end():
    model = assemble_stator(STATOR, 0.06)
    assert model.body.degrees[model.axial] == (7, "axial")
    assert model.body.degrees[model.lateral] == (7, "lateral")
    assert min(node for node, _ in model.body.degrees) == 2
    assert model.body.n_dof == 18


def test_stator_without_lateral_freedom_keeps_its_axial_matrices():
    whole, axial = (assemble_stator(replace(STATOR, lateral=lateral), 0.06) for lateral in (True, False))
    assert axial.lateral == -1
    assert axial.body.degrees == tuple((node, "axial") for node in range(2, 8))
    rows = [row for row, (_, name) in enumerate(whole.body.degrees) if name == "axial"]
    for name in ("mass", "damping", "stiffness"):
        assert np.array_equal(getattr(axial.body, name), getattr(whole.body, name)[np.ix_(rows, rows)])


def test_stator_is_damped_in_proportion_and_does_not_spin():
    body = assemble_stator(STATOR, 0.06).body
    assert body.damping == pytest.approx(2.0 * body.mass + 1e-5 * body.stiffness)
    assert not body.gyroscopic.any()


def test_model_hands_on_what_the_rig_says_of_a_stator():
    rig = read_rig("mokhtar2017")
    second = replace(STATOR, angle=2.0, clearance_offset=3e-6, radius=0.05)
    model = assemble(replace(rig, stator=(*rig.stator, second)))
    assert [stator.radius for stator in model.stators] == [0.06, 0.05]  # the disc's, and its own
    assert model.stators[1].angle == 2.0
    assert model.stators[1].clearance_offset == 3e-6
    assert model.stators[1].length == 0.05
    weaker = 0.007 * 0.004**3 / 12
    assert model.stators[1].euler_load == pytest.approx(np.pi**2 * 3e9 * weaker / (4 * 0.05**2))


def test_recorded_node_is_the_stators_or_the_discs_or_the_middle():
    rig = read_rig("mokhtar2017")
    discs = tuple(Disc(node=node, diameter=0.1, thickness=0.02, density=7800.0) for node in (5, 11))
    loaded = replace(rig, rotor=replace(rig.rotor, disc=discs), stator=())
    stators = (replace(rig.stator[0], node=11), replace(rig.stator[0], node=5))
    bare = replace(rig.rotor, disc=())
    assert assemble(replace(loaded, stator=stators)).output_node == 11
    assert assemble(loaded).output_node == 5
    assert assemble(replace(rig, stator=(), rotor=bare)).output_node == 8
