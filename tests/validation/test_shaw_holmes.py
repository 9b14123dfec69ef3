"""Periodic motions of an impact oscillator, x'' + 2 z x' + x = cos w t against a wall in the middle.

S. W. Shaw and P. Holmes, J. Sound Vib. 90 (1983) 129-155: speed of the one impact a period, and multipliers,
in closed form.
"""

import math

import numpy as np
import pytest
from lone_bodies import body, set_up_modal, tip
from scipy.optimize import brentq

from rubhpc import State
from rubhpc.integrate.periodic_motion import find_periodic_motion
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.revolution import cut
from rubhpc.integrate.periodic_motions.saltation import carried
from rubhpc.study.initial import Initial
from rubhpc.study.study import Contact, Recording

WALL = tip(body(1.0, 1.0, ((1, "axial"),)), 0.0, axial=-1)  # it is held
RECORDING = Recording(transient=20, samples_per_revolution=64, keep=())


def solve(frequency, damping, restitution, initial=None, period=1):
    oscillator = body(1.0, 1.0, ((1, "v"),), damping=2 * damping)
    setup = set_up_modal(
        oscillator, [WALL], frequency, 64, Contact(restitution=restitution), force=[1.0], step=1e-4
    )
    return find_periodic_motion(
        setup,
        clearance=0.0,
        friction=0.0,
        period=period,
        repeat=1,
        recording=RECORDING,
        initial=initial or Initial(),
    )


def with_one_impact(frequency, damping, restitution):
    """The motion with one impact a period, wherever it is stable: followed from 2.2 in small steps."""
    found = solve(2.2, damping, restitution)
    for w in np.arange(2.2, frequency, 0.05)[1:]:
        found = solve(w, damping, restitution, found.state)
    return solve(frequency, damping, restitution, found.state)


@pytest.mark.parametrize(
    ("frequency", "damping", "restitution", "speed", "multipliers"),
    [
        (2.2, 0.0, 0.7, 1.8608586, (0.559262 + 0.420982j, 0.559262 - 0.420982j)),
        (2.4, 0.0, 0.8, 0.8584410, (0.176268 + 0.780339j, 0.176268 - 0.780339j)),
        (2.6, 0.0, 0.8, 0.5054400, (-0.574540 + 0.556690j, -0.574540 - 0.556690j)),
        (2.8, 0.02, 0.75, 0.3444129, (-2.680175, -0.191857)),
    ],
)
def test_impact_speed_and_multipliers_are_those_in_closed_form(
    frequency, damping, restitution, speed, multipliers
):
    motion = with_one_impact(frequency, damping, restitution)
    assert motion.residual < 1e-10
    assert [(event.kind, event.stator) for event in motion.events] == [("touch", 0)]
    assert motion.events[0].approach == pytest.approx(speed, abs=1e-7)
    assert motion.multipliers[:2] == pytest.approx(np.array(multipliers), abs=1e-6)
    assert motion.is_stable == (abs(multipliers[0]) < 1)
    product = restitution**2 * math.exp(-2 * damping * 2 * math.pi / frequency)
    assert np.linalg.det(motion.monodromy) == pytest.approx(product, rel=1e-9)


def test_period_doubles_where_the_closed_form_has_it():
    """At w = 2.65334773 for z = 0, e = 0.8; beyond it the motion of two impacts is stable."""
    near = with_one_impact(2.65, 0.0, 0.8).state

    def excess(frequency):
        return float(np.linalg.det(solve(frequency, 0.0, 0.8, near).monodromy + np.eye(2)))

    assert brentq(excess, 2.645, 2.66, xtol=1e-10) == pytest.approx(2.65334773, abs=2e-8)


def test_motion_of_two_periods_is_stable_beyond_the_doubling():
    once = with_one_impact(2.66, 0.0, 0.8)
    assert not once.is_stable
    growth, direction = np.linalg.eig(once.monodromy)
    aside = 0.05 * direction[:, np.argmin(growth.real)].real
    state = State(
        rotor_displacement=once.state.rotor_displacement + aside[0],
        rotor_velocity=once.state.rotor_velocity + aside[1],
        stator_displacement=once.state.stator_displacement,
        stator_velocity=once.state.stator_velocity,
        contact_force=np.zeros(1),
    )
    twice = solve(2.66, 0.0, 0.8, state, period=2)
    assert twice.period == 2
    assert twice.is_stable
    assert len(twice.events) == 2
    assert abs(twice.events[0].approach - twice.events[1].approach) > 1e-3


def test_volume_shrinks_by_damping_and_impacts():
    """Of two masses: log|det| is the trace of the damping over the time, and log|det S| of every impact."""
    restitution = 0.8
    masses = body(np.diag([1.0, 2.0]), [[2.0, -1.0], [-1.0, 1.5]], ((1, "v"), (1, "w")), damping=0.1)
    setup = set_up_modal(
        masses, [WALL], 1.3, 64, Contact(restitution=restitution), force=[1.0, 0.0], step=1e-4
    )
    case = {"clearance": 0.0, "friction": 0.0}
    motion = find_periodic_motion(setup, **case, period=1, repeat=1, recording=RECORDING, initial=Initial())
    piecewise = PiecewiseMotion(setup, *case.values(), motion.state)
    revolution = piecewise.revolve(piecewise.start, piecewise.states)
    pieces = revolution.pieces
    assert [piece.states for piece in pieces] == [0] * len(pieces)
    expected = -np.trace(piecewise.bodies.damping) * piecewise.turn
    for k in range(len(pieces) - 1):
        at_once = cut(revolution.rows, k, k + 2)
        at_once = at_once._replace(
            times=np.zeros((2, 2)), states=at_once.states * [[1, 1, 1, 1], [1, 0, 1, 1]]
        )
        jump = carried(piecewise, at_once, np.eye(2 * piecewise.n))
        # Along the rate the motion goes on; across it the gap opens at its restitution, in place and speed.
        assert np.linalg.det(jump) == pytest.approx(restitution**2, rel=1e-9)
        expected += 2 * math.log(restitution)
    sign, logarithm = np.linalg.slogdet(motion.monodromy)
    assert len(pieces) > 1
    assert sign == 1
    assert logarithm == pytest.approx(expected, abs=1e-9)
