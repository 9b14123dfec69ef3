"""The tangent carried along a trail against the saltation matrices of the same events, formed one by one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, simulate
from trial_rig import trial_rig

from rubhpc import LumpedStator
from rubhpc.integrate import tangent_motion
from rubhpc.integrate.case import MARCHES
from rubhpc.integrate.marches import met_modes
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.saltation import carried
from rubhpc.integrate.periodic_motions.shooting import shoot
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.integrate.setup import prepare
from rubhpc.integrate.tangent_motion import TangentMotion, _ModesOfTrail, _motion_at
from rubhpc.integrate.transient import pass_revolutions
from rubhpc.kernels import trail
from rubhpc.study.study import Integrator, Recording

SPEED, CLEARANCE, FRICTION, N_REVOLUTION = 170.0, 80e-6, 0.2, 6
LAWS = [{}, {"restitution": 0.5}]


def ring(count):
    """The rig with so many equal stators."""
    rig = trial_rig(1)
    angles = 2.0 * math.pi * np.arange(count) / count
    return replace(rig, stator=tuple(replace(rig.stator[0], angle=float(angle)) for angle in angles))


def walls():
    """The rig in a ring of rigid walls, whose impulses are more than the ways in which they move it."""
    return replace(trial_rig(1), stator=(LumpedStator(node=3, count=5, rigid=True),))


def prepared(rig, speed, law):
    """A set-up, and what starts its march from a state."""
    setup = prepare(rig, speed, contact=Contact(**law), integrator=Integrator(), samples_per_revolution=64)
    return setup, lambda state: MARCHES[setup.scheme](setup, CLEARANCE, FRICTION, state, None)


def ended(rig, speed, transient, law):
    """Where a case ends."""
    given = {"clearance": CLEARANCE, "friction": FRICTION, "samples_per_revolution": 64, "keep": ()}
    return simulate(rig, speed=speed, transient=transient, revolutions=1, **given, **law).final


@pytest.mark.parametrize(
    ("rig", "law"),
    [*((trial_rig(3), law) for law in LAWS), (ring(16), {}), (walls(), {})],
    ids=["sliding", "restitution", "ring", "walls"],
)
def test_tangent_is_that_of_the_saltation_matrices(rig, law):
    final = ended(rig, SPEED, 5, law)
    setup, start = prepared(rig, SPEED, law)
    tangent = TangentMotion(start, final, setup, Recording(samples_per_revolution=64))
    found = [tangent.part(1) for _ in range(N_REVOLUTION)]
    motion = PiecewiseMotion(setup, CLEARANCE, FRICTION, final)
    displacement, known, n_event = np.cos(np.arange(2.0 * motion.n)), [], 0
    begin, states = motion.start, motion.states
    for _ in range(N_REVOLUTION):
        revolution = motion.revolve(begin, states)
        n_event += len(revolution.pieces) - 1
        displacement = carried(motion, revolution.rows, displacement[:, np.newaxis])[:, 0]
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
            return MARCHES[setup.scheme](setup, 40e-6, FRICTION, state, None)

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


@pytest.mark.parametrize("law", LAWS, ids=["sliding", "restitution"])
def test_a_trail_without_room_for_the_events_is_passed_in_parts(monkeypatch, law):
    """Fewer revolutions at once, and the same tangent; in none is a second motion followed."""
    rig = trial_rig(3)
    final = ended(rig, SPEED, 5, law)

    def tangent():
        setup, start = prepared(rig, SPEED, law)
        return TangentMotion(start, final, setup, Recording(samples_per_revolution=64))

    at_once = tangent()
    expected = [at_once.part(1) for _ in range(N_REVOLUTION)]
    most = int(at_once._spare.n_event[0]) // 2
    monkeypatch.setattr(trail, "MOST_EVENTS", most)
    in_parts = tangent()
    assert [in_parts.part(1) for _ in range(N_REVOLUTION)] == pytest.approx(expected, abs=1e-6)
    assert in_parts._spare.tick.size == most
    assert in_parts._most_at_once < tangent_motion.MOST_AT_ONCE
    assert in_parts._beside is None


def solved(setup, final):
    """The periodic motion of period 1 that a case has come to."""
    motion = PiecewiseMotion(setup, CLEARANCE, FRICTION, final)
    return motion, shoot(motion, motion.start, motion.states, 1)


@pytest.mark.parametrize("law", LAWS, ids=["sliding", "restitution"])
def test_on_a_periodic_motion_it_is_the_monodromy_matrix(law):
    """Period by period, whose sum goes with the logarithm of the largest multiplier to a bounded rest."""
    rig, speed = trial_rig(2), 230.0
    setup, start = prepared(rig, speed, law)
    motion, orbit = solved(setup, ended(rig, speed, 100, law))
    assert len(orbit.revolutions[0].pieces) > 2
    state = motion.march.state_of(orbit.motion, motion.contact_force(orbit.states, orbit.motion))
    tangent = TangentMotion(start, state, setup, Recording(samples_per_revolution=64))
    found = [tangent.part(1) for _ in range(160)]
    known, displacement = [], np.cos(np.arange(2.0 * motion.n))
    displacement /= motion.size(displacement)
    for _ in found:
        displacement = orbit.monodromy @ displacement
        known.append(math.log(motion.size(displacement)))
        displacement /= motion.size(displacement)
    assert found[1:] == pytest.approx(known[1:], abs=1e-4)
    assert sum(found[32:]) == pytest.approx(128 * math.log(abs(orbit.multipliers[0])), abs=4.0)


def recorded(rig, speed, law, clearance, n_revolution):
    """A march from the end of a transient through a record, and the trail of that."""
    given = {"clearance": clearance, "friction": FRICTION, "samples_per_revolution": 64, "keep": ()}
    state = simulate(rig, speed=speed, transient=60, revolutions=1, **given, **law).final
    setup = prepare(rig, speed, contact=Contact(**law), integrator=Integrator(), samples_per_revolution=64)
    march = MARCHES[setup.scheme](setup, clearance, FRICTION, state, None)
    noted, recording = march.new_trail(), Recording(samples_per_revolution=64, revolutions=n_revolution)
    march.keep(noted)
    assert pass_revolutions(march, recording, n_revolution) is None
    clock = march.clock
    noted.tick[: noted.n_event[0]] += n_revolution * clock.samples_per_revolution << clock.sample_level
    return setup, march, noted, recording


@pytest.mark.parametrize("law", LAWS, ids=["sliding", "restitution"])
def test_a_motion_is_read_from_its_trail(law):
    """At the end of each revolution, and while pairs stick: as it is reached."""
    _, march, noted, _ = recorded(trial_rig(3), SPEED, law, CLEARANCE, 1)
    ticks = march.clock.samples_per_revolution << march.clock.sample_level
    assert noted.n_event[0] > 0
    assert _motion_at(noted, march, ticks) == pytest.approx(march.motion(), rel=1e-9, abs=1e-12)
