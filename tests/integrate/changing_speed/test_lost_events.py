"""Pieces of a run-up that have missed an event, or whose events have no end, are taken in short steps."""

import numpy as np
import pytest

from rubhpc import read_rig
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.record import State
from rubhpc.integrate.setup import prepare
from rubhpc.study.study import Contact, Integrator


@pytest.mark.parametrize("overlap", [-1e-6, 1e-6])
def test_an_open_pair_that_overlaps_has_missed_an_event(overlap):
    setup = prepare(
        read_rig("mokhtar2017"), 200.0, contact=Contact(), integrator=Integrator(), samples_per_revolution=64
    )
    march = EventDrivenMarch(setup, 1e-4, 0.2, State.at_rest(setup.model), None)
    jacobian, motion = march.bodies.gap_jacobian[0], march.motion()
    n = jacobian.size
    gap = march.bodies.clearance[0] + jacobian @ motion[:n]
    motion[:n] -= jacobian * (gap + overlap) / (jacobian @ jacobian)
    is_open, is_closed, lasts = np.array([False]), np.array([True]), 0.01
    assert march.has_lost_events(100, lasts, motion, is_open) == (overlap > 0.0)
    assert not march.has_lost_events(100, lasts, motion, is_closed)
    assert march.has_lost_events(int(21 * lasts / setup.contact_step), lasts, motion, is_closed)
