"""Set-valued friction in a step: Coulomb's law for any bodies, exactly, and never a source of energy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_case import KernelCase
from scipy.optimize import linprog
from trial_rig import trial_rig

from rubhpc.integrate.marches.workspace import workspace
from rubhpc.kernels.central_difference import FINISHED
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact_forces import fill_residual, solve_contact
from rubhpc.kernels.contact_pairs import N_DEGREE, Pairs
from rubhpc.kernels.laws import COULOMB as COULOMB_LAW
from rubhpc.kernels.laws import MULTIPLIER
from rubhpc.kernels.lemke import solve_lemke
from rubhpc.rig.reading import with_keys

COULOMB = MULTIPLIER._replace(friction_law=COULOMB_LAW)
STEP, SPIN, RADIUS = 1e-6, 150.0, 0.06  # s, rad/s, m


@st.composite
def problems(draw):
    """Pairs at any angles, with any symmetric compliance, some of which penetrate in the step."""
    q = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.normal(size=(5 * q, 5 * q))
    compliance = 1e-9 * (root @ root.T / (5 * q) + np.eye(5 * q))
    rows = np.arange(q * N_DEGREE).reshape(q, N_DEGREE)
    angle = rng.uniform(0, 2 * math.pi, q)
    pairs = Pairs(
        row=rows,
        block=np.zeros_like(rows),
        axis_y=np.cos(angle),
        axis_z=np.sin(angle),
        radius=np.full(q, RADIUS),
        clearance=np.full(q, 1e-4),
        aside=np.zeros(q),
        friction=np.full(q, draw(st.sampled_from([0.0, 0.1, 0.4])) * draw(st.sampled_from([1.0, -1.0]))),
        compliance=compliance.reshape(q, 5, q, 5),
        is_updated=draw(st.booleans()),
        law=COULOMB,
    )
    end = rng.normal(scale=2e-4, size=(q, 5))
    # Slips of a step, of either sense, from what friction can stop to what it cannot.
    start = end - rng.normal(scale=draw(st.sampled_from([1e-7, 1e-6, 1e-5])), size=(q, 5))
    spin = draw(st.sampled_from([0.0, SPIN, -SPIN]))
    return pairs, start, end, spin


def gaps(pairs, at):
    """Gaps (q,) with the degrees `at` (q, 5), and the unit vectors from disc to tip in the plane y + i z."""
    axis = pairs.axis_y + 1j * pairs.axis_z
    line = (pairs.radius + pairs.clearance + at[:, 3] + 1j * at[:, 4]) * axis - (at[:, 0] + 1j * at[:, 1])
    if pairs.is_updated:
        return abs(line) - pairs.radius, line / abs(line)
    return (line * axis.conj()).real - pairs.radius, axis


def slips(pairs, normal, moved, spin):
    """Way of the rim over the tips (q,) for motions `moved` (q, 5) of their degrees in a step."""
    axis = pairs.axis_y + 1j * pairs.axis_z
    apart = moved[:, 0] + 1j * moved[:, 1] - (moved[:, 3] + 1j * moved[:, 4]) * axis
    return pairs.radius * (moved[:, 2] + STEP * spin) + (apart * (1j * normal).conj()).real


@settings(max_examples=300, deadline=None)
@given(problems())
def test_forces_keep_to_coulombs_law(problem):
    pairs, start, end, spin = problem
    work = workspace(pairs, STEP)
    free, normal = gaps(pairs, end)
    work.at[:], work.now[:], work.gap[:] = end, start, free
    work.rate[:] = (end - start) / STEP  # slips turn round in the step only where the forces turn them
    assert solve_contact(pairs, work, STEP, spin) == np.count_nonzero(work.force)
    pivots, residual, moved = work.solution
    assert residual <= 1e-9 * moved + 1e-13
    assert (pivots > 0) == work.force.any()
    force, friction = work.force, work.traction
    along = -normal * force - 1j * normal * friction  # on the disc
    on_tip = -along * (pairs.axis_y - 1j * pairs.axis_z)
    loads = np.stack([along.real, along.imag, -RADIUS * friction, on_tip.real, on_tip.imag], axis=1)
    at = end + np.einsum("iajb,jb->ia", pairs.compliance, loads)
    gap, slip = gaps(pairs, at)[0], slips(pairs, normal, at - start, spin)
    before = slips(pairs, normal, end - start, spin)
    assert (force >= 0.0).all()
    assert gap.min() >= -2e-13
    assert abs(gap * force).max() <= 2e-13 * max(force.max(), 1.0)
    bound = abs(pairs.friction) * force
    assert (abs(friction) <= bound * (1 + 1e-9)).all()
    for i in np.flatnonzero(bound > 0.0):
        tiny = 1e-10 * (abs(before).max() + abs(slip).max())
        if friction[i] * (before[i] + slip[i]) < -1e-9 * bound[i] * abs(before).max():
            raise AssertionError("friction feeds energy in")
        if abs(friction[i]) < bound[i] * (1 - 1e-9):
            turned = before[i] * (before[i] + slip[i]) < 0 or friction[i] == 0.0
            assert abs(slip[i]) <= tiny or turned
        else:
            assert slip[i] * friction[i] >= -tiny * bound[i]
    if bound.any():  # a friction that is not the law's shows
        i = int(bound.argmax())
        friction[i] -= 0.1 * math.copysign(bound[i], friction[i])
        fill_residual(pairs, work)
        give = np.abs(work.tangential[1]).diagonal()[i]
        assert work.solution[1] >= 0.05 * give * bound[i]


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


@pytest.mark.parametrize("is_updated", [False, True])
def test_sliding_that_never_turns_round_is_that_of_the_steady_law(is_updated):
    """The disc thrown between stators, two of which touch at a time: forces and motion to rounding."""
    cases = [
        KernelCase.of(
            trial_rig(3),
            600.0,
            20_000,
            clearance=2e-5,
            friction=0.1,
            is_updated=is_updated,
            law=law,
        )
        for law in (MULTIPLIER, COULOMB)
    ]
    n_both = 0
    for case in cases:
        case.state[1, case.packed.output_row[0]] = 0.4
    for i in range(1000):
        for case in cases:
            assert case.advance(i, i + 1) == FINISHED
        steady, coulomb = cases
        assert coulomb.work.force == pytest.approx(steady.work.force, rel=1e-7, abs=1e-7)
        n_both += np.count_nonzero(steady.work.force) > 1
        assert not coulomb.work.is_sticking.any()
    assert n_both > 0
    scale = abs(steady.state).max(axis=1, keepdims=True)
    assert (abs(coulomb.state - steady.state) <= 1e-9 * scale).all()


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
