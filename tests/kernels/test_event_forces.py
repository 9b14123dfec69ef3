"""Forces of events that go as expected, against Lemke's method; in Python: nothing is compiled."""

import numpy as np
import pytest

from rubhpc.integrate.marches.workspace import empty_workspace
from rubhpc.kernels import coulomb_friction, event_forces, lemke
from rubhpc.kernels._jit import plain
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies

NAMES = {
    coulomb_friction: ("solve_members", "solve_lemke"),
    lemke: ("exchange",),
    event_forces: (
        "expected_states",
        "obeys_laws",
        "rub_of",
        "sliding_instead",
        "slip_change",
        "solve_active_pairs",
        "solve_cones",
        "solve_event",
        "solve_rows",
        "solve_states",
        "state_of",
    ),
}


@pytest.fixture(autouse=True)
def in_python(monkeypatch):
    for module, names in NAMES.items():
        for name in names:
            monkeypatch.setattr(module, name, plain(getattr(module, name)))


def event(random, q):
    """Bodies, work space, states and switch functions of an event of q pairs on a rotor, all of them closed.

    Each pair is the tip of a body of its own, at its own angle around the rotor.
    """
    n = 2 + 2 * q
    gap_jacobian, along = np.zeros((2, q, n))
    for i, angle in enumerate(random.uniform(0.0, 2.0 * np.pi, q)):
        radial, tangential = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        gap_jacobian[i, :2], along[i, :2] = -radial, tangential
        gap_jacobian[i, 2 + 2 * i], along[i, 3 + 2 * i] = random.uniform(0.5, 2.0, 2)
    solver = empty_workspace(q)
    solver.matrix[:], solver.coupling[:] = gap_jacobian @ gap_jacobian.T, gap_jacobian @ along.T
    solver.tangential[:] = -along @ gap_jacobian.T, -along @ along.T
    work = event_forces.friction_work(solver, q)
    sliding = random.uniform(0.05, 0.4, q)
    bodies = FrictionBodies(sliding, sliding * random.choice([1.0, 1.3]), *np.zeros((3, q)))
    states = random.choice([FORWARD, BACKWARD, STUCK], q).tolist()
    solver.gap[:] = -random.uniform(0.0, 1.0, q)
    crossing = 0
    for i, state in enumerate(states):
        solver.slip[i] = random.normal() * 0.1
        if state == STUCK:
            solver.is_sticking[i] = random.random() < 0.8
            crossing |= 0 if solver.is_sticking[i] else 1 << (2 * i)
        else:
            solver.slip[i] = (
                abs(solver.slip[i]) * random.choice([1.0, 30.0]) * (1 if state == FORWARD else -1)
            )
            crossing |= int(random.random() < 0.2) << (2 * i + 1)
    return bodies, work, sum(state << (2 * i) for i, state in enumerate(states)), crossing


@pytest.mark.parametrize("feeds_none", [False, True])
def test_forces_that_are_expected_are_those_of_lemkes_method(feeds_none):
    random, n_expected = np.random.default_rng(5), 0
    for _ in range(400):
        bodies, work, states, crossing = event(random, int(random.integers(1, 4)))
        pivots = plain(event_forces.solve_expected)(bodies, states, crossing, work, feeds_none)
        found = np.array([work.solver.force, work.solver.traction])
        n_expected += pivots == 1
        assert plain(event_forces.solve_event)(bodies, work, feeds_none) >= 0
        assert found == pytest.approx(
            np.array([work.solver.force, work.solver.traction]), rel=1e-9, abs=1e-12
        )
    assert 100 < n_expected < 390


def test_a_pair_that_cannot_hold_slides_in_a_second_solution(monkeypatch):
    random, n_second, by_lemke = np.random.default_rng(6), 0, event_forces.solve_event
    monkeypatch.setattr(event_forces, "solve_event", lambda *given: event_forces.UNSOLVED)
    for _ in range(400):
        bodies, work, states, crossing = event(random, int(random.integers(1, 4)))
        if plain(event_forces.solve_expected)(bodies, states, crossing, work, False) == 2:
            n_second += 1
            found = np.array([work.solver.force, work.solver.traction])
            assert by_lemke(bodies, work, False) >= 0
            assert found == pytest.approx(
                np.array([work.solver.force, work.solver.traction]), rel=1e-9, abs=1e-12
            )
    assert n_second > 20


def test_a_pair_without_a_finite_gap_is_expected_open():
    bodies, work, states, crossing = event(np.random.default_rng(1), 3)
    work.solver.gap[1] = np.inf
    assert (plain(event_forces.expected_states)(states, crossing, work) >> 2) & 3 == OPEN
    assert plain(event_forces.solve_expected)(bodies, states, crossing, work, False) >= 0
    assert work.solver.force[1] == work.solver.traction[1] == 0.0
