"""A march under Coulomb's law: how friction comes to slide, and a case begun again."""

import numpy as np
import pytest
from closed_form import Contact
from trial_rig import trial_rig

from rubhpc import State
from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.integrate.marches.workspace import empty_workspace
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.setup import prepare
from rubhpc.kernels._jit import plain
from rubhpc.kernels.friction_change import state_by_forces
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, STUCK, state_of
from rubhpc.study.study import Integrator

PER_REVOLUTION = 64


def whip():
    """Three stators that stick and slide in turns."""
    contact = Contact(friction_law="coulomb")
    setup = prepare(
        trial_rig(3), 120.0, contact=contact, integrator=Integrator(), samples_per_revolution=PER_REVOLUTION
    )
    return FrictionMarch(setup, 20e-6, 0.6, State.at_rest(setup.model), None)


def advance(march, n_revolution):
    q = march.touching().size
    first = -n_revolution * PER_REVOLUTION
    nothing = empty_samples(march.n_place, 0), new_accumulator(q)
    assert march.advance(first, 0, *nothing, is_recorded=False) is None
    return march.motion()


@pytest.mark.parametrize(
    ("short", "leaves", "state"),
    [(1e-5, True, FORWARD), (1e-5, False, STUCK), (1e-2, True, STUCK), (0.0, False, FORWARD)],
)
def test_friction_that_leaves_its_cone_slides_a_tick_before_it_is_outside(short, leaves, state):
    solver = empty_workspace(1)
    solver.force[0], solver.cone[0] = 2.0, 0.3
    for sign, slides in ((1.0, FORWARD), (-1.0, BACKWARD)):
        solver.traction[0] = sign * 0.6 * (1.0 - short)
        assert plain(state_by_forces)(solver, 0, leaves) == (STUCK if state == STUCK else slides)


def test_no_end_of_stick_is_met_twice():
    """Events are those of pieces, whose ends are found to rounding and not to the tick before."""
    march = whip()
    advance(march, 4)
    state = march.final()
    assert march.start_again(state)
    followed = PiecewiseMotion(march._setup, 20e-6, 0.6, state)
    pieces = followed.revolve(followed.start, followed.states).pieces
    stuck = [sum(state_of(piece.states, i) == STUCK for i in range(3)) for piece in pieces]
    assert np.count_nonzero(np.diff(stuck) < 0) > 5
    advance(march, 1)
    assert march.progress.n_event == len(pieces) - 1


def test_a_case_begun_anew_is_that_of_a_new_march():
    march = whip()
    advance(march, 2)
    state = march.final()
    advance(march, 1)
    assert march.start_again(state)
    fresh = FrictionMarch(march._setup, 20e-6, 0.6, state, None)
    assert np.array_equal(advance(march, 3), advance(fresh, 3))
