"""The least gap of a periodic motion, its derivative, and what a weak impact there adds."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, periodic, read_rig

from rubhpc.integrate.branches.branching import Branching
from rubhpc.integrate.branches.weak_impact import least_gap
from rubhpc.integrate.periodic_motions.family import Family, Operation
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.study.tables import Integrator

CASE = {"speed_ratio": 0.75, "friction": 0.3}


@pytest.fixture(scope="module")
def point():
    """A motion of two revolutions, of which one touches, little above the clearance at which both do."""
    clearance = 105.5e-6
    motion = periodic("mokhtar2017", clearance=clearance, period=2, keep=(), **CASE)
    operation = Operation(
        rig=read_rig("mokhtar2017"), clearance=clearance, contact=Contact(), integrator=Integrator(),
        samples_per_revolution=256, **CASE,
    )  # fmt: skip
    family = Family(operation, "clearance", (clearance, 1.2 * clearance))
    case = family.at(clearance)
    begun = PiecewiseMotion(case.setup, clearance, CASE["friction"], motion.state)
    return Branching(family, 1e-6).begin(clearance, begun.start, begun.states, 2)


def moved(point, change):
    """The same revolutions of a motion that begins elsewhere: no periodic one."""
    motion = point.motion + change
    revolutions = point.case.follow(motion, point.states, point.period, phase=point.phase)
    return replace(point, motion=motion, revolutions=revolutions)


def test_gradient_is_that_of_differences(point):
    found = least_gap(point, 0)
    assert sum(piece.touching.size for one in point.revolutions for piece in one.pieces) == 1
    interpolated = min(float(one.least_gap[0]) for one in point.revolutions)
    assert found.gap == pytest.approx(interpolated, abs=1e-6 * point.value)
    for seed in range(4):
        change = 1e-6 * np.random.default_rng(seed).standard_normal(point.motion.size) / point.scale
        rise = least_gap(moved(point, change), 0).gap - least_gap(moved(point, -change), 0).gap
        assert found.gradient @ change == pytest.approx(0.5 * rise, rel=1e-6)


def test_weak_impact_is_predicted_to_its_leading_order(point):
    """A motion that passes the wall by a little, beside one that misses it by as much.

    What the damping of high modes adds while the pair touches goes with the depth, the impact with its root.
    """

    def toward(one):
        return -point.motion / (least_gap(one, 0).gradient @ point.motion)

    near = point
    for _ in range(2):  # a gap of a millionth of the clearance
        near = moved(near, 0.99 * least_gap(near, 0).gap * toward(near))
    found, errors = least_gap(near, 0), []
    for share in (4.0, 1.0):
        depth = share * found.gap
        ended = [
            moved(near, (found.gap + way * depth) * toward(near)).revolutions[-1].end for way in (1.0, -1.0)
        ]
        added = ended[0] - ended[1] - near.monodromy @ (2.0 * depth * toward(near))
        expected = found.impact(depth)
        errors.append(np.linalg.norm(near.scale * (added - expected)) / np.linalg.norm(near.scale * expected))
    assert errors[0] == pytest.approx(2.0 * errors[1], rel=0.15)
