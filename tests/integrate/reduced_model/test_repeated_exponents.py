"""Modes of systems with repeated exponents, against the matrix exponential; those that merge are refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, matrix_balance
from trial_rig import trial_rig

from rubhpc import Carrier, assemble
from rubhpc.errors import InputError
from rubhpc.integrate.reduced_model import system_modes
from rubhpc.integrate.reduced_model.contact_mode import confine, solve_contact_mode
from rubhpc.integrate.reduced_model.reduction import directions, reduce_model
from rubhpc.integrate.reduced_model.system_modes import separate, solve_part
from rubhpc.rig.parts import Damping

N_STATOR, FRICTION = 12, 0.1


@pytest.fixture(scope="module")
def ring():
    """Identical steel stators on one carrier, one of them pressed: 10 and more motions have one exponent."""
    rig = trial_rig(1)
    steel = {"youngs_modulus": 2e11, "density": 7800.0, "width": 0.01, "damping": Damping(beta=1e-5)}
    stator = replace(rig.stator[0], angle=0.0, count=N_STATOR, carrier="casing", **steel)
    casing = Carrier(name="casing", mass=20.0, stiffness=2e7, damping=2000.0)
    model = assemble(replace(rig, stator=(stator,), carrier=(casing,)))
    reduced = reduce_model(model, 360.0, 1e-3)
    gap_jacobian, force_direction, _ = directions(reduced, model, FRICTION)
    return reduced, gap_jacobian, force_direction


def test_equal_exponents_have_an_orthonormal_basis_and_the_motion_is_exact(ring):
    reduced, gap_jacobian, force_direction = ring
    _, _, system = confine(reduced, gap_jacobian[4:5], force_direction[4:5].T)
    balanced, (scale, _) = matrix_balance(system, permute=False, separate=True)
    exponent, shape, inverse = separate(system)
    value, count = np.unique(exponent, return_counts=True)
    assert count.max() >= N_STATOR - 3
    for one in value[count > 1]:
        basis = (shape / scale[:, None])[:, exponent == one]
        np.testing.assert_allclose(basis.conj().T @ basis, np.eye(basis.shape[1]), atol=1e-12)
    for time in (1e-6, 1e-4):
        motion = ((shape * np.exp(exponent * time)) @ inverse).real / scale[:, None] * scale
        exact = expm(balanced * time)
        np.testing.assert_allclose(motion, exact, rtol=0, atol=1e-9 * abs(exact).max())


def test_contact_mode_is_that_of_the_plain_eigenvectors(ring, monkeypatch):
    """Coordinates differ; what they give of any state, and its gaps and forces later, does not."""
    plain = solve_contact_mode(*ring, 1 << 4)
    monkeypatch.setattr(system_modes, "WORST_CONDITION", 0.0)
    found = solve_contact_mode(*ring, 1 << 4)
    assert found.exponent.size == plain.exponent.size
    n = len(ring[0].stiffness)
    weight = np.concatenate([np.sqrt(np.diag(ring[0].stiffness)), np.ones(n)])  # of displacements and rates
    for time in (0.0, 1e-5):
        later = []
        for mode in (plain, found):
            m = mode.n_eigenmode
            grown = np.exp(mode.exponent[:m] * time)[:, None] * mode.enter / weight
            later += [(weight[:, None] * mode.motion[:, :m] @ grown).real, (mode.switch[:, :m] @ grown).real]
        for one, other in zip(later[:2], later[2:], strict=True):
            np.testing.assert_allclose(other, one, rtol=0, atol=1e-6 * abs(one).max())


@pytest.mark.parametrize("size", [1.0, 1e3])
def test_exponents_that_merge_are_refused(size):
    critical = np.array([[0.0, 1.0], [-(size**2), -2.0 * size]])
    chain = np.array([[-size, size, 0.0], [0.0, -size, size], [0.0, 0.0, -size]])
    for system in (critical, chain):
        assert separate(system) is None
    with pytest.raises(InputError, match="cannot separate the modes"):
        solve_part(chain)


def test_pairs_of_equal_oscillators_stay_conjugate():
    """Two that are alike, seen through oblique coordinates: one pair of exponents, twice."""
    oblique = np.kron(np.eye(2), [[1.0, 0.999], [0.0, 1e-3]])
    alike = np.kron([[0.0, 1.0], [-25.0, -0.6]], np.eye(2))
    system = oblique @ alike @ np.linalg.inv(oblique)
    exponent, shape, inverse = separate(system)
    upper = -0.3 + 1j * np.sqrt(25.0 - 0.09)
    assert exponent == pytest.approx([upper, upper.conjugate()] * 2, rel=1e-9)
    np.testing.assert_allclose((shape * exponent) @ inverse, system, atol=1e-7)
