"""Derivatives of a revolution by its beginning: finite differences, determinants, exact zeros."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from closed_form import Contact, read_rig
from set_ups import prepared
from trial_rig import trial_rig

from rubhpc import LumpedStator
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency
from rubhpc.integrate.case import run_case
from rubhpc.integrate.periodic_motions.collocated_motion import CollocatedMotion
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.saltation import monodromy
from rubhpc.rig.reading import with_keys
from rubhpc.study.study import Recording

PAPER = read_rig("mokhtar2017")
SPRINGS = LumpedStator(node=8, radius=0.06, count=8, mass=1e-3, damping=2.0, stiffness=1e5)
RING = replace(PAPER, stator=(SPRINGS,))
WALLS = replace(PAPER, stator=(LumpedStator(node=8, radius=0.06, count=5, rigid=True),))
OVERHUNG = with_keys(PAPER, {"rotor.bearing.2.node": 5})
HEAVY = with_keys(trial_rig(2), {"rotor.gravity": "9.81 m/s^2"})
SLIDING = Contact()


def motion_of(rig, ratio, clearance_ratio, friction, contact=SLIDING, transient=20, follow=PiecewiseMotion):
    model = assemble(rig)
    spin = ratio * first_lateral_frequency(model)
    clearance = clearance_ratio * contact_free_amplitude(model, spin)
    setup = prepared(rig, spin, contact=contact, model=model)
    record = run_case(
        setup,
        clearance=clearance,
        friction=friction,
        recording=Recording(transient=transient, revolutions=1, samples_per_revolution=64, keep=()),
    )
    return follow(setup, clearance, friction, record.final)


def differences(motion, motions, states, step=1e-7):
    """Derivative of a revolution's end by its beginning, column by column."""
    columns = []
    for k in range(2 * motion.n):
        change = np.zeros(2 * motion.n)
        change[k] = step * motion.size(motions) / (motion.setup.spin if k < motion.n else 1.0)
        ahead, behind = (motion.revolve(motions + sign * change, states).end for sign in (1, -1))
        columns.append((ahead - behind) / (2 * change[k]))
    return np.array(columns).T


CASES = {
    "one stator": (PAPER, 1.7, 0.7, 0.3, SLIDING),
    "three stators": (trial_rig(3), 1.3, 0.8, 0.1, SLIDING),
    "ring, always in contact": (RING, 1.2, 0.6, 0.05, SLIDING),
    "backward spin": (trial_rig(2), -1.3, 0.7, 0.2, SLIDING),
    "restitution": (PAPER, 1.7, 0.7, 0.3, Contact(restitution=0.5)),
    "overhung": (OVERHUNG, 0.9, 0.5, 0.2, SLIDING),
    "gravity": (HEAVY, 1.2, 0.7, 0.2, SLIDING),
    "rigid walls": (WALLS, 0.9, 0.9, 0.1, SLIDING),
    "rigid walls, restitution": (WALLS, 0.9, 0.9, 0.1, Contact(restitution=0.5)),
}


@pytest.mark.parametrize("name", CASES)
def test_derivative_is_that_of_finite_differences(name):
    motion = motion_of(*CASES[name])
    revolution = motion.revolve(motion.start, motion.states)
    assert len(revolution.pieces) > 1
    found = monodromy(motion, [revolution])
    scale = np.repeat([motion.setup.spin, 1.0], motion.n)
    error = (found - differences(motion, motion.start, motion.states)) * scale[:, None] / scale
    size = found * scale[:, None] / scale
    assert np.abs(error).max() < 1e-6 * np.abs(size).max()


SPRING = Contact(law="penalty", stiffness=5e6, damping=400.0)
BY_STEPS = {
    "damped penalty": SPRING,
    "penalty": replace(SPRING, damping=0.0),
    "Coulomb": Contact(friction_law="coulomb"),
    "Coulomb, restitution": Contact(friction_law="coulomb", restitution=0.5),
}


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6])
@pytest.mark.parametrize("name", BY_STEPS)
def test_derivative_by_steps_is_that_of_finite_differences(name, accuracy):
    """Of the change that decays most slowly: no step follows what a damper sets going at a touch."""
    stiff = with_keys(PAPER, {"stator.youngs_modulus": "30 GPa"})
    follow = partial(CollocatedMotion, accuracy=accuracy)
    motion = motion_of(stiff, 1.1, 0.23, 0.1, BY_STEPS[name], 60, follow)
    revolution = motion.revolve(motion.start, motion.states)
    assert len(revolution.pieces) > 2
    value, shape = np.linalg.eig(motion.monodromy([revolution]))
    slowest = np.argmax(abs(value))
    change = shape[:, slowest].real * 1e-4 * motion.size(motion.start) / motion.size(shape[:, slowest].real)
    ahead, behind = (motion.revolve(motion.start + sign * change, motion.states).end for sign in (1, -1))
    found = motion.monodromy([revolution]) @ change
    assert motion.size(found - (ahead - behind) / 2) < 2e-3 * motion.size(found)
