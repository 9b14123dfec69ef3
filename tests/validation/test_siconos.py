"""Friction and impact held to Siconos, an independent code: stick, reversal, two stators, restitution."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from closed_form import Contact
from lone_bodies import body, set_up, set_up_modal, tip
from siconos_reference import CASES, CLEARANCE, DISC, N_SAMPLE, RADIUS, STORED, spin_of, stator

from rubhpc import State
from rubhpc.integrate.case import run_case
from rubhpc.study.study import Recording

DEGREES = ((1, "v"), (1, "w"), (1, "thx"))
SCHEMES = {  # in steps of 0.5 us
    "central-difference": partial(set_up, steps_per_sample=300),
    "modal": partial(set_up_modal, step=0.5e-6),
}


def computed(name, scheme):
    """The motion, (N_SAMPLE, 3 + 2 q), and its record, which is longer where a revolution is."""
    per_revolution, friction, restitution, angles, unbalance, velocity = CASES[name]
    spin = spin_of(per_revolution)
    disc = body(np.diag(DISC["mass"]), np.diag(DISC["stiffness"]), DEGREES)
    disc = replace(disc, damping=np.diag(DISC["damping"]))
    tips = []
    for angle in angles:
        one = stator(angle)
        mount = body(one["mass"] * np.eye(2), np.diag(one["stiffness"]), ((1, "axial"), (1, "lateral")))
        mount = replace(mount, damping=np.diag(one["damping"]))
        tips.append(tip(mount, angle, radius=RADIUS, lateral=1))
    contact = Contact(friction_law="coulomb", restitution=restitution or None)
    force = unbalance * spin**2 * np.array([1.0, -1.0j, 0.0])
    setup = SCHEMES[scheme](disc, tips, spin, per_revolution, contact, force=force)
    record = run_case(
        setup,
        clearance=CLEARANCE,
        friction=friction,
        recording=Recording(
            transient=0,
            revolutions=-(-N_SAMPLE // per_revolution),
            samples_per_revolution=per_revolution,
        ),
        initial=replace(State.at_rest(setup.model), rotor_velocity=np.array(velocity)),
    )
    signals = [record.vertical, record.horizontal, record.torsion]
    for i in range(len(angles)):
        signals += [record.stator_axial[i], record.stator_lateral[i]]
    return np.array(signals).T[:N_SAMPLE], record


def apart(found, known):
    """Greatest distance of each degree's motion, over its greatest value."""
    return abs(found - known).max(axis=0) / abs(known).max(axis=0)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", CASES)
def test_motion_is_that_of_siconos(name, scheme):
    """To what its first order in the step leaves, 1e-4 of the disc's motion and 5e-4 of the stators'."""
    found, record = computed(name, scheme)
    with np.load(STORED) as stored:
        known = stored[name][:N_SAMPLE]
    assert apart(found, known)[:3].max() < 4e-4
    assert apart(found, known)[3:].max() < 2e-3
    assert record.energy_residual < 1e-3
    assert (record.minimum_slip_speed.min() > 0) == (name == "sliding")
