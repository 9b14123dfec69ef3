"""The tangent carried along a trail against the saltation matrices of the same events, formed one by one."""

import math

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc import simulate
from rubhpc.integrate.case import march_of
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.saltation import carried
from rubhpc.integrate.setup import prepare
from rubhpc.integrate.tangent_motion import TangentMotion
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
