"""Set-valued friction in a step: Coulomb's law for any bodies, exactly, and never a source of energy."""

import math

import numpy as np
import pytest
from kernel_case import KernelCase
from scipy.optimize import linprog
from trial_rig import trial_rig

from rubhpc.kernels.central_difference.march import FINISHED
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.laws import COULOMB as COULOMB_LAW
from rubhpc.kernels.laws import MULTIPLIER
from rubhpc.kernels.lemke import solve_lemke
from rubhpc.rig.reading import with_keys

COULOMB = MULTIPLIER._replace(friction_law=COULOMB_LAW)


def test_complementarity_with_a_zero_diagonal_is_solved():
    """Lemke's method where principal pivoting has nothing to divide by."""
    tableau = np.zeros((2, 6))
    matrix, constant = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([-1.0, 2.0])
    tableau[:, :2], tableau[:, 2:4], tableau[:, 4], tableau[:, 5] = np.eye(2), -matrix, -1.0, constant
    basis = np.zeros(2, dtype=np.int64)
    assert solve_lemke(tableau, basis, 2) > 0
    z = np.zeros(4)
    z[basis] = tableau[:, 5]
    assert z[2:] == pytest.approx([0.0, 1.0]) or z[2:] == pytest.approx([2.0, 1.0])
    assert (matrix @ z[2:] + constant).min() >= -1e-15


def test_problem_without_solution_is_reported():
    tableau = np.array([[1.0, 1.0, -1.0, -1.0]])  # w = -z - 1
    assert solve_lemke(tableau, np.zeros(1, dtype=np.int64), 1) == UNSOLVED
    assert linprog([0.0], A_ub=[[1.0]], b_ub=[-1.0], bounds=[(0, None)]).status == 2  # infeasible indeed


@pytest.mark.parametrize("spin", [1e-10, -1e-10])
def test_friction_never_feeds_energy_in(spin):
    """Undamped, no unbalance, a rim that all but stands: energy falls at every step as slips turn round."""
    still = {
        "rotor.damping.alpha": 0.0,
        "rotor.bearing.1.cyy": 0.0,
        "rotor.bearing.1.czz": 0.0,
        "rotor.bearing.2.damping": 0.0,
        "stator.damping.beta": 0.0,
        "rotor.unbalance.mass": 0.0,
    }
    step = 1e-6
    case = KernelCase.of(
        with_keys(trial_rig(2), still),
        spin,
        round(2 * math.pi / (abs(spin) * step)),
        clearance=2e-6,
        friction=0.4,
        law=COULOMB,
    )
    rng = np.random.default_rng(1)
    case.state[1] = rng.normal(scale=0.05, size=case.state.shape[1])
    energies, turns, sticks, was = [], 0, 0, np.zeros(2)
    for i in range(4000):
        assert case.advance(i, i + 1) == FINISHED
        displacement, velocity = case.state
        before = displacement - case.step * velocity
        energies.append(
            velocity @ case.packed.mass @ velocity + before @ case.packed.stiffness @ displacement
        )
        turns += np.count_nonzero(case.work.traction * was < 0)
        sticks += np.count_nonzero(case.work.is_sticking)
        was = case.work.traction.copy()
    assert turns > 10
    assert sticks > 10
    assert np.diff(energies).max() < 1e-12 * energies[0]
    assert energies[-1] < 0.999 * energies[0]
