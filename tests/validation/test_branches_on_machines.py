"""Branches along a speed on other machines, against simulations that jump where they fold."""

from dataclasses import replace

import numpy as np
import pytest
from trial_rig import trial_rig

import rubhpc
from rubhpc import LumpedStator, read_rig
from rubhpc.rig.reading import with_keys

PAPER = read_rig("mokhtar2017")
OVERHUNG = with_keys(PAPER, {"rotor.bearing.2.node": 5})
HANGING = with_keys(trial_rig(2), {"rotor.bearing.2.node": 2, "rotor.gravity": "9.81 m/s^2"})
SPRINGS = LumpedStator(node=8, radius=0.06, count=8, mass=1e-3, damping=2.0, stiffness=1e5)
RING = replace(PAPER, stator=(SPRINGS,))
COULOMB = {"friction": 0.3, "friction_law": "coulomb"}
BESIDE = 1e-5  # of the speed, on both sides of an event


def followed(rig, start, stop, **case):
    return rubhpc.branch(
        rig, along="speed_ratio", start=start, stop=stop, transient=200, doublings=0, keep="section", **case
    )[0]


def settled(rig, value, state, n_revolution, n_seen=8, **case):
    """What a simulation comes to from a state, at another speed."""
    return rubhpc.simulate(
        rig, speed_ratio=value, initial=state, transient=n_revolution, revolutions=n_seen,
        samples_per_revolution=64, keep="section", **case,
    )  # fmt: skip


def closes(rig, point, **case):
    """How far a simulation of four revolutions is from the motion with which it begins, over its size."""
    record = settled(rig, point.value, point.state, 0, **case)
    section = np.stack([record.sections["section_vertical"], record.sections["section_horizontal"]])
    return np.abs(section[:, :4] - section[:, :1]).max() / np.abs(section).max()


def check_fold(rig, branch, sense, n_revolution, **case):
    """A simulation stays before the first fold of a branch, as its stable part does, and leaves behind it."""
    at = next(k for k, point in enumerate(branch.points) if point.event == "fold")
    fold = branch.points[at]
    record = settled(rig, fold.value * (1.0 - sense * BESIDE), fold.state, n_revolution, **case)
    section = record.sections["section_vertical"]
    reached = np.abs(section - branch.record(at).sections["section_vertical"][0]).max()
    there = settled(rig, fold.value * (1.0 + sense * BESIDE), fold.state, n_revolution, **case)
    left = np.abs(there.sections["section_vertical"] - section[0]).max()
    assert reached < 0.05 * np.abs(section).max() < left


@pytest.mark.long
def test_ring_of_eight_jumps_where_its_branch_folds():
    case = {"clearance": "240 um", "friction": 0.05}
    branch = followed(RING, 1.3, 1.38, most_points=60, **case)
    assert branch.points[0].touches == 8
    assert all(closes(RING, point, **case) < 1e-6 for point in branch.points[:20:5])
    check_fold(RING, branch, 1.0, 3000, **case)


@pytest.mark.long
def test_overhung_disc_jumps_where_its_branch_folds():
    case = {"clearance_ratio": 0.6, "friction": 0.2}
    branch = followed(OVERHUNG, 1.3, 1.4, **case)
    assert [name for name, _ in branch.events()][:2] == ["grazing", "fold"]
    assert all(closes(OVERHUNG, point, **case) < 1e-6 for point in branch.points[::10])
    check_fold(OVERHUNG, branch, 1.0, 3000, **case)


@pytest.mark.long
def test_period_doubles_under_coulombs_law():
    case = {"clearance": "100 um", **COULOMB}
    branch = followed(PAPER, 0.76, 0.735, **case)
    ((name, value),) = branch.events()
    assert name == "period_doubling"
    (point,) = (one for one in branch.points if one.event == name)
    assert point.multipliers[0] == pytest.approx(-1.0, abs=1e-6)
    periods = [
        settled(PAPER, value * (1.0 + change), point.state, 6000, **case).period for change in (-1e-3, 1e-3)
    ]
    assert periods == [2, 1]


def test_points_under_gravity_are_motions_of_the_simulation():
    case = {"clearance_ratio": 0.5, "friction": 0.2}
    branch = followed(HANGING, 1.25, 1.26, largest_step=0.005, **case)
    assert branch.points[0].touches > 0
    assert all(closes(HANGING, point, **case) < 1e-6 for point in branch.points)
