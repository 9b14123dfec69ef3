"""A penalty from event to event: shooting, and states that follow from gap and force."""

import numpy as np
import pytest
from closed_form import Contact, periodic, read_rig, simulate

from rubhpc import State
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.setup import prepare
from rubhpc.kernels.penalty_events import change_pressed, pressed_pairs
from rubhpc.schema import REGIME
from rubhpc.study.study import Integrator


def test_shooting_meets_the_motion_and_its_decay():
    """A touch jumps by the damper's force: without its saltation matrix the multipliers would be off."""
    given = {"speed_ratio": 0.75, "clearance": "100 um", "law": "penalty", "stiffness": 1e8, "damping": 2e3}
    solved = periodic("mokhtar2017", **given, period=2)
    assert solved.is_stable
    assert [event.kind for event in solved.events] == ["touch", "release"] * (len(solved.events) // 2)
    settled = simulate("mokhtar2017", **given, transient=240, revolutions=16)
    assert settled.period == 2
    assert settled.regime == REGIME.index("periodic")
    assert settled.largest_multiplier == pytest.approx(abs(solved.multipliers[0]), rel=1e-4)
    n = min(settled.vertical.size, solved.record.vertical.size)
    assert solved.record.vertical[:n] == pytest.approx(settled.vertical[:n], abs=1e-10)


def test_states_follow_from_gap_and_force():
    """One pair: open, pressed, and lifted, which no force of the damper may pull back."""
    setup = prepare(
        read_rig("mokhtar2017"),
        300.0,
        contact=Contact(law="penalty", stiffness=1e6, damping=1e3),
        integrator=Integrator(),
        samples_per_revolution=64,
    )
    bodies = PiecewiseMotion(setup, 90e-6, 0.0, State.at_rest(setup.model)).bodies
    n, along = bodies.gap_jacobian.shape[1], bodies.gap_jacobian[0]
    unit = along / (along @ along)

    def moving(gap, rate):
        motion = np.concatenate([unit * (gap - bodies.clearance[0]), unit * rate])
        assert motion.size == 2 * n
        return motion

    opened, pressed, lifted = 0, 1, 2
    states = [(1e-6, -1.0, opened), (-1e-6, -1.0, pressed), (-1e-6, 1e-4, pressed), (-1e-6, 1.0, lifted)]
    for gap, rate, state in states:
        assert pressed_pairs(bodies, moving(gap, rate)) == state
    assert change_pressed(bodies, opened, 1, moving(-1e-13, -1.0)) == pressed
    assert change_pressed(bodies, pressed, 1, moving(-1e-6, 1e-3)) == lifted
    assert change_pressed(bodies, lifted, 1, moving(-1e-6, 1e-3)) == pressed
    assert change_pressed(bodies, lifted, 1, moving(1e-6, -1e-3)) == opened
    assert change_pressed(bodies, lifted, 0, moving(1e-6, 1.0)) == opened
    assert change_pressed(bodies, pressed, 0, moving(-1e-6, -1.0)) == pressed
