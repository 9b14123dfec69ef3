"""Every gap, law and kind of machine against an independent code, and that code against closed forms."""

import math

import numpy as np
import pytest
from contact_answers import CASES, MEASURES, SIGNALS, SLIM, answers, case_of
from independent_contact import march_bodies, run
from reference_bodies import Bodies
from scipy.integrate import quad, solve_ivp

from rubhpc import simulate
from rubhpc.rig.reading import with_keys

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


def lone_mass(mass=1.0, **case):
    """A free mass that flies at 1 m/s at a wall 1 mm away; the record of 20 ms."""
    bodies = Bodies(
        mass * np.eye(2),
        np.zeros((2, 2)),
        np.diag([1e-4, 2e-4]),
        np.zeros((2, 2)),
        np.array([[0, 1, -1, -1, -1]]),
        np.array([0, 1, -1]),
        [None],
        np.zeros(2),
    )
    case = {"friction": 0.0, "revolutions": 1, "samples_per_revolution": 512} | case
    start = np.array([[0.0, 0.0], [1.0, 0.0]])
    return march_bodies(bodies, 100 * math.pi, case, np.array([0.06]), [0.0], np.array([1e-3]), 1e-6, start)


def test_bounce_on_hertz():
    """It lasts 2.94328 d / v, with d the deepest."""
    found = lone_mass(law="hertz", stiffness=1e8)
    deepest = (5 / (4 * 1e8)) ** 0.4
    assert found["contact_fraction"][0] * 0.02 == pytest.approx(2.94328 * deepest, rel=1e-5)
    assert found["contact_impulse"][0] == pytest.approx(2.0, rel=1e-6)
    assert abs(found["energy"] / 0.5 - 1)[[0, -1]].max() < 1e-6


def test_bounce_with_hunt_and_crossley():
    """The speed after it, u, obeys f(u) = f(-v): the integral of v dv / (1 + c v) is that of d^1.5."""
    c, found = 0.3, lone_mass(law="hertz", stiffness=1e8, damping=0.3)
    after = found["contact_impulse"][0] - 1.0
    there, back = (quad(lambda v: v / (1 + c * v), 0, to)[0] for to in (1.0, -after))
    assert there == pytest.approx(back, rel=1e-6)
    assert after < 0.85


def test_bounce_with_restitution():
    found = lone_mass(restitution=0.4)
    assert found["contact_impulse"][0] == pytest.approx(1.4, rel=1e-9)
    assert found["energy"][-1] == pytest.approx(0.5 * 0.4**2, rel=1e-6)
    assert found["normal_work"][0] == pytest.approx(-0.5 * (1 - 0.4**2), rel=1e-9)


def test_energy_changes_by_the_work_of_contact():
    """Undamped and balanced, after a knock: a bent stator that sticks and slides."""
    rig = with_keys(
        SLIM, {"rotor.damping.alpha": 0.0, "stator.damping.beta": 0.0, "rotor.unbalance.mass": 0.0}
    )
    start = np.zeros((2, 92))
    start[1, 14] = 0.06  # m/s, of the disc
    case = {"speed": 150.0, "clearance": 84e-6, "friction": 0.5, "revolutions": 1}
    found = run(rig, case | {"normal": "updated", "friction_law": "coulomb"}, 0.4e-6, start=start)
    gained = found["energy"][-1] - found["energy"][0]  # the rim is driven
    assert found["contact_fraction"][0] > 0.1
    assert gained > 0.01 * found["energy"][0]
    assert gained == pytest.approx(found["contact_work"][0], rel=1e-6)


def test_turning_normal_is_that_of_an_equation_in_the_plane():
    """A disc that may turn and a mass; Hertz, Hunt and Crossley, Stribeck; by Dormand and Prince."""
    radius, clearance, spin, k, c, mu = 0.05, 5e-5, 200.0, 1e8, 0.5, 0.2
    mass, spring, damper = (
        np.array(line) for line in ([2, 2, 2e-3, 0.01, 0.02], [1e5, 8e4, 2e3, 3e5, 2e5], [30, 40, 0.1, 3, 4])
    )
    bodies = Bodies(
        np.diag(mass),
        np.diag(damper),
        np.diag(spring),
        np.zeros((2, 5)),
        np.array([[0, 1, 2, 3, 4]]),
        np.arange(3),
        [None],
        np.zeros(5),
    )
    start = np.array([[0.0, 2e-3, 0.0, 0.0, 0.0], [0.3, 0.2, 0.0, 0.0, 0.0]])
    case = {
        "law": "hertz",
        "stiffness": k,
        "damping": c,
        "normal": "updated",
        "friction": mu,
        "revolutions": 1,
    }
    case |= {"friction_law": "stribeck", "static_friction_ratio": 2.0, "stribeck_speed": 5.0}
    found = march_bodies(bodies, spin, case, np.array([radius]), [0.0], np.array([clearance]), 1e-6, start)

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
    assert found["peak_contact_force"][0] > 100.0
    for i, name in enumerate(("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral")):
        size = abs(exact.y[i]).max()
        assert np.ravel(found[name]) == pytest.approx(exact.y[i], rel=0, abs=1e-5 * size), name


def test_cases_have_every_law():
    assert set(answers()) == set(CASES)
    assert all(len(known) == len(SIGNALS + MEASURES) + 1 for known in answers().values())
