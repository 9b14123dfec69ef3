"""Branches along a speed on other machines, against simulations that jump where they fold."""

from dataclasses import replace

import closed_form
import numpy as np
import pytest
from closed_form import periodic, read_rig, simulate
from scipy.optimize import brentq
from trial_rig import trial_rig

from rubhpc import LumpedStator
from rubhpc.rig.reading import with_keys
from rubhpc.schema import REGIME

PAPER = read_rig("mokhtar2017")
HANGING = with_keys(trial_rig(2), {"rotor.bearing.2.node": 2, "rotor.gravity": "9.81 m/s^2"})
SPRINGS = LumpedStator(node=8, radius=0.06, count=8, mass=1e-3, damping=2.0, stiffness=1e5)
RING = replace(PAPER, stator=(SPRINGS,))
BESIDE = 1e-5  # of the speed, on both sides of an event


def followed(rig, start, stop, **case):
    return closed_form.branch(
        rig, along="speed_ratio", start=start, stop=stop, transient=200, doublings=0, keep="section", **case
    )[0]


def settled(rig, value, state, n_revolution, n_seen=8, **case):
    """What a simulation comes to from a state, at another speed."""
    return simulate(
        rig, speed_ratio=value, initial=state, transient=n_revolution, revolutions=n_seen,
        samples_per_revolution=64, keep="section", **case,
    )  # fmt: skip


def check_fold(rig, branch, number, **case):
    """A simulation stays beside a fold of a branch, as its stable part does, and leaves beyond it.

    It begins with the fold's own state, and with that of the next point of the stable part.
    """
    at = [k for k, point in enumerate(branch.points) if point.event == "fold"][number]
    fold, period = branch.points[at], branch.period
    inward = np.sign(branch.values[at + 1] - fold.value)
    stable = at + 1 if branch.is_stable[at + 1] else at - 1
    assert branch.is_stable[stable]
    assert not branch.is_stable[2 * at - stable]
    motion = branch.record(at).sections["section_vertical"][:period]
    for state in (fold.state, branch.points[stable].state):
        away = []
        for sense in (inward, -inward):
            value = fold.value * (1.0 + sense * BESIDE)
            record = settled(rig, value, state, 4000, 8 * period, **case)
            section = record.sections["section_vertical"]
            last = [np.abs(np.roll(motion, k) - section[:period]).max() for k in range(period)]
            away.append(min(last) / np.abs(section).max())
        assert away[0] < 0.05
        assert away[1] > 10 * away[0]
    return inward


@pytest.mark.long
@pytest.mark.parametrize(
    ("rig", "start", "stop", "case"),
    [
        (RING, 1.2, 1.4, {"clearance": "240 um", "friction": 0.05, "most_points": 90}),
        (HANGING, 1.2, 1.22, {"clearance_ratio": 0.3, "friction": 0.2, "most_points": 60}),
    ],
    ids=["ring of 8", "overhung, gravity"],
)
def test_sweep_jumps_at_either_fold(rig, start, stop, case):
    """With rising speed at the first one, with falling speed at the second."""
    branch = followed(rig, start, stop, largest_step=0.004, **case)
    case.pop("most_points")
    assert check_fold(rig, branch, 0, **case) < 0.0
    assert check_fold(rig, branch, 1, **case) > 0.0


@pytest.mark.long
def test_isolated_motion_of_period_three_ends_at_two_folds():
    """A closed curve found by sweeps: the rotor falls back to period 1 above and below.

    Between lies a fold 4e-7 beside a grazing, at which a step across both ended 4e-6 too early.
    """
    case = {"clearance_ratio": 0.7, "friction": 0.3}
    found = closed_form.branch(
        PAPER, along="speed_ratio", start=2.2, stop=1.8, sweeps=3, transient=200, doublings=0, most_points=80,
        keep="section", **case,
    )  # fmt: skip
    (branch,) = (one for one in found if one.period == 3)
    assert branch.end == "the branch is closed"
    names, values = zip(*branch.events(), strict=True)
    assert names == ("grazing", "fold", "fold", "grazing", "fold")
    fold, graze = (branch.points[branch.values.tolist().index(value)] for value in values[2:4])
    assert 0.0 < graze.value - fold.value < 1e-6
    assert graze.is_stable
    assert graze.least_gap[0] < 1e-7 * 1e-4
    assert check_fold(PAPER, branch, 0, **case) < 0.0
    assert check_fold(PAPER, branch, 2, **case) > 0.0


@pytest.mark.long
def test_second_frequency_appears_where_an_overhung_disc_has_it():
    """As motions solved for one by one; simulations draw near before it and leave behind it."""
    case = {"clearance_ratio": 0.5, "friction": 0.2}
    branch = followed(HANGING, 1.25, 1.22, largest_step=0.004, **case)
    name, value = branch.events()[0]
    assert name == "neimark_sacker"
    state = branch.points[branch.values.tolist().index(value)].state

    def solved(ratio):
        return periodic(HANGING, speed_ratio=ratio, initial=state, keep="section", **case)

    def excess(ratio):
        return float(abs(solved(ratio).multipliers[0]) - 1.0)

    assert brentq(excess, value - 1e-4, value + 1e-4, xtol=1e-12) == pytest.approx(value, abs=1e-8 * 0.03)
    away = []
    for change in (1e-3, -1e-3):
        motion = solved(value * (1.0 + change)).record.sections["section_vertical"][0]
        record = settled(HANGING, value * (1.0 + change), state, 0, 3000, **case)
        away.append(np.abs(record.sections["section_vertical"] - motion) / abs(motion))
    assert away[0][-50:].max() < 1e-4 * away[0][:50].max()
    assert away[1][-50:].max() > 5 * away[1][:50].max()  # to a torus of 2.5 % of the motion
    assert REGIME[record.regime] == "quasi_periodic"


def test_unstable_motion_is_left_at_the_rate_of_its_largest_multiplier():
    """From its own state, solved to 1e-10: a simulation spirals out by what the multipliers say."""
    case = {"clearance_ratio": 0.5, "friction": 0.2}
    stable = periodic(HANGING, speed_ratio=1.24, transient=300, keep=(), **case)
    state = stable.state
    for ratio in (1.235, 1.23, 1.225, 1.22):
        motion = periodic(HANGING, speed_ratio=ratio, initial=state, keep=(), **case)
        state = motion.state
    assert not motion.is_stable
    record = settled(HANGING, 1.22, state, 0, 220, **case)
    section = record.sections["section_vertical"] + 1j * record.sections["section_horizontal"]
    away = np.abs(section - section[0])
    span = np.flatnonzero((away > 1e-11) & (away < 1e-6))
    rate = np.polyfit(np.arange(span[0], span[-1]), np.log(away[span[0] : span[-1]]), 1)[0]
    assert rate == pytest.approx(np.log(abs(motion.multipliers[0])), rel=0.02)
