"""Every gap, law and kind of machine against an independent code; springs of Hertz against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_answers import CASES, MEASURES, SIGNALS, answers, case_of
from record_distance import MOTIONS
from scipy.integrate import quad, solve_ivp

from rubhpc import LumpedStator, Rig, State, assemble, simulate

ACCURACY = 1e-3
ALLOWED = 2.0  # errors over the accuracy
SHARE = 2e-4  # of the time, in which a pair may stick or touch more or less


@pytest.mark.parametrize("name", CASES)
def test_case_is_that_of_the_independent_code(name):
    """Signals by their rms; what the independent code itself has of error is allowed."""
    rig, case = case_of(name)
    record, known = simulate(rig, transient=0, accuracy=ACCURACY, **case), answers()[name]
    error = dict(zip(SIGNALS + MEASURES, known["error"], strict=True))
    for of in SIGNALS:
        found, expected = np.atleast_2d(getattr(record, of)), np.atleast_2d(known[of])
        most = max(ALLOWED * ACCURACY, error[of]) * math.sqrt(np.mean(expected**2))
        assert math.sqrt(np.mean((found - expected) ** 2)) <= most, of
    for of in MEASURES:
        most = max(ALLOWED * ACCURACY, error[of]) * known[of].max()
        most += SHARE * of.endswith("_fraction")
        assert getattr(record, of) == pytest.approx(known[of], rel=0, abs=most), of


def lone_mass(**law):
    """A free mass that flies at 1 m/s at a wall 1 mm away; the record of 20 ms."""
    wall = LumpedStator(node=1, rigid=True, radius=0.06)
    rig = Rig.from_matrices([[1.0]], K=[[1e-4]], degrees=[(1, "v")], stators=wall, displacement_limit=1.0)
    case = {"speed": 100 * math.pi, "clearance": 1e-3, "friction": 0.0, "initial": {"vertical_velocity": 1.0}}
    return simulate(rig, **case, **law, transient=0, revolutions=1, accuracy=1e-6)


def test_bounce_on_hertz():
    """It lasts 2.94328 d / v, with d the deepest."""
    found = lone_mass(law="hertz", stiffness=1e8)
    deepest = (5 / (4 * 1e8)) ** 0.4
    assert found.contact_fraction[0] * 0.02 == pytest.approx(2.94328 * deepest, rel=1e-5)
    assert found.contact_impulse[0] == pytest.approx(2.0, rel=1e-6)


def test_bounce_with_hunt_and_crossley():
    """The speed after it, u, obeys f(u) = f(-v): the integral of v dv / (1 + c v) is that of d^1.5."""
    c, found = 0.3, lone_mass(law="hertz", stiffness=1e8, damping=0.3)
    after = found.contact_impulse[0] - 1.0
    there, back = (quad(lambda v: v / (1 + c * v), 0, to)[0] for to in (1.0, -after))
    assert there == pytest.approx(back, rel=1e-6)
    assert after < 0.85


def test_turning_normal_is_that_of_an_equation_in_the_plane():
    """A disc that may turn and a mass; Hertz, Hunt and Crossley, Stribeck; by Dormand and Prince."""
    radius, clearance, spin, k, c, mu = 0.05, 5e-5, 200.0, 1e8, 0.5, 0.2
    mass, spring, damper = (
        np.array(line) for line in ([2, 2, 2e-3, 0.01, 0.02], [1e5, 8e4, 2e3, 3e5, 2e5], [30, 40, 0.1, 3, 4])
    )
    tip = LumpedStator(
        node=1, radius=radius, mass=mass[3], stiffness=spring[3], damping=damper[3], lateral_mass=mass[4],
        lateral_stiffness=spring[4], lateral_damping=damper[4],
    )  # fmt: skip
    rig = Rig.from_matrices(
        *(np.diag(of[:3]) for of in (mass, damper, spring)),
        degrees=[(1, "v"), (1, "w"), (1, "thx")],
        stators=tip,
    )
    start = np.array([[0.0, 2e-3, 0.0, 0.0, 0.0], [0.3, 0.2, 0.0, 0.0, 0.0]])
    begun = replace(
        State.at_rest(assemble(rig)), rotor_displacement=start[0, :3], rotor_velocity=start[1, :3]
    )
    case = {"speed": spin, "clearance": clearance, "friction": mu, "normal": "updated", "initial": begun}
    case |= {"law": "hertz", "stiffness": k, "damping": c}
    case |= {"friction_law": "stribeck", "static_friction_ratio": 2.0, "stribeck_speed": 5.0}
    case |= {"transient": 0, "revolutions": 1, "samples_per_revolution": 64, "accuracy": 1e-6}
    found = simulate(rig, **case)

    def rate(_, state):
        x, v = state.reshape(2, -1)
        line = radius + clearance + x[3] + 1j * x[4] - x[0] - 1j * x[1]
        normal = line / abs(line)
        speed = v[3] + 1j * v[4] - v[0] - 1j * v[1]
        deep, deepens = max(radius - abs(line), 0.0), -(speed * normal.conjugate()).real
        force = max(k * deep**1.5 * (1 + c * deepens), 0.0)
        slip = radius * (spin + v[2]) - (speed * (1j * normal).conjugate()).real
        drag = mu * (1 + math.exp(-abs(slip) / 5.0)) * force
        pull = force * normal + drag * 1j * normal
        loads = np.array([-pull.real, -pull.imag, -drag * radius, pull.real, pull.imag])
        return np.concatenate([v, (loads - spring * x - damper * v) / mass])

    times = 2 * math.pi / spin * np.arange(64) / 64
    exact = solve_ivp(
        rate, (0, times[-1]), start.ravel(), "DOP853", times, rtol=1e-11, atol=1e-15, max_step=2e-5
    )
    assert found.peak_contact_force[0] > 100.0
    for i, name in enumerate(MOTIONS):
        size = abs(exact.y[i]).max()
        assert np.ravel(getattr(found, name)) == pytest.approx(exact.y[i], rel=0, abs=1e-5 * size), name


def test_cases_have_every_law():
    assert set(answers()) == set(CASES)
    assert all(len(known) == len(SIGNALS + MEASURES) + 1 for known in answers().values())
