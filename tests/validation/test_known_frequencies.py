"""Known answers of the linear model: frequencies, stiffnesses and amplitudes without contact.

L1, L2, L5: frequencies that another rotordynamics program (ROSS) gives for the packaged rotor to every digit.
L6: statics. L8: Timoshenko's beam, exact. L11: amplitudes of the packaged rotor at two damping ratios.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig

from rubhpc.fem.assemble import assemble
from rubhpc.fem.modes import modes, undamped_modes
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency
from rubhpc.fem.rotor import assemble_rotor
from rubhpc.rig.parts import Bearing, Damping, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor

RIG = read_rig("mokhtar2017")


def frequencies(model, kind, spin=0.0):
    return [mode.frequency for mode in modes(model.rotor, spin) if mode.kind == kind]


def static_stiffness(body, row):
    return 1 / np.linalg.inv(body.stiffness)[row, row]


def test_l1_bending_at_standstill():
    expected = [31.5596, 189.409, 293.867, 471.806, 689.602, 891.424]
    found = frequencies(assemble(RIG), "lateral")[:12]
    # half a unit of the last digit given, which is well within 0.01 %
    for plane in (found[::2], found[1::2]):
        assert plane == pytest.approx(expected, rel=2e-6)


def test_l2_bending_at_speed():
    expected = {
        "backward": [31.5575, 187.232, 293.853, 466.489],
        "forward": [31.5616, 191.542, 293.881, 477.114],
    }
    undamped = replace(RIG, rotor=replace(RIG.rotor, damping=Damping()))
    for whirl, values in expected.items():
        found = [m for m in modes(assemble(undamped).rotor, 148.723) if m.whirl == whirl][:4]
        assert [mode.frequency for mode in found] == pytest.approx(values, rel=2e-6)
    # the packaged damping, 8 % of the first mode, leaves natural frequencies as they are
    damped = [mode.frequency for mode in modes(assemble(RIG).rotor, 148.723) if mode.whirl == "forward"][:4]
    assert damped == pytest.approx(expected["forward"], rel=1e-5)


def test_l5_torsion_held_at_the_drive_and_free():
    assert frequencies(assemble(RIG), "torsional")[:3] == pytest.approx([128.0471, 2009.1, 4031.0], rel=3e-5)
    free = replace(RIG, rotor=replace(RIG.rotor, torsion=Torsion(free=True)))
    assert frequencies(assemble(free), "torsional")[:2] == pytest.approx([0.0, 2000.8], rel=3e-5)


def test_l6_static_stiffness():
    model = assemble(RIG)
    rotor, stator = model.rotor, model.stators[0]
    for name in ("v", "w"):
        assert static_stiffness(rotor, rotor.index(8, name)) == pytest.approx(143343.35, rel=1e-7)
    # G J / l of the half of the shaft between drive and disc
    torsional = 79.6e9 * math.pi / 32 * 0.02**4 / 0.4
    assert torsional == pytest.approx(3125.88, rel=1e-5)
    assert static_stiffness(rotor, rotor.index(8, "thx")) == pytest.approx(torsional, rel=1e-9)
    assert static_stiffness(stator.body, stator.axial) == pytest.approx(3e9 * 25e-6 / 0.04, rel=1e-9)


def test_stator_bends_first_at_803_hertz():
    first = modes(assemble(RIG).stators[0].body)[0]
    assert first.kind == "lateral"
    assert first.frequency == pytest.approx(803.0, rel=5e-4)
    assert first.damping_ratio == pytest.approx(0.05, rel=2e-3)


def exact_frequencies(diameter, length=0.8, E=210e9, G=79.6e9, rho=7800.0):
    """Timoshenko's simply supported beam: the lower root of its quadratic in w^2 at each wave number."""
    area, second_moment = math.pi / 4 * diameter**2, math.pi / 64 * diameter**4
    nu = E / (2 * G) - 1
    kappa = 6 * (1 + nu) / (7 + 6 * nu)
    found = []
    for half_waves in range(1, 5):
        k = half_waves * math.pi / length
        quadratic = (
            rho**2 * second_moment / (kappa * G),
            -(rho * area + rho * second_moment * (1 + E / (kappa * G)) * k**2),
            E * second_moment * k**4,
        )
        found.append(math.sqrt(min(np.roots(quadratic).real)) / (2 * math.pi))
    return found


def pinned_frequencies(diameter, elements):
    """Bending frequencies with both ends held in v and w, free to tilt."""
    section = ShaftSection(
        length=0.8,
        outer_diameter=diameter,
        elements=elements,
        youngs_modulus=210e9,
        shear_modulus=79.6e9,
        density=7800.0,
    )
    body = assemble_rotor(Rotor(shaft=(section,), bearing=(Bearing(node=1, stiffness=1.0),)))
    held = {(node, name) for node in (1, elements + 1) for name in ("v", "w")}
    lateral = ("v", "w", "thy", "thz")
    free = [row for row, at in enumerate(body.degrees) if at[1] in lateral and at not in held]
    rows = np.ix_(free, free)
    square, _ = undamped_modes(body.mass[rows], body.stiffness[rows])
    return np.sqrt(square[:8:2]) / (2 * math.pi)


@pytest.mark.parametrize(
    ("diameter", "printed"),
    [
        (0.02, [63.6268, 253.9264, 569.181, 1006.607]),
        (0.10, [312.493, 1187.930, 2486.796, 4068.892]),
    ],
)
def test_l8_simply_supported_shaft_tends_to_timoshenko(diameter, printed):
    exact = exact_frequencies(diameter)
    assert exact == pytest.approx(printed, rel=2e-6)
    errors = np.array([pinned_frequencies(diameter, n) for n in (14, 28, 56)]) / exact - 1
    assert 0 < errors[0, 0] < 1e-4
    # the slender shaft still gains from the fourth-order part of its error: up to 16 times at first
    falls = errors[:-1] / errors[1:]
    assert falls.min() > 3.7
    assert falls[-1].max() < (4.5 if diameter == 0.10 else 6.0)
    assert errors[-1].max() < 1e-3


@pytest.mark.parametrize("elements", [8, 20])
def test_l8_holds_on_stiff_bearings_too(elements):
    section = replace(RIG.rotor.shaft[0], elements=elements)
    ends = tuple(Bearing(node=node, stiffness=1e11) for node in (1, elements + 1))
    model = assemble(replace(RIG, rotor=Rotor(shaft=(section,), bearing=ends), stator=()))
    assert first_lateral_frequency(model) / (2 * math.pi) == pytest.approx(63.6268, rel=1e-4)


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [(0.05, [125.043, 175.875, 130.556, 109.369]), (0.10, [120.009, 172.246, 129.698, 109.140])],
)
def test_l11_amplitude_without_contact(ratio, expected):
    damping = Damping(alpha=2 * ratio * 2 * math.pi * 31.56)
    model = assemble(replace(RIG, rotor=replace(RIG.rotor, damping=damping)))
    speeds = [speed_ratio * 2 * math.pi * 31.56 for speed_ratio in (0.75, 1.5, 2, 3)]
    found = [1e6 * contact_free_amplitude(model, speed) for speed in speeds]
    # the answers are those of a disc 0.5 g heavier: up to 0.03 %
    assert found == pytest.approx(expected, rel=5e-4)
