"""Contact modes of what touches alone: those of the whole."""

import numpy as np
import pytest

from rubhpc.integrate.reduced_model.contact_mode import SlidingPairs, solve_contact_mode
from rubhpc.integrate.reduced_model.reduction import ReducedModel
from rubhpc.integrate.reduced_model.touching import (
    OpenBodies,
    mode_among,
)

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
    gap, along = (np.where(sees, rng.normal(size=(Q, N)), 0.0) for _ in range(2))
    return reduced, SlidingPairs(gap, gap + 0.3 * along)


@pytest.mark.parametrize("closed", [[], [0, 3], [0, 1, 2, 5], [0, 1, 2, 3, 4, 5]])
def test_what_touches_moves_alone(bodies, closed):
    reduced, pairs = bodies
    seen = np.abs(pairs.gap_jacobian) + np.abs(pairs.force_direction)
    among = OpenBodies(reduced, solve_contact_mode(reduced, *pairs, 0), seen)
    mask = sum(1 << i for i in closed)
    whole, own = (mode_among(of, reduced, pairs, mask) for of in (None, among))
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
        rest = [mode.motion[:, m:], mode.switch[:, m:], mode.enter[m:], mode.take_off[:, m:]]
        turned.append([*(value.real for value in seen), *rest])
    for found, expected in zip(turned[1], turned[0], strict=True):
        assert found.shape == expected.shape
        size = abs(expected).max(initial=1e-300)
        assert abs(found - expected).max(initial=0.0) < 1e-9 * size
