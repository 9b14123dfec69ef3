"""A displacement carried with a motion, against the saltation matrices of the same events and multipliers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, simulate
from trial_rig import trial_rig

from rubhpc import LumpedStator
from rubhpc.integrate.carried_tangent import CarriedTangent
from rubhpc.integrate.periodic_motions.collocated_motion import CollocatedMotion
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.shooting import shoot
from rubhpc.integrate.setup import prepare
from rubhpc.study.study import Integrator

SPEED, CLEARANCE, FRICTION, N_REVOLUTION = 170.0, 80e-6, 0.2, 6
LAWS = [{}, {"restitution": 0.5}]


def ring(count):
    """The rig with so many equal stators."""
    rig = trial_rig(1)
    angles = 2.0 * math.pi * np.arange(count) / count
    return replace(rig, stator=tuple(replace(rig.stator[0], angle=float(angle)) for angle in angles))


def walls():
    """The rig in a ring of rigid walls, whose impulses are more than the ways in which they move it."""
    return replace(trial_rig(1), stator=(LumpedStator(node=3, count=5, rigid=True),))


def motion_of(rig, speed, transient, law, clearance=CLEARANCE, kind=PiecewiseMotion):
    """What follows a case from its end."""
    given = {"clearance": clearance, "friction": FRICTION, "samples_per_revolution": 64, "keep": ()}
    final = simulate(rig, speed=speed, transient=transient, revolutions=1, **given, **law).final
    setup = prepare(rig, speed, contact=Contact(**law), integrator=Integrator(), samples_per_revolution=64)
    return kind(setup, clearance, FRICTION, final)


@pytest.mark.parametrize(
    ("rig", "law"),
    [*((trial_rig(3), law) for law in LAWS), (ring(16), {}), (walls(), {})],
    ids=["sliding", "restitution", "ring", "walls"],
)
def test_columns_are_those_of_the_monodromy_of_each_revolution(rig, law):
    motion = motion_of(rig, SPEED, 5, law)
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


@pytest.mark.parametrize("kind", [PiecewiseMotion, CollocatedMotion])
@pytest.mark.parametrize("law", LAWS, ids=["sliding", "restitution"])
def test_on_a_periodic_motion_it_grows_as_the_largest_multiplier_says(law, kind):
    """The sum of what it grows goes with the logarithm of that to a bounded rest."""
    motion = motion_of(trial_rig(2), 230.0, 100, law, kind=kind)
    orbit = shoot(motion, motion.start, motion.states, 1)
    assert len(orbit.revolutions[0].pieces) > 2
    tangent = CarriedTangent(motion)
    found = [tangent.part(4) for _ in range(40)]
    assert sum(found[8:]) == pytest.approx(128 * math.log(abs(orbit.multipliers[0])), abs=4.0)
