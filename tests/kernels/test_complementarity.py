"""Block principal pivoting against the enumeration of all sets of touching pairs."""

import itertools

import numpy as np
import pytest
from calling import called
from hypothesis import given, settings
from hypothesis import strategies as st

from rubhpc.kernels.complementarity import UNSOLVED, residual_of, solve_active, solve_complementarity

residual_of = called(residual_of)
solve_active = called(solve_active)
solve_complementarity = called(solve_complementarity)

TOLERANCE = 1e-12


def solve(compliance, gap, guess=None):
    """Forces (q,) and pivots taken."""
    q = len(gap)
    force, work = np.full(q, np.nan), np.full((q, q + 1), np.nan)
    active = np.asarray(gap) < 0 if guess is None else np.array(guess)
    pivots = solve_complementarity(
        np.asarray(compliance, dtype=float), np.asarray(gap, dtype=float), TOLERANCE, force, active, work
    )
    return force, pivots


def enumerate_solution(compliance, gap):
    """The solution, by trying every set; a P-matrix has exactly one."""
    q = len(gap)
    for size in range(q + 1):
        for chosen in map(list, itertools.combinations(range(q), size)):
            force = np.zeros(q)
            force[chosen] = np.linalg.solve(compliance[np.ix_(chosen, chosen)], -gap[chosen])
            if (force >= -1e-12).all() and (gap + compliance @ force >= -1e-12).all():
                return force
    raise AssertionError("no solution")


@st.composite
def problems(draw):
    """A P-matrix, positive definite plus skew as friction makes it, gaps of either sign, and a guess."""
    q = draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.normal(size=(q, q))
    skew = draw(st.floats(0.0, 5.0)) * rng.normal(size=(q, q))
    compliance = root @ root.T + 0.1 * np.eye(q) + skew - skew.T
    return compliance, rng.normal(size=q) - draw(st.floats(-0.5, 1.0)), draw(st.integers(0, 2**q - 1))


@settings(max_examples=300, deadline=None)
@given(problems())
def test_forces_are_those_of_the_enumeration(problem):
    compliance, gap, bits = problem
    guess = [bool(bits >> i & 1) for i in range(gap.size)]
    expected = enumerate_solution(compliance, gap)
    for start in (None, guess):
        force, pivots = solve(compliance, gap, start)
        assert pivots != UNSOLVED
        assert force == pytest.approx(expected, rel=1e-8, abs=1e-8)
        assert not force[expected == 0.0].any()


@settings(max_examples=100, deadline=None)
@given(problems(), st.floats(0.01, 1.0))
def test_residual_is_nothing_at_the_solution_and_grows_away_from_it(problem, share):
    compliance, gap, _ = problem
    force, _ = solve(compliance, gap)
    residual, moved = residual_of(compliance, gap, force)
    assert residual <= 1e-9 * max(moved, 1.0)
    assert moved == pytest.approx((np.diag(compliance) * force).max())
    if force.any():
        i = int(force.argmax())
        force[i] *= 1.0 - share  # the gap that it closed is open by what it lacks
        assert residual_of(compliance, gap, force)[0] >= 1e-3 * share * compliance[i, i] * force[i]


def test_residual_counts_pull_penetration_and_force_at_a_distance():
    give = np.array([[2.0]])
    for gap, force, expected in ((0.0, -3.0, 6.0), (-0.5, 0.0, 0.5), (4.0, 0.5, 1.0), (-3.0, 1.0, 1.0)):
        residual, _ = residual_of(give, np.array([gap]), np.array([force]))
        assert residual == pytest.approx(expected)


def test_exchange_of_all_at_once_would_go_round_in_circles():
    """Murty's cyclic P-matrix, on which exchanging every violated pair repeats itself for ever."""
    compliance, gap = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 2.0], [2.0, 0.0, 1.0]]), -np.ones(3)

    def exchange_all(active):
        force = np.zeros(3)
        force[active] = np.linalg.solve(compliance[np.ix_(active, active)], -gap[active])
        opening = gap + compliance @ force
        return active ^ np.where(active, force < 0, opening < 0)

    start = np.array([True, False, False])
    seen, active = [], start
    while active.tolist() not in seen:
        seen.append(active.tolist())
        active = exchange_all(active)
    assert (exchange_all(active) != active).any()  # a circle, not a solution
    force, pivots = solve(compliance, gap, start)
    assert pivots > len(seen)
    assert force == pytest.approx(np.full(3, 1 / 3))


@pytest.mark.parametrize(
    ("compliance", "gap"),
    [
        ([[0.0]], [-1.0]),  # nothing yields
        ([[1.0, 1.0], [1.0, 1.0]], [-1.0, -2.0]),  # both gaps are one
        ([[-1.0]], [-1.0]),  # friction jams it: force closes the gap further
    ],
)
def test_problem_without_solution_is_reported(compliance, gap):
    _, pivots = solve(compliance, gap)
    assert pivots == UNSOLVED


def test_active_gaps_are_closed_whatever_the_order_of_pivots():
    """A leading zero on the diagonal, which elimination without row exchange cannot pass."""
    compliance = np.array([[0.0, 2.0, 5.0], [1.0, 1.0, 7.0], [4.0, 4.0, 4.0]])
    gap, active = np.array([-2.0, -3.0, 9.0]), np.array([True, True, False])
    force = np.zeros(3)
    assert solve_active(compliance, gap, active, force, np.zeros((3, 4)))
    assert force == pytest.approx([2.0, 1.0, 0.0])
