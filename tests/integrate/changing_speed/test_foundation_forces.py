"""Force under a carrier during a run-up with rub, against time stepping of own equations."""

import math

import numpy as np
import pytest

from rubhpc import LumpedStator, Rig, Unbalance, run_up
from rubhpc.rig.carriers import Carrier

MASS, DAMPING = np.array([4.0, 4.0, 0.02, 0.02, 0.03]), np.diag([60.0, 50.0, 0.3, 0.3, 0.2])
STIFFNESS = np.diag([4e5, 3.4e5, 2.6e3, 2.2e3, 6e3])
STIFFNESS[[0, 3, 1, 2], [3, 0, 2, 1]] = -6e3, -6e3, 5e3, 5e3
GYROSCOPIC = np.zeros((5, 5))
GYROSCOPIC[2, 3], GYROSCOPIC[3, 2] = 0.035, -0.035
CARRIER = {"mass": 9.0, "stiffness": 3e6, "horizontal_stiffness": 1.8e6, "damping": 500.0}
RADIAL, LATERAL = (0.15, 1.5e6, 15.0), (0.2, 9e5, 10.0)  # mass, stiffness, damping
ANGLES = (0.3, 2.2, 4.4)
RADIUS, CLEARANCE, FRICTION, PENALTY = 0.05, 2e-5, 0.15, 3e6
UNBALANCE, AT = 6.4e-5, 0.4  # kg m, rad
START, STOP, TIME = 300.0, 318.0, 0.2
PER_REVOLUTION, STEPS = 64, 12
DIRECTIONS = (-math.pi / 4, 0.0, math.pi / 2)


def machine():
    names = "mass", "stiffness", "damping"
    tip = dict(zip(names, RADIAL, strict=True))
    tip |= {f"lateral_{name}": value for name, value in zip(names, LATERAL, strict=True)}
    return Rig.from_matrices(
        np.diag(MASS),
        DAMPING,
        STIFFNESS,
        GYROSCOPIC,
        degrees=[(1, name) for name in ("v", "w", "thy", "thz", "thx")],
        stators=[LumpedStator(node=1, angle=a, radius=RADIUS, carrier="casing", **tip) for a in ANGLES],
        carriers=[Carrier(name="casing", **CARRIER)],
        unbalance=[Unbalance(node=1, mass=UNBALANCE, radius=1.0, phase=AT)],
    )


def own_equations():
    """Mass (13,), damping and stiffness (13, 13) of rotor, carrier and tips, whose motion is absolute.

    Normals and tangents (3, 13) give what a tip's gap and rim see of the motion.
    """
    mass = np.concatenate([MASS, [CARRIER["mass"]] * 2, np.tile([RADIAL[0], LATERAL[0]], 3)])
    damping, stiffness = np.zeros((2, 13, 13))
    damping[:5, :5], stiffness[:5, :5] = DAMPING, STIFFNESS
    damping[[5, 6], [5, 6]] = CARRIER["damping"]
    stiffness[5, 5], stiffness[6, 6] = CARRIER["stiffness"], CARRIER["horizontal_stiffness"]
    normals, forces = np.zeros((2, 3, 13))
    for i, angle in enumerate(ANGLES):
        radial, lateral = (math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))
        for row, along, (_, k, c) in ((7 + 2 * i, radial, RADIAL), (8 + 2 * i, lateral, LATERAL)):
            stretch = np.zeros(13)
            stretch[row], stretch[5:7] = 1.0, -np.array(along)
            stiffness += k * np.outer(stretch, stretch)
            damping += c * np.outer(stretch, stretch)
        normals[i, :2], normals[i, 7 + 2 * i] = radial, -1.0
        forces[i] = -normals[i]
        forces[i, :2] -= FRICTION * np.array(lateral)
        forces[i, 4], forces[i, 8 + 2 * i] = -FRICTION * RADIUS, FRICTION
    return mass, damping, stiffness, normals, forces


def stepped(times):
    """Motion and velocity (2, 13) at each time, by Runge and Kutta's method of order 4."""
    mass, damping, stiffness, normals, forces = own_equations()
    rise = (STOP - START) / TIME
    turning = np.zeros((13, 13))
    turning[:5, :5] = GYROSCOPIC
    stiffness = stiffness + rise * turning

    def rate(t, y):
        speed, angle = START + rise * t, START * t + 0.5 * rise * t**2 + AT
        force = -(damping + speed * turning) @ y[1] - stiffness @ y[0]
        push = UNBALANCE * (speed**2 - 1j * rise) * np.exp(1j * angle)
        force[0] += push.real
        force[1] += push.imag
        force[4] -= rise * MASS[4]
        force += PENALTY * np.maximum(normals @ y[0] - CLEARANCE, 0.0) @ forces
        return np.stack([y[1], force / mass])

    y, found = np.zeros((2, 13)), []
    y[0, 4] = -rise * MASS[4] / STIFFNESS[4, 4]  # a run-up begins with this twist
    for now, later in zip(times, [*times[1:], times[-1]], strict=True):
        found.append(y)
        h = (later - now) / STEPS
        for k in range(STEPS if h else 0):
            t = now + k * h
            a = rate(t, y)
            b = rate(t + 0.5 * h, y + 0.5 * h * a)
            c = rate(t + 0.5 * h, y + 0.5 * h * b)
            y = y + h / 6.0 * (a + 2.0 * (b + c) + rate(t + h, y + h * c))
    return np.array(found)


def test_the_force_under_a_carrier_is_that_of_own_equations():
    """Two planes and a slant; from rest, with contact; the promise is 0.5 % of each signal."""
    probes = [
        {"name": f"p{i}", "stator": 1, "angle": angle, "quantity": "foundation_force"}
        for i, angle in enumerate(DIRECTIONS)
    ]
    found = run_up(
        machine(),
        start=START,
        stop=STOP,
        time=TIME,
        clearance=CLEARANCE,
        friction=FRICTION,
        law="penalty",
        stiffness=PENALTY,
        initial={"from": "rest"},
        samples_per_revolution=PER_REVOLUTION,
        probes=probes,
    )
    assert (found.contact_fraction.values.max(axis=0) > 0.05).sum() >= 2
    angle = 2.0 * np.pi / PER_REVOLUTION * np.arange(found.sizes["sample"])
    rise = (STOP - START) / TIME
    motion = stepped((np.sqrt(START**2 + 2.0 * rise * angle) - START) / rise)
    support = np.array([CARRIER["stiffness"], CARRIER["horizontal_stiffness"]])
    force = support * motion[:, 0, 5:7] + CARRIER["damping"] * motion[:, 1, 5:7]
    for i, along in enumerate(DIRECTIONS):
        own = force @ [math.cos(along), math.sin(along)]
        error = found[f"probe_p{i}"].values - own
        assert np.linalg.norm(error) == pytest.approx(0.0, abs=2e-3 * np.linalg.norm(own)), i
