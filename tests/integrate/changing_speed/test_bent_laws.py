"""Speeds along several straight lines: the bends of a law, and bearings that change on the way."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from closed_form import run_up, simulate
from scipy.integrate import solve_ivp

from rubhpc import LumpedStator, Probe, Rig, Unbalance
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.study.speed_law import LAG, SpeedLaw, cut

# A ramp, a hold, a steep ramp of a third of a revolution, a fall; no bend but the third is at a sample.
LAW = [(0.0, 200.0), (0.07, 204.0), (0.1211, 204.0), (0.1311, 214.0), (0.2, 213.0)]
INERTIA, TORSION, TWIST_DAMPING = 8e-3, 8e3, 0.4  # at order 5
MASS, DAMPING, STIFFNESS = 5.0, 90.0, 1.6e5
MOMENT = 5e-4  # kg m
FREE = {"from": "contact_free"}
STATOR = LumpedStator(node=1, mass=0.4, stiffness=4e5, damping=40.0, radius=0.05)
TABLE = BearingTable(
    node=1, speed=(150.0, 400.0), stiffness=(9e4, 3e5), damping=(400.0, 90.0), interpolation="linear"
)


def rig(*, table=None):
    stiffness = np.diag([0.1 * STIFFNESS] * 2 if table else [STIFFNESS] * 2)
    made = Rig.from_matrices(
        np.diag([MASS, MASS, INERTIA]),
        np.diag([DAMPING, DAMPING, TWIST_DAMPING]),
        np.pad(stiffness, (0, 1)) + np.diag([0.0, 0.0, TORSION]),
        degrees=[(1, "v"), (1, "w"), (1, "thx")],
        stators=[STATOR],
        unbalance=[Unbalance(node=1, mass=0.01, radius=0.05)],
    )
    return replace(made, rotor=replace(made.rotor, bearing=(table,))) if table else made


def stepped(times):
    """What the probes of the test below see, line by line, by the method of Dormand and Prince."""
    y, angle, seen = np.zeros(6), 0.0, []
    (_, first), (until, second) = LAW[:2]
    lead = (second - first) / until
    steady = MOMENT * first**2 / (STIFFNESS - MASS * first**2 + 1j * first * DAMPING)
    y[:3] = steady.real, steady.imag, -INERTIA * lead / TORSION
    y[3:5] = -first * steady.imag, first * steady.real
    for (begin, slow), (end, fast) in pairwise(LAW):
        rate, turned = (fast - slow) / (end - begin), angle

        def rates(t, y, slow=slow, rate=rate, begin=begin, turned=turned):
            s = t - begin
            spin = slow + rate * s
            push = MOMENT * (spin**2 - 1j * rate) * np.exp(1j * (turned + slow * s + rate * s**2 / 2))
            across = (np.array([push.real, push.imag]) - DAMPING * y[3:5] - STIFFNESS * y[:2]) / MASS
            turning = -rate - (TWIST_DAMPING * y[5] + TORSION * y[2]) / INERTIA
            return np.concatenate([y[3:], across, [turning]])

        part = solve_ivp(rates, (begin, end), y, method="DOP853", rtol=1e-10, atol=1e-14, dense_output=True)
        for t in times[(times >= begin) & (times < end)]:
            x = part.sol(t)
            seen.append([x[0], *rates(t, x)[3:], x[2]])
        y, angle = part.y[:, -1], angle + 0.5 * (slow + fast) * (end - begin)
    return np.array(seen).T


@pytest.mark.parametrize(
    ("per_revolution", "pieces", "of_twist"), [(64, None, 1e-2), (64, 4, 1e-2), (256, None, 3e-4)]
)
def test_bends_of_a_law_ring_the_twist_as_they_do(per_revolution, pieces, of_twist):
    """The twist errs with the third power of the interval that holds a bend: of 13 or 51 in its period."""
    probes = [
        Probe(name="v", node=1, angle=0.0, quantity="acceleration"),
        Probe(name="w", node=1, angle=math.pi / 2, quantity="acceleration"),
        Probe(name="twist", node=1, quantity="twist_acceleration"),
    ]
    law = SpeedLaw(time=tuple(t for t, _ in LAW), speed=tuple(s for _, s in LAW))
    found = run_up(
        rig(),
        speed_law=LAW,
        clearance=1.0,
        friction=0.0,
        probes=probes,
        samples_per_revolution=per_revolution,
        pieces_per_revolution=pieces,
    )
    n = law.n_revolution * per_revolution
    expected = stepped(law.at_angle(2.0 * math.pi / per_revolution * np.arange(n))[0])
    assert found.sizes["sample"] == expected.shape[1]
    names = ("vertical", "probe_v", "probe_w", "probe_twist", "torsion")
    for name, signal, allowed in zip(names, expected, (3e-3, 5e-3, 5e-3, of_twist, of_twist), strict=True):
        error = np.linalg.norm(found[name].values - signal)
        assert error < allowed * np.linalg.norm(signal), (name, error / np.linalg.norm(signal))


def test_each_bend_is_between_two_samples_that_follow():
    law = SpeedLaw(time=(0.0, 1.0, 1.8, 1.805, 1.81, 3.0), speed=(100.0, 100.0, 130.0, 190.0, 130.0, 130.0))
    per_revolution = 64
    cuts = cut(law, per_revolution)
    for bend in law.bends(per_revolution):
        assert {math.floor(bend), math.ceil(bend)} <= set(cuts.tolist())
    time, _, rate = law.at_angle(2.0 * math.pi / per_revolution * cuts)
    assert (np.abs(rate[:-1]) * np.diff(time) ** 2 / 12.0).max() <= LAG


def test_a_probe_at_a_bearing_feels_it_as_it_is_at_each_speed():
    """In a hold at 200 rad/s, before the speed rises by half."""
    probes = [Probe(name="force", node=1, angle=0.3, quantity="bearing_force")]
    case = {"clearance": 1.0, "friction": 0.0, "samples_per_revolution": 64, "probes": probes}
    found = run_up(rig(table=TABLE), speed_law=[(0.0, 200.0), (0.2, 200.0), (0.5, 300.0)], **case)
    held = simulate(
        rig(table=TABLE), speed=200.0, transient=0, revolutions=4, keep=("waveform",), initial=FREE, **case
    )
    assert found.probe_force.values[:256] == pytest.approx(held.signals["probe_force"], rel=2e-3, abs=1e-2)
    force = np.abs(held.signals["probe_force"]).max()
    assert np.abs(found.probe_force.values[:256] - held.signals["probe_force"]).max() < 1e-3 * force
