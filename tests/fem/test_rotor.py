"""The assembled rotor: what sits where, what is held, and which way unbalance pulls."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rubhpc.fem.assemble import forces_on
from rubhpc.fem.rotor import assemble_rotor
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor, Unbalance

STEEL = {"youngs_modulus": 2.1e11, "shear_modulus": 8e10, "density": 7800.0}
SHAFT = (
    ShaftSection(length=0.3, outer_diameter=0.04, elements=3, **STEEL),
    ShaftSection(length=0.2, outer_diameter=0.06, inner_diameter=0.03, elements=2, **STEEL),
)
SUPPORT = Bearing(node=1, stiffness=1e6)
ROTOR = Rotor(shaft=SHAFT, bearing=(SUPPORT,))


def rigid_translation(body, name):
    return np.array([float(degree == name) for _, degree in body.degrees])


def test_stepped_rotor_weighs_its_sections_and_discs():
    disc = Disc(node=4, mass=3.0, diametral_inertia=0.01, polar_inertia=0.02)
    body = assemble_rotor(replace(ROTOR, disc=(disc,)))
    shaft = 7800 * math.pi / 4 * (0.3 * 0.04**2 + 0.2 * (0.06**2 - 0.03**2))
    for name in ("v", "w"):
        motion = rigid_translation(body, name)
        assert motion @ body.mass @ motion == pytest.approx(shaft + 3.0)


def test_disc_turns_with_the_inertia_of_a_solid_cylinder():
    disc = Disc(node=3, diameter=0.2, thickness=0.05, density=7800.0)
    plain, loaded = assemble_rotor(ROTOR), assemble_rotor(replace(ROTOR, disc=(disc,)))
    mass = 7800 * math.pi * 0.1**2 * 0.05
    expected = {"v": mass, "thx": mass * 0.1**2 / 2, "thy": mass * (3 * 0.1**2 + 0.05**2) / 12}
    difference = loaded.mass - plain.mass
    for name, inertia in expected.items():
        row = loaded.index(3, name)
        assert difference[row, row] == pytest.approx(inertia)
    turn = loaded.gyroscopic - plain.gyroscopic
    # Id thy'' + spin Ip thz' = My
    assert turn[loaded.index(3, "thy"), loaded.index(3, "thz")] == pytest.approx(mass * 0.1**2 / 2)
    assert turn[loaded.index(3, "thz"), loaded.index(3, "thy")] == pytest.approx(-mass * 0.1**2 / 2)
    assert np.count_nonzero(turn) == 2


def test_bearing_matrices_act_in_their_rows_and_columns():
    bearing = Bearing(node=2, kyy=1e6, kzz=2e6, kyz=3e5, kzy=-4e5, cyy=10.0, czz=20.0, cyz=5.0, czy=-6.0)
    plain, borne = assemble_rotor(ROTOR), assemble_rotor(replace(ROTOR, bearing=(SUPPORT, bearing)))
    v, w = borne.index(2, "v"), borne.index(2, "w")
    # a push by w alone raises the force in y by kyz
    added = borne.stiffness - plain.stiffness
    assert added[np.ix_([v, w], [v, w])] == pytest.approx(np.array([[1e6, 3e5], [-4e5, 2e6]]))
    assert np.count_nonzero(added) == 4
    assert borne.damping[np.ix_([v, w], [v, w])] == pytest.approx(np.array([[10.0, 5.0], [-6.0, 20.0]]))
    assert np.count_nonzero(borne.damping) == 4


def test_stiffness_proportional_damping_takes_in_the_bearings():
    body = assemble_rotor(replace(ROTOR, damping=Damping(alpha=3.0, beta=1e-4)))
    assert body.damping == pytest.approx(3.0 * body.mass + 1e-4 * body.stiffness)
    assert body.stiffness[body.index(1, "v"), body.index(1, "v")] > 1e6


@pytest.mark.parametrize(
    ("torsion", "n_held"),
    [
        (Torsion(fixed_node=1), 2),
        (Torsion(fixed_node=4), 2),
        (Torsion(stiffness=5.0), 1),
        (Torsion(free=True), 1),
    ],
)
def test_axial_motion_and_torsion_are_held_where_they_are_said_to_be(torsion, n_held):
    body = assemble_rotor(replace(ROTOR, torsion=torsion))
    assert body.n_dof == 6 * 6 - n_held
    assert body.index(1, "u") == -1
    assert body.index(2, "u") >= 0
    assert (body.index(torsion.fixed_node or 1, "thx") == -1) == (torsion.fixed_node is not None)
    assert [degree for degree in body.degrees if degree[0] == 3] == [
        (3, name) for name in ("u", "v", "w", "thx", "thy", "thz")
    ]


def test_torsional_spring_and_damper_resist_a_turn_of_the_whole_shaft():
    body = assemble_rotor(replace(ROTOR, torsion=Torsion(node=6, stiffness=50.0, damping=0.3)))
    turn = rigid_translation(body, "thx")
    row = body.index(6, "thx")
    assert (body.stiffness @ turn)[row] == pytest.approx(50.0)
    assert turn @ body.stiffness @ turn == pytest.approx(50.0)
    assert turn @ body.damping @ turn == pytest.approx(0.3)


def test_unbalance_turns_from_y_to_z_ahead_by_its_phase():
    phase, moment = 0.8, 2e-3 * 0.05
    rotor = replace(ROTOR, unbalance=(Unbalance(node=4, mass=2e-3, radius=0.05, phase=phase),))
    body = assemble_rotor(rotor)
    cosine, sine = forces_on(rotor, body)[1:]
    rows = [body.index(4, "v"), body.index(4, "w")]
    for angle in np.linspace(0, 2 * math.pi, 7):
        pull = cosine * math.cos(angle) + sine * math.sin(angle)
        assert complex(*pull[rows]) == pytest.approx(moment * np.exp(1j * (angle + phase)))
        assert np.count_nonzero(np.delete(pull, rows)) == 0


def test_unbalances_on_one_node_add_up():
    pair = tuple(Unbalance(node=4, mass=2e-3, radius=0.05, phase=phase) for phase in (0.3, 0.3 + math.pi))
    rotor = replace(ROTOR, unbalance=pair)
    vectors = forces_on(rotor, assemble_rotor(rotor))[1:]
    assert np.abs(vectors).max() < 1e-18
