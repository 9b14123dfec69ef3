"""Critical speeds against closed forms, and which of them the unbalance excites."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from closed_form import read_rig
from scipy.linalg import eigvals
from scipy.optimize import brentq
from trial_rig import trial_rig

from rubhpc import Rig, Unbalance, assemble
from rubhpc.fem.critical_speeds import find_critical_speeds
from rubhpc.fem.linear_design import linear_design
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Bearing, Disc, ShaftSection
from rubhpc.rig.rotors import Rotor

RPM = math.pi / 30
PLANE = [(1, "v"), (1, "w")]
TILT = [(1, "v"), (1, "w"), (1, "thy"), (1, "thz")]


def test_overhung_disc_in_closed_form():
    """Tilt, Id th'' - i W Ip th' + k th = 0, is critical at W^2 = k / (Id - Ip); backward, k / (Id + Ip)."""
    mass, transverse, polar, bend, tilt = 2.0, 0.03, 0.02, 8e4, 900.0
    gyroscopic = np.zeros((4, 4))
    gyroscopic[2, 3], gyroscopic[3, 2] = polar, -polar
    model = assemble(
        Rig.from_matrices(
            np.diag([mass, mass, transverse, transverse]),
            None,
            np.diag([bend, bend, tilt, tilt]),
            gyroscopic,
            degrees=TILT,
            unbalance=[Unbalance(node=1, mass=0.01, radius=0.1)],
        )
    )
    found = find_critical_speeds(model, np.linspace(0.0, 400.0, 11))
    known = {
        math.sqrt(bend / mass): {"forward", "backward", "planar"},
        math.sqrt(tilt / (transverse + polar)): {"backward"},
        math.sqrt(tilt / (transverse - polar)): {"forward"},
    }
    speeds = sorted([*known, math.sqrt(bend / mass)])
    assert [c.speed for c in found] == pytest.approx(speeds, rel=1e-9)
    for critical in found:
        key = min(known, key=lambda speed: abs(speed - critical.speed))
        assert critical.mode.whirl in known[key]


def test_unbalance_excites_forward_whirl_of_an_isotropic_rotor_alone():
    """Not a mode that has a node where the unbalance is, either."""
    rig = read_rig("mokhtar2017")
    found = find_critical_speeds(assemble(rig), np.linspace(0.0, 1500.0, 31))
    assert [(c.mode.whirl, c.is_excited) for c in found][:3] == [
        ("backward", False),
        ("forward", True),
        ("backward", False),
    ]
    assert found[1].excitation == pytest.approx(1.0, abs=1e-3)
    off = replace(rig, rotor=replace(rig.rotor, unbalance=(Unbalance(node=4, mass=0.01, radius=0.05),)))
    overhang = find_critical_speeds(assemble(off), np.linspace(0.0, 1500.0, 31))
    second = [c for c in overhang if c.mode.whirl == "forward" and c.speed > 500.0]
    assert all(c.is_excited for c in second)
    none = replace(rig, rotor=replace(rig.rotor, unbalance=()))
    without = find_critical_speeds(assemble(none), np.linspace(0.0, 300.0, 7))
    assert [c.is_excited for c in without] == [False, True]
    assert math.isnan(without[0].excitation)


def test_unlike_bearings_let_the_unbalance_excite_backward_whirl():
    found = find_critical_speeds(assemble(trial_rig()), np.linspace(0.0, 400.0, 21))
    assert [(c.mode.whirl, c.is_excited) for c in found] == [("backward", True), ("forward", True)]


def test_several_discs_and_three_unlike_bearings():
    """Critical speeds are eigenvalues of K - w^2 (M - G~) in rotating coordinates: here by their residual."""
    rig = trial_rig()
    rotor = replace(
        rig.rotor,
        disc=(*rig.rotor.disc, Disc(node=5, mass=2.0, diametral_inertia=0.004, polar_inertia=0.007)),
        bearing=(
            Bearing(node=1, stiffness=8e5),
            Bearing(node=2, stiffness=3e5),
            Bearing(node=4, stiffness=2e6),
        ),
        damping=replace(rig.rotor.damping, alpha=0.0),
    )
    model = assemble(replace(rig, rotor=rotor))
    found = find_critical_speeds(model, np.linspace(0.0, 3000.0, 61))
    assert len(found) >= 3
    body = model.rotor
    for c in found:
        dynamic = body.stiffness - c.speed**2 * body.mass + 1j * c.speed**2 * body.gyroscopic
        scale = np.abs(body.stiffness @ c.mode.shape).max()
        assert np.abs(dynamic @ c.mode.shape).max() < 1e-6 * scale


