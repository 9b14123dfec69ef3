"""A penalty with set-valued friction from event to event: energy, time stepping, states and shooting."""

import numpy as np
import pytest
from closed_form import Contact, simulate
from record_distance import largest_difference
from trial_rig import trial_rig

from rubhpc import State
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.saltation import monodromy
from rubhpc.integrate.setup import prepare
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, state_of
from rubhpc.schema import SCHEMES
from rubhpc.study.study import Integrator

PENALTY = {"law": "penalty", "stiffness": 1e7, "friction_law": "coulomb"}
WHIP = {"speed": 120.0, "clearance": "20 um", "friction": 0.6} | PENALTY  # of the trial rig


@pytest.mark.parametrize("damping", [0.0, 300.0])
def test_energy_is_kept_where_slip_turns(damping):
    """A rim of half a millimetre is slow: the tips outrun it."""
    given = WHIP | {"speed": 170.0, "friction": 0.2, "damping": damping, "transient": 0, "revolutions": 4}
    record = simulate(trial_rig(3, radius=5e-4), **given)
    assert SCHEMES[record.scheme] == "event_driven"
    assert record.reversals_per_revolution.max() > 0.0
    assert 0.1 < record.stick_fraction.min() < 0.95
    assert record.energy_residual < 1e-9


@pytest.fixture(scope="module")
def whipping():
    """Three revolutions of the whip, in which its pairs have begun to stick."""
    record = simulate(trial_rig(3), **WHIP, damping=300.0, transient=0, revolutions=3)
    assert record.final.contact_force.max() > 1.0
    return record.final


def test_central_difference_is_the_same_motion(whipping):
    given = WHIP | {"damping": 300.0, "transient": 0, "revolutions": 1, "initial": whipping}
    exact = simulate(trial_rig(3), **given, accuracy=1e-6)
    stepped = simulate(trial_rig(3), **given, method="central-difference", step="0.4 us")
    assert exact.stick_fraction.min() > 0.5
    assert largest_difference(exact, stepped) < 1e-3


def test_monodromy_is_the_derivative_of_the_flow(whipping):
    contact = Contact(**PENALTY, damping=300.0)
    setup = prepare(trial_rig(3), 120.0, contact=contact, integrator=Integrator(), samples_per_revolution=64)
    motion = PiecewiseMotion(setup, 20e-6, 0.6, whipping)
    revolution = motion.revolve(motion.start, motion.states, share=0.3)
    q = len(setup.model.stators)
    assert any(state_of(piece.states, i) == STUCK for piece in revolution.pieces for i in range(q))
    derivative = monodromy(motion, [revolution])
    rng = np.random.default_rng(1)
    for _ in range(3):
        along = rng.standard_normal(motion.start.size)
        along[: motion.n] /= setup.spin
        step = 1e-8 * motion.size(motion.start) * along / motion.size(along)
        ends = [motion.revolve(motion.start + sign * step, motion.states, share=0.3).end for sign in (1, -1)]
        difference = 0.5 * (ends[0] - ends[1])
        assert motion.size(difference - derivative @ step) < 1e-4 * motion.size(derivative @ step)


def test_states_follow_from_gap_force_and_slip():
    """One pair without a load: its gap closes it, its force opens it, and it sticks where its slip ends."""
    contact = Contact(**PENALTY, damping=1e3)
    setup = prepare(
        trial_rig(1), 120.0, contact=contact, integrator=Integrator(accuracy=0.1), samples_per_revolution=64
    )
    march = PiecewiseMotion(setup, 20e-6, 0.6, State.at_rest(setup.model)).march
    bodies, rim = march.bodies, 120.0 * setup.model.stators[0].radius
    basis = np.linalg.pinv(np.stack([bodies.gap_jacobian[0], bodies.slip[0]]))
    lifted = 1 << 2

    def after(states, crossing, gap, rate, slip):
        """States after an event at which the pair has this gap (m), its rate and slip (m/s)."""
        displacement = basis @ [gap - bodies.clearance[0], 0.0]
        return march.change(states, crossing, 0.0, np.concatenate([displacement, basis @ [rate, slip - rim]]))

    assert after(OPEN, 1, -1e-13, -0.1, rim) == FORWARD
    assert after(OPEN, 1, -1e-13, -0.1, -rim) == BACKWARD
    assert after(FORWARD, 1, -1e-6, 1e-2, rim) == lifted
    assert after(lifted, 1, -1e-6, 1e-2, rim) == FORWARD
    assert after(lifted, 1, 1e-6, -1e-3, rim) == OPEN
    assert after(lifted, 0, 1e-6, 1e-3, rim) == OPEN
    assert after(FORWARD, 2, -1e-5, 0.0, 1e-12) == STUCK
    assert after(STUCK, 0, -1e-5, 0.0, 0.0) == STUCK
    assert after(BACKWARD, 0, -1e-5, 0.0, -rim) == BACKWARD
