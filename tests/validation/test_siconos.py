"""Friction and impact held to Siconos, an independent code: stick, reversal, two stators, restitution."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from lone_bodies import body, set_up, set_up_modal, tip
from siconos_reference import CASES, CLEARANCE, DISC, DURATION, N_SAMPLE, RADIUS, STORED, spin_of, stator

from rubhpc import State
from rubhpc.integrate.case import run_case
from rubhpc.study.study import Contact, Recording

DEGREES = ((1, "v"), (1, "w"), (1, "thx"))
SCHEMES = {  # in steps of 0.5 us
    "central-difference": partial(set_up, steps_per_sample=300),
    "modal": partial(set_up_modal, step=0.5e-6),
}


def computed(name, scheme, friction_law="coulomb"):
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
    contact = Contact(friction_law=friction_law, restitution=restitution or None)
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


def test_steady_sliding_would_not_do():
    """Where the slip turns round, the law of steady sliding goes another way."""
    found, _ = computed("reversal", "central-difference", friction_law="sliding")
    with np.load(STORED) as stored:
        assert apart(found, stored["reversal"][:N_SAMPLE]).max() > 0.1


def test_pairs_stick_where_siconos_says_so():
    """A pair that sticks moves with the rim: the tip's lateral motion follows it, at no slip."""
    found, record = computed("stick", "modal")
    one = stator(CASES["stick"][3][0])
    across = np.array([-np.sin(one["angle"]), np.cos(one["angle"])])
    rim = found[:, :2] @ across + RADIUS * found[:, 2]
    interval = DURATION / N_SAMPLE
    slip = RADIUS * record.spin_speed + np.diff(rim - found[:, 4]) / interval
    touching = record.contact_force[0, : N_SAMPLE - 1] > 0
    throughout = touching[:-2] & touching[1:-1] & touching[2:]  # a contact may begin or end between samples
    assert np.count_nonzero(abs(slip[1:-1][throughout]) < 1e-9) > 10
