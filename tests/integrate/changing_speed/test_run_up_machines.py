"""A run-up of an overhung pump in a ring of eight, under gravity, held to stepping of all its degrees."""

import math

import numpy as np
import pytest
from closed_form import run_up
from equal_stators import in_ring
from overhung_pump import pump

from rubhpc import Probe
from rubhpc.fem.assemble import assemble
from rubhpc.fem.probes import with_probes
from rubhpc.integrate.packing import whole_system
from rubhpc.study.speed_law import SpeedLaw

PUMP = in_ring(pump(), 8, first=0.2)
PROBES = (
    Probe(name="bearing", node=4, angle=math.pi / 2, quantity="acceleration"),
    Probe(name="span", node=2, angle=0.3, quantity="acceleration"),
    Probe(name="impeller", node=6, angle=0.0, quantity="acceleration"),
    Probe(name="twist", node=6, quantity="twist_acceleration"),
)
LAW = {"start": 320.0, "stop": 326.0, "time": 0.0391}  # two revolutions
CONTACT = {"clearance": 1.2e-4, "friction": 0.1, "stiffness": 1e6, "damping": 50.0}
PER_REVOLUTION, STEP = 128, 5e-6


def stepped(rig):
    """What the probes see, by the method of Runge and Kutta of order 4, and the least gap."""
    model = with_probes(assemble(rig), rig, PROBES, LAW["start"])
    mass, damping, stiffness, _ = whole_system(model, 0.0)
    gyroscopic = whole_system(model, 1.0)[1] - damping
    n, rotor = len(mass), model.rotor
    law = SpeedLaw(time=(0.0, LAW["time"]), speed=(LAW["start"], LAW["stop"]))
    rate, inverse = law.acceleration[0], np.linalg.inv(mass)
    phasor, spinning = np.zeros(n, complex), np.zeros(n)
    phasor[: rotor.n_dof] = model.unbalance_cosine - 1j * model.unbalance_sine
    spinning[: rotor.n_dof] = [name == "thx" for _, name in rotor.degrees]
    v, w, twist = (rotor.index(6, name) for name in ("v", "w", "thx"))
    gap, force_direction = np.zeros((2, 8, n))
    for i, tip in enumerate(PUMP.stator):
        c, s = math.cos(tip.angle), math.sin(tip.angle)
        gap[i, [v, w, model.stator_start[i]]] = -c, -s, 1.0
        friction = CONTACT["friction"]
        force_direction[i, [v, w, model.stator_start[i]]] = -c + friction * s, -s - friction * c, 1.0
        force_direction[i, twist] = -friction * model.stators[i].radius
    opened = CONTACT["clearance"] + gap[:, : rotor.n_dof] @ model.sag
    linear = inverse @ np.hstack([stiffness + rate * gyroscopic, damping])
    turning, pushed, turned, torque = (
        inverse @ gyroscopic,
        inverse @ force_direction.T,
        inverse @ phasor,
        rate * spinning,
    )
    least = [1.0]

    def rates(t, y):
        spin, angle = LAW["start"] + rate * t, LAW["start"] * t + rate * t**2 / 2
        a = (turned * ((spin**2 - 1j * rate) * np.exp(1j * angle))).real - torque - linear @ y
        a -= spin * (turning @ y[n:])
        g = opened + gap @ y[:n]
        if g.min() < 0.0:
            least[0] = min(least[0], g.min())
            force = -CONTACT["stiffness"] * g - CONTACT["damping"] * (gap @ y[n:])
            a += pushed @ np.where(g < 0.0, np.maximum(force, 0.0), 0.0)
        return np.concatenate([y[n:], a])

    times = law.at_angle(2.0 * math.pi * np.arange(2 * PER_REVOLUTION) / PER_REVOLUTION)[0]
    y = np.concatenate([np.linalg.solve(stiffness, -rate * mass @ spinning), np.zeros(n)])
    seen, t = [], 0.0
    for until in times:
        count = math.ceil((until - t) / STEP)
        for k in range(count):
            h, s = (until - t) / count, t + k * (until - t) / count
            a = rates(s, y)
            b = rates(s + h / 2, y + h / 2 * a)
            c = rates(s + h / 2, y + h / 2 * b)
            y = y + h / 6 * (a + 2 * b + 2 * c + rates(s + h, y + h * c))
        t = until
        seen.append(np.einsum("kpn,kn->p", model.probe_rows, [y[:n], y[n:], rates(t, y)[n:]]))
    return np.array(seen).T, least[0]


@pytest.fixture(scope="module")
def expected():
    signals, least = stepped(PUMP)
    assert least < -1e-6
    return signals


FINE = {"accuracy": 1e-5, "pieces_per_revolution": 16}


@pytest.mark.parametrize(
    ("settings", "allowed"), [({}, 2.5e-3), ({"pieces_per_revolution": 4}, 1e-3), (FINE, 2e-4)]
)
def test_accelerations_at_nodes_meet_stepping_of_all_degrees(expected, settings, allowed):
    """By default, with matrices held over ranges of speed, and with fine ranges and pieces."""
    found = run_up(
        PUMP,
        **LAW,
        **CONTACT,
        **settings,
        law="penalty",
        initial={"from": "rest"},
        samples_per_revolution=PER_REVOLUTION,
        probes=PROBES,
    )
    for probe, signal in zip(PROBES, expected, strict=True):
        lines = np.fft.rfft((signal, found[f"probe_{probe.name}"].values) * np.hanning(signal.size))
        full, own = lines[:, :22]  # below order 11, where probes show the full model
        assert np.linalg.norm(own - full) < allowed * np.linalg.norm(full), probe.name