def test_stiffening_bearing_is_met_more_than_once():
    """k(W) = m W0(W)^2: the natural frequency outruns the spin and is met on the way back, too."""
    speeds = [50.0, 100.0, 200.0, 300.0]
    natural = np.array([100.0, 90.0, 250.0, 260.0])  # under, then over, then under the spin again
    model = assemble(
        Rig.from_matrices(
            np.eye(2),
            None,
            np.eye(2) * 1e-3,
            degrees=PLANE,
            unbalance=[Unbalance(node=1, mass=1.0, radius=1e-5)],
        )
    )
    rotor = replace(
        Rig.from_matrices(np.eye(2), None, np.eye(2) * 1e-3, degrees=PLANE).rotor,
        bearing=(BearingTable(node=1, speed=speeds, stiffness=natural**2, interpolation="linear"),),
    )
    model = assemble(Rig(name="table", rotor=rotor))
    found = find_critical_speeds(model, np.linspace(50.0, 300.0, 51))
    distinct = sorted({round(c.speed, 6) for c in found})
    known = []
    for (a, b), (ka, kb) in zip(pairwise(speeds), pairwise(natural**2), strict=True):
        slope = (kb - ka) / (b - a)
        roots = np.roots([1.0, -slope, slope * a - ka])
        known += [root.real for root in roots if abs(root.imag) < 1e-9 and a <= root.real <= b]
    assert distinct == pytest.approx(sorted(known), rel=1e-6)
    assert len(known) == 3


def test_modes_that_do_not_oscillate_are_not_solved_for(monkeypatch):
    rig = trial_rig(1)
    stiff = replace(rig, rotor=replace(rig.rotor, damping=replace(rig.rotor.damping, beta=0.5)))
    solved = []  # each is some 15 eigenproblems

    def noted(*args, **options):
        solved.append(brentq(*args, **options))
        return solved[-1]

    monkeypatch.setattr("rubhpc.fem.critical_speeds.brentq", noted)
    found = find_critical_speeds(assemble(stiff), np.linspace(0.0, 3000.0, 61))
    assert all(critical.mode.eigenvalue.imag > 0.0 for critical in found)
    assert len(found) == 2, "of twelve crossings"
    assert len(solved) <= 4


def undamped_packaged():
    rig = read_rig("mokhtar2017")
    return replace(rig, rotor=replace(rig.rotor, damping=replace(rig.rotor.damping, alpha=0.0)))


def nelson_mcvaugh(is_isotropic):
    """The rotor of H. D. Nelson, J. M. McVaugh, J. Eng. Ind. 98 (1976) 593-600, without damping."""
    ends = [0.0, 1.27, 5.08, 7.62, 8.89, 10.16, 10.67, 11.43, 12.7, 13.46, 16.51, 19.05, 22.86, 26.67, 28.7]
    ends += [30.48, 31.5, 34.54, 35.5]  # cm
    outer = [0.51, 1.02, 0.76, 2.03, 2.03, 3.3, 3.3, 2.54, 2.54, 1.27, 1.27, 1.52, 1.52, 1.27, 1.27, 3.81]
    outer += [2.03, 2.03]
    inner = {6: 1.52, 7: 1.78, 17: 1.52}
    shaft = tuple(
        ShaftSection(
            length=(end - start) / 100,
            outer_diameter=outer[i] / 50,
            inner_diameter=inner.get(i, 0.0) / 50,
            elements=1,
            youngs_modulus=2.078e11,
            shear_modulus=2.078e11 / 2.6,
            density=7806.0,
        )
        for i, (start, end) in enumerate(pairwise(ends))
    )
    straight, cross = (4.378e7, 0.0) if is_isotropic else (3.503e7, -8.756e6)
    bearings = [Bearing(node=n, kyy=straight, kzz=straight, kyz=cross, kzy=cross) for n in (11, 15)]
    disc = Disc(node=5, mass=1.401, diametral_inertia=13.6e-4, polar_inertia=20e-4)
    unbalance = Unbalance(node=5, mass=1.401, radius=1e-4)
    rotor = Rotor(shaft=shaft, disc=(disc,), bearing=tuple(bearings), unbalance=(unbalance,))
    return Rig(name="nelson mcvaugh", rotor=rotor)


