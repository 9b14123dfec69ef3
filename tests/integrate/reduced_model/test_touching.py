"""Contact modes and energies of what touches alone: those of the whole."""

import numpy as np
import pytest

from rubhpc.integrate.reduced_model.contact_mode import SlidingPairs, solve_contact_mode
from rubhpc.integrate.reduced_model.friction_mode import FrictionPairs, mask_of, solve_friction_mode
from rubhpc.integrate.reduced_model.reduction import ReducedModel
from rubhpc.integrate.reduced_model.touching import (
    OpenBodies,
    mode_among,
)
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK

Q, N_ROTOR, N_STATOR = 6, 5, 2  # pairs, and degrees of the rotor and of each stator
N = N_ROTOR + Q * N_STATOR


@pytest.fixture(scope="module")
def bodies():
    """A rotor of two parts, and stators that only contacts couple to it."""
    rng = np.random.default_rng(8)
    parts = [range(3), range(3, N_ROTOR)]
    parts += [range(k, k + N_STATOR) for k in range(N_ROTOR, N, N_STATOR)]
    stiffness, damping = np.zeros((2, N, N))
    for part in parts:
        at, (root, skew) = np.ix_(part, part), rng.normal(size=(2, len(part), len(part)))
        stiffness[at] = 4e4 * (root @ root.T + np.eye(len(part))) + 2e3 * (skew - skew.T)
        damping[at] = 3.0 * np.eye(len(part)) + 2.0 * (root - root.T)
    sees = np.zeros((Q, N), dtype=bool)
    for i in range(Q):
        sees[i, :N_ROTOR] = sees[i, N_ROTOR + i * N_STATOR :][:N_STATOR] = True
    force = np.where(np.arange(N) < N_ROTOR, rng.normal(size=(2, N)), 0.0)
    reduced = ReducedModel(
        spin=90.0,
        basis=np.eye(N),
        mass=np.eye(N),
        stiffness=stiffness,
        damping=damping,
        force=force,
        degree=rng.normal(size=(Q, 5, N)),
        output=rng.normal(size=(3, N)),
        carrier=np.zeros((0, 2, N)),
        probe=np.zeros((3, 0, N)),
    )
    pairs = FrictionPairs(
        gap_jacobian=np.where(sees, rng.normal(size=(Q, N)), 0.0),
        friction_direction=np.where(sees, rng.normal(size=(Q, N)), 0.0),
        friction=0.3,
        static_ratio=1.4,
        rim_speed=rng.uniform(0.5, 1.0, Q),
    )
    return reduced, pairs


STATES = [
    (OPEN,) * Q,
    (FORWARD, OPEN, OPEN, STUCK, OPEN, OPEN),
    (STUCK, BACKWARD, STUCK, OPEN, OPEN, FORWARD),
    (STUCK,) * Q,
]


def solved(bodies, law, states):
    """A contact mode of all bodies and of those that touch alone, with what it takes for energies."""
    reduced, pairs = bodies
    seen = np.abs(pairs.gap_jacobian) + np.abs(pairs.friction_direction)
    closed = [i for i, state in enumerate(states) if state != OPEN]
    mask = sum(1 << i for i in closed)
    along = pairs.gap_jacobian + 0.3 * pairs.friction_direction
    directions = pairs.gap_jacobian, along
    if law == "friction":
        opened = solve_friction_mode(reduced, pairs, 0)
        among, mask = OpenBodies(reduced, opened, seen), mask_of(states)
        modes = [mode_among(bodies, reduced, pairs, opened, mask, None) for bodies in (None, among)]
        return modes, among, closed, reduced, [pairs.friction_forces(mode) for mode in modes]
    opened = solve_contact_mode(reduced, *directions, 0)
    among = OpenBodies(reduced, opened, seen)
    sliding = SlidingPairs(*directions, *((3e5, 40.0) if law == "penalty" else ()))
    modes = [mode_among(of, reduced, sliding, opened, mask, None) for of in (None, among)]
    reduced = sliding.damped(reduced, mask)
    return modes, among, closed, reduced, [sliding.friction_forces(mode) for mode in modes]


@pytest.mark.parametrize("law", ["sliding", "penalty", "friction"])
@pytest.mark.parametrize("states", STATES)
def test_what_touches_moves_alone(bodies, law, states):
    (whole, own), among, closed, _, _ = solved(bodies, law, states)
    touching = among.touching(closed)
    assert (touching is None) == (len(closed) == Q)
    if touching:
        assert touching.rows.size == N_ROTOR + len(closed) * N_STATOR
    assert np.sort_complex(own.exponent) == pytest.approx(np.sort_complex(whole.exponent), rel=1e-9, abs=1e-6)
    start, m = np.random.default_rng(3).normal(size=2 * N), whole.n_eigenmode
    turned = []
    for mode in (whole, own):
        moving = np.exp(mode.exponent[:m] * 0.01) * (mode.enter[:m] @ start)
        taken = np.exp(mode.exponent[:m] * 0.01) * mode.take_off[:, :m]
        seen = [mode.motion[:, :m] @ moving, mode.switch[:, :m] @ moving, mode.motion[:, :m] @ taken.T]
        rest = [mode.motion[:, m:], mode.switch[:, m:], mode.enter[m:], mode.take_off[:, m:], mode.drift[m:]]
        turned.append([*(value.real for value in seen), *rest])
    for found, expected in zip(turned[1], turned[0], strict=True):
        assert found.shape == expected.shape
        size = abs(expected).max(initial=1e-300)
        assert abs(found - expected).max(initial=0.0) < 1e-9 * size
