"""Modes against closed forms: rigid rotors, single torsional springs, and the equation that they solve."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig

from rubhpc.fem.assemble import assemble
from rubhpc.fem.modes import modes, whirl_word
from rubhpc.fem.rotor import assemble_rotor
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rig import Rig
from rubhpc.rig.rotors import Rotor

STEEL = {"youngs_modulus": 2.1e11, "shear_modulus": 8e10, "density": 7800.0}
# all but rigid and massless, so that a disc on it obeys textbook formulas
RIGID = ShaftSection(
    length=0.4, outer_diameter=0.1, elements=4, youngs_modulus=2.1e15, shear_modulus=8e14, density=1e-3
)
MASS, DIAMETRAL, POLAR, STIFFNESS = 10.0, 0.05, 0.08, 1e6
DISC = Disc(node=3, mass=MASS, diametral_inertia=DIAMETRAL, polar_inertia=POLAR)


def rigid_rotor(**support):
    bearings = tuple(Bearing(node=node, **support) for node in (1, 5))
    return assemble_rotor(Rotor(shaft=(RIGID,), disc=(DISC,), bearing=bearings))


def lateral(body, spin=0.0, count=4):
    return [mode for mode in modes(body, spin) if mode.kind == "lateral"][:count]


def uneven_rotor():
    """A stepped, partly hollow rotor on damped bearings with coupling, its discs off centre."""
    return assemble_rotor(
        Rotor(
            shaft=(
                ShaftSection(length=0.3, outer_diameter=0.03, elements=4, **STEEL),
                ShaftSection(length=0.3, outer_diameter=0.05, inner_diameter=0.02, elements=4, **STEEL),
            ),
            disc=(
                Disc(node=3, diameter=0.15, thickness=0.02, density=7800.0),
                Disc(node=9, diameter=0.2, thickness=0.03, density=7800.0),
            ),
            bearing=(
                Bearing(node=1, kyy=2e7, kzz=1e7, kyz=3e6, kzy=-2e6, cyy=2e3, czz=1e3, cyz=1e2, czy=-5e1),
                Bearing(node=7, kyy=1e7, kzz=3e7, cyy=1e3, czz=4e3),
            ),
            damping=Damping(alpha=2.0, beta=1e-6),
        )
    )


@pytest.mark.parametrize("spin", [0.0, 700.0, -700.0])
def test_modes_solve_the_equation_of_motion(spin):
    body = uneven_rotor()
    found = modes(body, spin)
    assert len(found) == body.n_dof
    for mode in found[:20]:
        s, x = mode.eigenvalue, mode.shape
        terms = (s**2 * body.mass @ x, s * (body.damping + spin * body.gyroscopic) @ x, body.stiffness @ x)
        assert np.abs(sum(terms)).max() < 1e-6 * max(np.abs(term).max() for term in terms)
        assert np.real(x.conj() @ body.mass @ x) == pytest.approx(1.0)


@pytest.mark.parametrize("spin", [0.0, 500.0, 3000.0])
def test_tilting_disc_splits_into_forward_and_backward(spin):
    # Id s^2 - i spin Ip s + 2 k a^2 = 0 for the tilt thz - i thy of a rigid rotor, bearings at +-a
    stiffness = 2 * STIFFNESS * 0.2**2
    roots = np.roots([DIAMETRAL, -spin * POLAR, -stiffness])  # whirl speed: positive is forward
    expected = {"forward": roots.max(), "backward": -roots.min()}
    translation = math.sqrt(2 * STIFFNESS / MASS)
    found = lateral(rigid_rotor(stiffness=STIFFNESS), spin)
    conical = [mode for mode in found if abs(mode.frequency * 2 * math.pi / translation - 1) > 1e-3]
    assert len(conical) == 2
    for mode in conical:
        if spin == 0.0:
            assert mode.whirl == "planar"
            assert 2 * math.pi * mode.frequency == pytest.approx(expected["forward"], rel=1e-5)
        else:
            assert 2 * math.pi * mode.frequency == pytest.approx(expected[mode.whirl], rel=1e-5)
    if spin:
        assert {mode.whirl for mode in conical} == {"forward", "backward"}


def test_reversed_spin_mirrors_the_modes():
    body = rigid_rotor(stiffness=STIFFNESS)
    for one, other in zip(lateral(body, 800.0), lateral(body, -800.0), strict=True):
        assert one.frequency == pytest.approx(other.frequency, rel=1e-9)
        assert one.whirl == other.whirl


def test_equal_modes_are_given_as_a_vertical_and_a_horizontal_one():
    body = assemble(read_rig("mokhtar2017")).rotor
    first, second = lateral(body, count=2)
    assert first.whirl == second.whirl == "planar"
    v = [row for row, (_, name) in enumerate(body.degrees) if name in ("v", "thz")]
    w = [row for row, (_, name) in enumerate(body.degrees) if name in ("w", "thy")]
    for mode, still in ((first, w), (second, v)):
        assert np.abs(mode.shape[still]).max() < 1e-6 * np.abs(mode.shape).max()


def test_cross_coupling_feeds_forward_whirl():
    # M s^2 + C s + (k - i kc) = 0 for v + i w, with kyz = kc = -kzy
    coupling, damping = 2e5, 50.0
    body = rigid_rotor(kyy=STIFFNESS, kzz=STIFFNESS, kyz=coupling, kzy=-coupling, damping=damping)
    found = lateral(body, 100.0, count=2)
    roots = np.roots([MASS, 2 * damping, 2 * (STIFFNESS - 1j * coupling)])
    forward, backward = (roots[np.argmax(sign * roots.imag)] for sign in (1, -1))
    expected = {"forward": forward, "backward": backward.conjugate()}
    assert {mode.whirl for mode in found} == {"forward", "backward"}
    for mode in found:
        assert mode.eigenvalue == pytest.approx(expected[mode.whirl], rel=1e-4)
        assert mode.damping_ratio == pytest.approx(-mode.eigenvalue.real / abs(mode.eigenvalue))
        assert (mode.damping_ratio < 0) == (mode.whirl == "forward")


def torsional(torsion, damping=None):
    rotor = Rotor(
        shaft=(RIGID,), disc=(DISC,), bearing=(Bearing(node=1, stiffness=1e6), Bearing(node=5, stiffness=1e6))
    )
    body = assemble_rotor(replace(rotor, torsion=torsion, damping=damping or Damping()))
    return next(mode for mode in modes(body) if mode.kind == "torsional")


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.5])
def test_torsional_spring_and_damper_to_ground(ratio):
    stiffness = 400.0
    omega = math.sqrt(stiffness / POLAR)
    drive = Torsion(stiffness=stiffness, damping=2 * ratio * math.sqrt(stiffness * POLAR))
    mode = torsional(drive)
    assert 2 * math.pi * mode.frequency == pytest.approx(omega, rel=1e-5)
    assert mode.damping_ratio == pytest.approx(ratio, rel=1e-5)
    assert mode.whirl == "none"
    damped = omega * math.sqrt(max(0.0, 1 - ratio**2))
    # a double root, at critical damping, carries the square root of the rounding
    assert 2 * math.pi * mode.damped_frequency == pytest.approx(damped, rel=1e-5, abs=0.01 * omega)
    if ratio > 1:
        assert mode.damped_frequency == 0.0
        assert mode.eigenvalue.real == pytest.approx(-omega * (ratio - math.sqrt(ratio**2 - 1)), rel=1e-5)


@pytest.mark.parametrize(("damping", "expected"), [(Damping(), 0.0), (Damping(alpha=3.0), 1.0)])
def test_free_shaft_turns_as_a_rigid_body(damping, expected):
    mode = torsional(Torsion(free=True), damping)
    assert mode.frequency == 0.0
    assert mode.damped_frequency == 0.0
    assert mode.damping_ratio == expected
    turning = mode.shape[np.abs(mode.shape) > 0]
    assert len(turning) == 5
    assert turning == pytest.approx(np.full(5, 1 / math.sqrt(POLAR)), rel=1e-5)


def test_two_discs_on_a_free_shaft_swing_against_each_other():
    shaft = ShaftSection(
        length=0.5, outer_diameter=0.02, elements=5, youngs_modulus=2.1e11, shear_modulus=8e10, density=1e-3
    )
    discs = tuple(
        Disc(node=node, mass=1.0, diametral_inertia=0.01, polar_inertia=polar)
        for node, polar in ((1, 0.02), (6, 0.05))
    )
    supports = (Bearing(node=1, stiffness=1e6), Bearing(node=6, stiffness=1e6))
    body = assemble_rotor(Rotor(shaft=(shaft,), disc=discs, bearing=supports, torsion=Torsion(free=True)))
    free, swinging = [mode for mode in modes(body) if mode.kind == "torsional"][:2]
    stiffness = 8e10 * math.pi / 32 * 0.02**4 / 0.5
    assert free.frequency == 0.0
    expected = math.sqrt(stiffness * (1 / 0.02 + 1 / 0.05))
    assert 2 * math.pi * swinging.frequency == pytest.approx(expected, rel=1e-5)


def test_every_overdamped_mode_of_a_stator_keeps_its_own_ratio():
    body = assemble(read_rig("mokhtar2017")).stators[0].body
    beta = 1.98e-5
    found = modes(body)
    assert len(found) == body.n_dof
    assert {mode.whirl for mode in found} == {"none"}
    assert {mode.kind for mode in found} == {"lateral", "axial"}
    for mode in found:
        omega = 2 * math.pi * mode.frequency
        assert mode.damping_ratio == pytest.approx(beta * omega / 2, rel=1e-6)
        assert (mode.damped_frequency == 0.0) == (mode.damping_ratio > 1.0)
    undamped = np.sqrt(np.linalg.eigvals(np.linalg.solve(body.mass, body.stiffness)).real)
    expected = np.sort(undamped) / (2 * math.pi)
    assert [mode.frequency for mode in found] == pytest.approx(expected, rel=1e-6)


def test_overdamped_rotor_keeps_its_planes_and_motions_apart():
    damping, arm = 8e3, 0.2
    found = lateral(rigid_rotor(kyy=1e6, kzz=2e6, damping=damping))
    expected = []
    for stiffness in (1e6, 2e6):
        for k, c, m in (
            (2 * stiffness, 2 * damping, MASS),
            (2 * stiffness * arm**2, 2 * damping * arm**2, DIAMETRAL),
        ):
            expected.append((math.sqrt(k / m) / (2 * math.pi), c / (2 * math.sqrt(k * m))))
    for mode, (frequency, ratio) in zip(found, sorted(expected), strict=True):
        assert mode.frequency == pytest.approx(frequency, rel=1e-4)
        assert mode.damping_ratio == pytest.approx(ratio, rel=1e-4)
        assert mode.whirl == "planar"


def test_creeping_bearing_pairs_with_its_own_fast_root():
    # a flexible shaft on bearings so damped that they hardly move: each has a slow root near -k/c
    rig = read_rig("mokhtar2017")
    bearings = (Bearing(node=1, stiffness=1e6, damping=1e5), Bearing(node=15, kyy=1e6, kzz=2e6, damping=1e5))
    body = assemble(replace(rig, rotor=replace(rig.rotor, bearing=bearings))).rotor
    creeping = [mode for mode in lateral(body, count=None) if mode.damping_ratio > 1]
    assert sorted(mode.eigenvalue.real for mode in creeping) == pytest.approx([-20, -10, -10, -10], rel=0.01)
    # paired with one another they would come out near 1.06
    assert min(mode.damping_ratio for mode in creeping) > 30


@pytest.mark.parametrize(
    ("first", "second", "word"),
    [
        ((1, -1j), (0.5, -0.4j), "forward"),
        ((1, -1j), (0.5, 0.4j), "mixed"),
        ((1, -1j), (0.005, 0.005j), "forward"),
    ],
)
def test_a_mode_whose_nodes_whirl_either_way_is_mixed(first, second, word):
    names = ["v", "w", "v", "w"]
    assert whirl_word(np.array([*first, *second]), np.eye(4), names, 100.0) == word
    opposite = {"forward": "backward"}.get(word, word)
    assert whirl_word(np.array([*first, *second]), np.eye(4), names, -100.0) == opposite


def test_whirl_in_unlike_bearings_is_mixed_and_in_equal_ones_is_not():
    words = {}
    for kzz in (2e7, 8e6):
        section = ShaftSection(length=1.2, outer_diameter=0.06, elements=6, **STEEL)
        disc = Disc(node=3, diameter=0.3, thickness=0.03, density=7800.0)
        bearings = tuple(Bearing(node=n, kyy=2e7, kzz=k) for n, k in ((1, kzz), (6, 1.5 * kzz)))
        if kzz == 2e7:
            bearings = tuple(Bearing(node=n, stiffness=2e7) for n in (1, 6))
        rotor = Rotor(shaft=(section,), disc=(disc,), bearing=bearings, torsion=Torsion(fixed_node=1))
        found = modes(assemble(Rig(name="a", rotor=rotor)).rotor, 400.0)
        words[kzz] = {mode.whirl for mode in found if mode.kind == "lateral" and mode.frequency > 0.0}
    assert words[2e7] == {"forward", "backward"}
    assert "mixed" in words[8e6]
