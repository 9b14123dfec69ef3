"""Forms of energies taken part by part: those of the whole."""

import numpy as np
import pytest

from rubhpc.integrate.reduced_model import energy_forms
from rubhpc.integrate.reduced_model.friction_mode import FrictionPairs, mask_of, solve_friction_mode
from rubhpc.integrate.reduced_model.mode_tables import tabulate
from rubhpc.integrate.reduced_model.reduction import ReducedModel
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


@pytest.mark.parametrize(
    ("states", "n_sizes"),
    [
        ((OPEN,) * Q, 2),
        ((FORWARD, OPEN, OPEN, STUCK, OPEN, OPEN), 2),
        ((STUCK, BACKWARD, STUCK, OPEN, OPEN, FORWARD), 2),
        ((STUCK,) * Q, 1),
    ],
)
def test_parts_have_the_forms_of_the_whole(bodies, monkeypatch, states, n_sizes):
    reduced, pairs = bodies
    mode = solve_friction_mode(reduced, pairs, mask_of(states))
    parts = energy_forms.parts_of(mode.motion, mode.n_eigenmode)
    assert len(parts) == n_sizes  # the rotor's with what touches it, and the open stators
    assert sorted(row for rows, _ in parts for row in rows.ravel()) == list(range(N))
    found = []
    for few in (Q, Q - 1):
        monkeypatch.setattr(energy_forms, "FEW_PAIRS", few)
        friction = mode.friction_forces(pairs)
        found.append(
            tabulate(
                mode,
                reduced,
                np.zeros((0, N)),
                friction=friction,
                width=64,
                tick=1e-9,
                sample_level=4,
                n_level=6,
            )
        )
    whole, by_parts = found
    assert whole.loss.any()
    for name in ("loss", "work_re", "work_im", "steady_power"):
        expected = getattr(whole, name)
        size = abs(expected).max()
        assert getattr(by_parts, name) == pytest.approx(expected, rel=1e-12, abs=1e-14 * size)
