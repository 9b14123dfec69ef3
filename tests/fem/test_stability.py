"""Linear stability: circulation in closed form, threshold speed, and what is said about it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig

from rubhpc import Rig, assemble
from rubhpc.fem.modes import modes
from rubhpc.fem.stability import (
    instability_message,
    logarithmic_decrement,
    threshold_speed,
    unstable_modes,
)
from rubhpc.rig.bearing_table import BearingTable

PLANE = [(1, "v"), (1, "w")]
OMEGA, RATIO = 80.0, 0.05


def whirling(cross):
    """u'' + 2 z w u' + w^2 u with circulation: k_yz = q = -k_zy."""
    stiffness = np.array([[OMEGA**2, cross], [-cross, OMEGA**2]])
    return assemble(Rig.from_matrices(np.eye(2), np.eye(2) * 2 * RATIO * OMEGA, stiffness, degrees=PLANE))


def seal(speeds, cross):
    """The same oscillator, its circulation a table over the speed."""
    rig = Rig.from_matrices(np.eye(2), np.eye(2) * 2 * RATIO * OMEGA, np.eye(2) * OMEGA**2, degrees=PLANE)
    table = BearingTable(
        node=1, speed=speeds, stiffness=None, kyy=0.0, kzz=0.0, kyz=cross, kzy=[-value for value in cross]
    )
    return assemble(replace(rig, rotor=replace(rig.rotor, bearing=(table,))))


@pytest.mark.parametrize("share", [0.5, 0.99, 1.01, 2.0])
def test_circulation_beyond_the_damping_grows(share):
    """u'' + 2 z w u' + (w^2 - i q) u = 0 in u = v + i w: stable while q < 2 z w^2."""
    model = whirling(share * 2 * RATIO * OMEGA**2)
    roots = np.roots([1.0, 2 * RATIO * OMEGA, OMEGA**2 - 1j * share * 2 * RATIO * OMEGA**2])
    growth = roots.real.max()
    found = unstable_modes(model.rotor)
    assert bool(found) == (share > 1.0)
    if found:
        assert found[0].eigenvalue.real == pytest.approx(growth, rel=1e-9)
        assert found[0].whirl == "forward"
        assert logarithmic_decrement(found[0]) == pytest.approx(
            -2 * math.pi * growth / found[0].eigenvalue.imag
        )


def test_logarithmic_decrement_of_an_oscillator():
    """2 pi z / sqrt(1 - z^2); an overdamped mode has none, a rigid-body one is neither."""
    for ratio in (1e-3, 0.1, 0.7):
        rig = Rig.from_matrices([[1.0]], [[2 * ratio]], [[1.0]], degrees=[(1, "v")])
        (mode,) = modes(assemble(rig).rotor)
        assert logarithmic_decrement(mode) == pytest.approx(2 * math.pi * ratio / math.sqrt(1 - ratio**2))
    (mode,) = modes(assemble(Rig.from_matrices([[1.0]], [[3.0]], [[1.0]], degrees=[(1, "v")])).rotor)
    assert logarithmic_decrement(mode) == math.inf
    (mode,) = modes(assemble(Rig.from_matrices([[1.0]], None, [[0.0]], degrees=[(1, "v")])).rotor)
    assert math.isnan(logarithmic_decrement(mode))


def test_threshold_speed_of_a_seal():
    """Circulation grows linearly with the speed, and meets 2 z w^2 at a known one."""
    model = seal([0.0, 500.0], [0.0, 2 * 2 * RATIO * OMEGA**2])
    found = threshold_speed(model.rotor, np.linspace(0.0, 500.0, 11))
    assert found == pytest.approx(250.0, rel=1e-5)
    assert math.isnan(threshold_speed(model.rotor, np.linspace(0.0, 240.0, 11)))
    assert threshold_speed(model.rotor, [300.0, 400.0]) == 300.0
    assert instability_message(model, 200.0) == ""
    message = instability_message(model, 400.0)
    assert message.startswith("the rotor is unstable at 3819.72 rpm: its forward mode of 12.")
    assert "logarithmic decrement -" in message
    assert "\n" not in message


@pytest.mark.parametrize("end", [1e-3, 1e-6, 1e-9])
def test_threshold_speed_of_a_nearly_massless_shaft(end):
    """A mass on a spring k, in series with k_b + c s - i q.

    The threshold is at q = c w with w^2 = k k_b / (k + k_b) / m. The node between them, of the
    mass `end`, decays by up to 2e11 1/s.
    """
    mass, spring, slope, damping = 2.0, 1e6, 400.0, 200.0
    shaft = spring * np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(2))
    degrees = [(node, name) for node in (1, 2) for name in ("v", "w")]
    rig = Rig.from_matrices(np.diag([mass, mass, end, end]), None, shaft, degrees=degrees)
    table = BearingTable(
        node=2,
        speed=[0.0, 1000.0],
        kyy=spring,
        kzz=spring,
        kyz=[0.0, 1000.0 * slope],
        kzy=[0.0, -1000.0 * slope],
        damping=damping,
    )
    body = assemble(replace(rig, rotor=replace(rig.rotor, bearing=(table,)))).rotor
    known = damping / slope * math.sqrt(spring / 2 / mass)
    found = threshold_speed(body, np.linspace(0.0, 1000.0, 12))
    assert found == pytest.approx(known, rel=max(2e-6, end))


def test_rotors_without_damping_or_free_to_turn_are_not_unstable():
    rig = read_rig("mokhtar2017")
    free = replace(rig.rotor.torsion, fixed_node=None, free=True)
    for rotor in (
        rig.rotor,
        replace(rig.rotor, damping=replace(rig.rotor.damping, alpha=0.0)),
        replace(rig.rotor, torsion=free),
        replace(rig.rotor, torsion=free, damping=replace(rig.rotor.damping, alpha=0.0)),
    ):
        body = assemble(replace(rig, rotor=rotor)).rotor
        for spin in (0.0, 150.0, -900.0, 5000.0):
            assert unstable_modes(body, spin) == []
