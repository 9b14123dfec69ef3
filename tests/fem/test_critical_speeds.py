"""Critical speeds against closed forms, and which of them the unbalance excites."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq
from trial_rig import trial_rig

from rubhpc import Rig, Unbalance, assemble, read_rig
from rubhpc.fem.campbell import campbell, critical_speeds
from rubhpc.fem.critical_speeds import find_critical_speeds
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Bearing, Disc

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


def test_crossings_agree_with_those_of_the_diagram():
    model = assemble(read_rig("mokhtar2017"))
    found = find_critical_speeds(model, np.linspace(0.0, 1200.0, 25))
    around = [c.speed + side for c in found for side in (-2.0, 3.0)]
    drawn = critical_speeds(campbell(model.rotor, np.unique([*np.linspace(0.0, 1200.0, 49), *around])))
    assert [c.speed for c in found] == pytest.approx([speed for _, speed in drawn], rel=1e-5)
    for critical in found:
        assert abs(critical.mode.eigenvalue) == pytest.approx(critical.speed, rel=1e-9)
        assert 2 * math.pi * critical.mode.frequency == pytest.approx(critical.speed, rel=1e-9)


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
