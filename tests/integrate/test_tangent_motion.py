"""The tangent carried along a trail against the saltation matrices of the same events, formed one by one."""

import math

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc import simulate
from rubhpc.integrate.case import march_of
from rubhpc.integrate.marches import met_modes
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.saltation import carried
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.integrate.setup import prepare
from rubhpc.integrate.tangent_motion import TangentMotion, _ModesOfTrail
from rubhpc.study.study import Contact, Integrator, Recording

SPEED, CLEARANCE, FRICTION, N_REVOLUTION = 170.0, 80e-6, 0.2, 6
SOFT = {"law": "penalty", "stiffness": 1e6, "damping": 20.0}
LAWS = [{}, {"restitution": 0.5}, {"friction_law": "coulomb"}, SOFT, SOFT | {"friction_law": "coulomb"}]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: "-".join(map(str, law.values())) or "sliding")
def test_tangent_is_that_of_the_saltation_matrices(law):
    rig = trial_rig(3)
    record = simulate(
        rig,
        speed=SPEED,
        clearance=CLEARANCE,
        friction=FRICTION,
        transient=5,
        revolutions=1,
        samples_per_revolution=64,
        **law,
    )
    setup = prepare(rig, SPEED, contact=Contact(**law), integrator=Integrator(), samples_per_revolution=64)

    def start(state):
        return march_of(setup.scheme, setup)(setup, CLEARANCE, FRICTION, state, None)

    tangent = TangentMotion(start, record.final, setup, Recording(samples_per_revolution=64))
    found = [tangent.part(1) for _ in range(N_REVOLUTION)]
    motion = PiecewiseMotion(setup, CLEARANCE, FRICTION, record.final)
    displacement, known, n_event = np.cos(np.arange(2.0 * motion.n)), [], 0
    begin, states = motion.start, motion.states
    for _ in range(N_REVOLUTION):
        revolution = motion.revolve(begin, states)
        n_event += len(revolution.pieces) - 1
        displacement = carried(motion, revolution, displacement[:, np.newaxis])[:, 0]
        known.append(math.log(motion.size(displacement)))
        displacement /= motion.size(displacement)
        begin, states = revolution.end, revolution.states
    assert n_event > 2 * N_REVOLUTION
    assert found == pytest.approx(known, abs=1e-4)


def test_contact_modes_without_room_are_read_once(monkeypatch):
    """Tables that hold fewer modes than a motion meets: the same tangent, and each read once a trail."""
    rig = trial_rig(3)
    record = simulate(
        rig,
        speed=SPEED,
        clearance=40e-6,
        friction=FRICTION,
        transient=5,
        revolutions=1,
        samples_per_revolution=64,
    )

    def tangent():
        setup = prepare(rig, SPEED, contact=Contact(), integrator=Integrator(), samples_per_revolution=64)

        def start(state):
            return march_of(setup.scheme, setup)(setup, 40e-6, FRICTION, state, None)

        return TangentMotion(start, record.final, setup, Recording(samples_per_revolution=64))

    expected = tangent().part(N_REVOLUTION)
    read, n_asked, trails = [], [], []
    exponents, placed = EventDrivenMarch.exponents, _ModesOfTrail.placed
    begin = _ModesOfTrail.__init__

    def begun(modes, trail, march):
        begin(modes, trail, march)
        trails.append(len(modes._states))

    monkeypatch.setattr(_ModesOfTrail, "__init__", begun)
    monkeypatch.setattr(EventDrivenMarch, "exponents", lambda m, s: read.append(s) or exponents(m, s))
    monkeypatch.setattr(_ModesOfTrail, "placed", lambda modes: n_asked.append(1) or placed(modes))
    monkeypatch.setattr(ModeLibrary, "_most_modes", 4)
    monkeypatch.setattr(met_modes, "MOST_REFILLS", 1000)
    assert tangent().part(N_REVOLUTION) == expected
    assert len(n_asked) > 2 * len(trails)
    assert len(read) <= sum(trails)