@pytest.mark.parametrize(
    ("rig", "top"),
    [
        (undamped_packaged(), 48000 * RPM),
        (nelson_mcvaugh(is_isotropic=True), 1e5 * RPM),
        (nelson_mcvaugh(is_isotropic=False), 1e5 * RPM),
    ],
    ids=["packaged", "isotropic", "orthotropic"],
)
def test_critical_speeds_depend_neither_on_the_range_nor_on_its_grid(rig, top):
    """Those of an undamped rotor are the eigenvalues of (K - w^2 (M - i G)) x = 0."""
    model = assemble(rig)
    body = model.rotor
    rows = body.rows(["v", "w"])
    K, M, G = (matrix[np.ix_(rows, rows)] for matrix in (body.stiffness, body.mass, body.gyroscopic))
    flexible = eigvals(M - 1j * G, K).real
    known = np.sort(flexible[flexible > 0.0] ** -0.5)
    kinds = {}
    for low, high, n in [(0.0, top, 2), (0.1 * top, 0.5 * top, 5)]:
        found = find_critical_speeds(model, np.linspace(low, high, n))
        assert [c.speed for c in found] == pytest.approx(known[(known > low) & (known < high)], rel=1e-9)
        for c in found:
            kind = c.mode.whirl, c.is_excited
            assert kinds.setdefault(np.abs(known - c.speed).argmin(), kind) == kind


@pytest.mark.parametrize("n_speed", [5, 13])
def test_twins_at_standstill_part_into_backward_and_forward(n_speed):
    design = linear_design(read_rig("mokhtar2017"), (0.0, 48000 * RPM), n_speed=n_speed)
    assert design.critical_speed.values[:2] / RPM == pytest.approx([1893.41, 1893.74], abs=0.01)
    assert design.critical_whirl.values[:2].tolist() == ["backward", "forward"]
    assert design.is_excited.values[:2].tolist() == [False, True]
    assert design.critical_mode.values[:7].tolist() == [1, 2, 4, 5, 6, 7, 8], "3 is torsion"
    for mode, whirl in zip(design.critical_mode.values, design.critical_whirl.values, strict=True):
        assert set(design.whirl.sel(mode=mode).values[1:].tolist()) == {whirl}


def test_torsion_that_meets_the_spin_hides_no_critical_speed():
    """Seals whose stiffness outruns the spin, while the spin passes the torsional frequency."""
    rig = nelson_mcvaugh(is_isotropic=True)
    speeds = [0.0, 20000 * RPM, 50000 * RPM, 100000 * RPM]
    stiffness, cross = [1e6, 8e6, 6e7, 2.4e8], [0.0, 5e6, 1e7, 2e7]
    seals = [
        BearingTable(
            node=bearing.node,
            speed=speeds,
            kyy=stiffness,
            kzz=[0.8 * value for value in stiffness],
            kyz=cross,
            kzy=[-value for value in cross],
            damping=[1e4, 2e3, 1e3, 5e2],
        )
        for bearing in rig.rotor.bearing
    ]
    model = assemble(replace(rig, rotor=replace(rig.rotor, bearing=tuple(seals))))
    known = [102.2807, 112.8647, 831.4441, 1179.466]
    for high, n in ((1900.0, 3), (3500.0, 5)):
        found = [c.speed for c in find_critical_speeds(model, np.linspace(0.0, high, n))]
        assert found[:4] == pytest.approx(known, rel=1e-6)


def test_a_rotor_that_floats_freely_has_critical_speeds():
    """Its rigid-body modes, eigenvalues of rounding, neither count nor take another mode's place."""
    section = {"youngs_modulus": 2.1e11, "shear_modulus": 8e10, "density": 7800.0, "outer_diameter": 0.03}
    disc = Disc(node=6, diameter=0.3, thickness=0.03, density=7800.0)
    shaft, soft = ShaftSection(length=0.5, elements=5, **section), Bearing(node=1, stiffness=0.0)
    model = assemble(Rig(name="floating", rotor=Rotor(shaft=(shaft,), disc=(disc,), bearing=(soft,))))
    for n in (3, 11):
        found = find_critical_speeds(model, np.linspace(0.0, 5000.0, n))
        assert [c.speed for c in found] == pytest.approx([743.124361, 3362.413168, 3445.876886], rel=1e-8)
