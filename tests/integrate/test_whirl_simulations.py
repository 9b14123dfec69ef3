"""Predicted dry whirl against simulations, and the least knock against an ODE solver."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rubhpc import Bore, Rig, certify_whirl, dry_whirl
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.dry_whirl import in_words
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.whirl_simulations import start_on

K, C, GAP, RADIUS, SPIN, MU = 0.04, 0.1, 1.05, 30.0, 1.0, 0.3  # in units of mass and contact stiffness
SPRING = NormalLaw(kind="penalty", stiffness=1.0)


@pytest.fixture(scope="module")
def rig():
    """A disc in a bore that yields along the normal only; its shaft hardly twists."""
    return Rig.from_matrices(
        np.eye(3),
        np.diag([C, C, 0.01]),
        np.diag([K, K, 100.0]),
        degrees=((1, "v"), (1, "w"), (1, "thx")),
        stators=[Bore(node=1, radius=RADIUS, rigid=True)],
    )


@pytest.fixture(scope="module")
def certified(rig):
    return certify_whirl(rig, dry_whirl(rig, [SPIN], [GAP], [MU], law=SPRING), law=SPRING, angles=1)


def test_starts_slower_than_a_threshold_decay_and_faster_ones_grow_to_rolling(certified):
    rolling, threshold = (certified.isel(whirl=k) for k in (0, 1))
    assert (rolling.whirl_kind.item(), threshold.whirl_kind.item()) == ("rolling", "slipping")
    assert threshold.whirl_reached_kind.values.tolist() == ["none", "rolling"]
    assert rolling.whirl_reached_kind.values.tolist() == ["rolling", "rolling"]
    assert rolling.whirl_reached_frequency.values == pytest.approx(rolling.whirl_frequency.item(), rel=1e-6)
    assert certified.whirl_is_confirmed.all()
    assert "simulations confirm 2 of 2, and a knock of " in in_words(certified)[0]


def test_least_knock_is_that_of_an_ode_solver(certified):
    """Of the disc alone, whose rim is never too slow to slip in the time that decides."""

    def motion(_, state):
        z, dz = state.view(complex)
        n = z / max(abs(z), 1e-12)
        N = max(abs(z) - GAP, 0.0)
        slip = RADIUS * SPIN + (dz * n.conjugate()).imag
        push = N * (1.0 + 1j * MU * math.copysign(1.0, slip)) * n
        return np.array([dz, -push - C * dz - K * z]).view(float)

    def far(_, state):
        return abs(state.view(complex)[0]) - 3.0 * GAP

    far.terminal = True

    def grows(impulse):
        start = np.array([0.0, impulse], dtype=complex).view(float)
        return solve_ivp(motion, (0.0, 150.0), start, rtol=1e-6, atol=1e-9, events=far).status == 1

    impulse, harmless = certified.knock_impulse.item(), certified.knock_harmless.item()
    assert 0.98 * impulse <= harmless < impulse
    assert [grows(harmless), grows(impulse)] == [False, True]


@pytest.mark.parametrize("spin", [SPIN, -SPIN])
def test_the_start_is_the_balance_of_a_ring_that_friction_pushes_aside(spin):
    """Rim and hole move by the forces of the whirl, at the distance that the law gives."""
    ring = Bore(node=1, radius=RADIUS, mass=0.3, stiffness=2.0, damping=0.1)
    matrices = (np.eye(2), C * np.eye(2), K * np.eye(2))
    rig = Rig.from_matrices(*matrices, degrees=[(1, "v"), (1, "w")], stators=[ring])
    found = dry_whirl(rig, [spin], [GAP], [0.4], law=SPRING)
    assert found.sizes["whirl"]
    for k in range(found.sizes["whirl"]):
        at = {name.removeprefix("whirl_"): found[name][k].item() for name in found if "whirl_" in name}
        state = start_on(model_at(assemble(rig), spin), at)
        rim, hole = state.rotor_displacement @ [1, 1j], state.stator_displacement[0] @ [1, 1j]
        assert abs(rim - hole) == pytest.approx(GAP + at["normal_force"])
        assert state.overlap[0] == pytest.approx(at["normal_force"])
        assert (abs(rim), abs(hole)) == pytest.approx((at["orbit"], at["hole_orbit"]))
        assert state.rotor_velocity @ [1, 1j] == pytest.approx(1j * spin * at["frequency"] * rim)
