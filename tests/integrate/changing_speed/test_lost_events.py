"""Events of run-ups: contacts that share the shaft come to rest; missed events are left to collocation."""

import math

import numpy as np
import pytest
from closed_form import read_rig, run_up
from equal_stators import in_ring
from overhung_pump import pump
from set_ups import prepared

from rubhpc.integrate.case import run_case
from rubhpc.integrate.changing_speed import piece_integrator
from rubhpc.integrate.changing_speed.case import record_run_up
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.record import State
from rubhpc.rig.reading import with_keys
from rubhpc.study.initial import CONTACT_FREE, Initial
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.tables import Recording


@pytest.mark.parametrize("overlap", [-1e-6, 1e-6])
def test_an_open_pair_that_overlaps_has_missed_an_event(monkeypatch, overlap):
    setup = prepared(read_rig("mokhtar2017"), 200.0)
    march = EventDrivenMarch(setup, 1e-4, 0.2, State.at_rest(setup.model), None)
    jacobian, motion = march.bodies.gap_jacobian[0], march.motion()
    n = jacobian.size
    gap = march.bodies.clearance[0] + jacobian @ motion[:n]
    motion[:n] -= jacobian * (gap + overlap) / (jacobian @ jacobian)
    monkeypatch.setattr(march, "motion", lambda: motion)
    march.n_step, lasts = 100, 0.01
    assert march.has_lost_events(lasts) == (overlap > 0.0)
    monkeypatch.setattr(march, "touching", lambda: np.array([True]))
    assert not march.has_lost_events(lasts)
    march.n_step = int(21 * lasts / setup.step)
    assert march.has_lost_events(lasts)


def test_masses_that_carry_a_shaft_come_to_rest_as_the_speed_falls(monkeypatch):
    """Nothing is left to collocation; masses threw each other or themselves open for ever."""
    keys = {"rotor.shaft.density": 7850.0, "rotor.unbalance.radius": 0.03}
    rig = in_ring(with_keys(pump(), keys), 8, first=math.radians(11.5), radius=0.09)
    left = []

    class Noted(piece_integrator.CollocationMarch):
        def __init__(self, *given):
            left.append(self)
            super().__init__(*given)

    monkeypatch.setattr(piece_integrator, "CollocationMarch", Noted)
    found = run_up(
        rig,
        speed_law=[(0.0, "2500 rpm"), (3.0, "5500 rpm"), (4.0, "5500 rpm"), (7.0, "2500 rpm")],
        clearance="150 um",
        friction=0.1,
        samples_per_revolution=128,
    )
    assert not left
    assert np.hypot(found.vertical, found.horizontal).max() == pytest.approx(377.6e-6, rel=1e-3)


def test_contacts_by_collocation_last_as_at_constant_speed():
    """Velocities of interpolated modes are rates of their displacements: else each contact ends at once."""
    rig = in_ring(pump(), 8, first=0.2)
    law = SpeedLaw(time=(0.0, 2.0), speed=(300.0, 315.0))
    recording = Recording(transient=0, revolutions=law.n_revolution, samples_per_revolution=128)
    setup = prepared(rig, 315.0, samples=128, friction_law="coulomb")
    case = {"initial": Initial(from_=CONTACT_FREE), "clearance": 1.5e-4, "friction": 0.05}
    passage = record_run_up(setup, law, recording=recording, **case).measures
    steady = run_case(setup, recording=recording, **case).measures
    assert passage["steps"] < 2.0 * steady["steps"]
