"""Events of run-ups: contacts that share the shaft come to rest; missed events are left to collocation."""

import numpy as np
import pytest
from closed_form import Contact, read_rig, run_up

from rubhpc import LumpedStator, Rig, Unbalance
from rubhpc.integrate.changing_speed import passing
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.record import State
from rubhpc.integrate.setup import prepare
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor
from rubhpc.study.study import Integrator


@pytest.mark.parametrize("overlap", [-1e-6, 1e-6])
def test_an_open_pair_that_overlaps_has_missed_an_event(monkeypatch, overlap):
    setup = prepare(
        read_rig("mokhtar2017"), 200.0, contact=Contact(), integrator=Integrator(), samples_per_revolution=64
    )
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
    pump = Rotor(
        shaft=(
            ShaftSection(
                length=0.5,
                outer_diameter=0.03,
                elements=5,
                youngs_modulus=2.1e11,
                shear_modulus=8e10,
                density=7850.0,
            ),
        ),
        disc=(Disc(node=6, diameter=0.18, thickness=0.03, density=7850.0),),
        bearing=(
            Bearing(node=1, kyy=2e7, kzz=2e7, cyy=400.0, czz=400.0),
            Bearing(node=4, kyy=2e7, kzz=1e7, kyz=2e6, kzy=-2e6, cyy=900.0, czz=700.0),
        ),
        unbalance=(Unbalance(node=6, mass=0.01, radius=0.03, phase=1.0),),
        torsion=Torsion(fixed_node=1),
        damping=Damping(alpha=10.0, beta=1e-5),
        gravity=9.81,
    )
    ring = tuple(
        LumpedStator(
            node=6, angle=np.deg2rad(11.5 + 45.0 * k), radius=0.09, mass=0.3, stiffness=1e6, damping=300.0
        )
        for k in range(8)
    )
    left = []

    class Noted(passing.CollocationMarch):
        def __init__(self, *given):
            left.append(self)
            super().__init__(*given)

    monkeypatch.setattr(passing, "CollocationMarch", Noted)
    found = run_up(
        Rig(name="pump", rotor=pump, stator=ring),
        speed_law=[(0.0, "2500 rpm"), (3.0, "5500 rpm"), (4.0, "5500 rpm"), (7.0, "2500 rpm")],
        clearance="150 um",
        friction=0.1,
        samples_per_revolution=128,
    )
    assert not left
    assert np.hypot(found.vertical, found.horizontal).max() == pytest.approx(377.6e-6, rel=1e-3)
