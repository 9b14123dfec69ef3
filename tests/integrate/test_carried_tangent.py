"""A displacement carried with a motion, against the saltation matrices of the same events."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import simulate
from equal_stators import in_ring
from set_ups import prepared
from trial_rig import trial_rig

from rubhpc import LumpedStator
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion

SPEED, CLEARANCE, FRICTION, N_REVOLUTION = 170.0, 80e-6, 0.2, 6
LAWS = [{}, {"restitution": 0.5}]


def walls():
    """The rig in a ring of rigid walls, whose impulses are more than the ways in which they move it."""
    return replace(trial_rig(1), stator=(LumpedStator(node=3, count=5, rigid=True),))


def motion_of(rig, law):
    """What follows a case from its end."""
    given = {"clearance": CLEARANCE, "friction": FRICTION, "samples_per_revolution": 64, "keep": ()}
    final = simulate(rig, speed=SPEED, transient=5, revolutions=1, **given, **law).final
    setup = prepared(rig, SPEED, **law)
    return PiecewiseMotion(setup, CLEARANCE, FRICTION, final)


@pytest.mark.parametrize(
    ("rig", "law"),
    [*((trial_rig(3), law) for law in LAWS), (in_ring(trial_rig(1), 16), {}), (walls(), {})],
    ids=["sliding", "restitution", "ring", "walls"],
)
def test_columns_are_those_of_the_monodromy_of_each_revolution(rig, law):
    motion = motion_of(rig, law)
    columns = np.cos(np.outer(np.arange(2.0 * motion.n), [1.0, 2.0, 3.0]))
    motion.stand_at(motion.start, motion.states)
    found = [motion.go_on(columns)]
    for _ in range(1, N_REVOLUTION):
        found.append(motion.go_on(found[-1]))
    revolutions = motion.follow(motion.start, motion.states, N_REVOLUTION)
    assert sum(len(one.pieces) - 1 for one in revolutions) > 2 * N_REVOLUTION
    known = columns
    for moved, revolution in zip(found, revolutions, strict=True):
        known = motion.monodromy([revolution]) @ known
        assert motion.size(moved[:, 0] - known[:, 0]) < 1e-9 * motion.size(known[:, 0])
    motion.stand_at(motion.start, motion.states)
    assert motion.go_on(columns, N_REVOLUTION) == pytest.approx(known, rel=1e-6, abs=1e-6 * abs(known).max())
