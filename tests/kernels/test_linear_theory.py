"""The linear theory about a stable motion, against products of its monodromy matrix."""

import numpy as np
import pytest

from rubhpc.kernels._jit import plain
from rubhpc.kernels.linear_theory import Theory, Watched, fill_theory, is_kept, keeps_contacts

N, RANK = 12, 7


@pytest.fixture(scope="module")
def monodromy():
    """Of rank 7, its largest multipliers a pair of modulus 0.97, in components of very different size."""
    random = np.random.default_rng(5)
    turn = 0.97 * np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    block = np.zeros((N, N))
    block[:2, :2] = turn
    block[2:RANK, 2:RANK] = np.diag(np.linspace(0.1, 0.9, RANK - 2))
    basis = np.eye(N) + 0.2 * random.standard_normal((N, N))
    scale = np.repeat([1e4, 1.0], N // 2)
    return basis @ block @ np.linalg.inv(basis) * scale / scale[:, None], scale


def theory_of(matrix, scale, energy):
    rooms = np.full((8, N, N), np.nan)
    rank, is_stable = fill_theory(matrix, scale, energy, rooms)
    assert is_stable
    span, reading, onward, sums = rooms[:4]
    return Theory(
        span[:rank].copy(), reading[:rank].copy(), onward[:rank, :rank].copy(), sums[:rank, :rank].copy()
    )


def test_theory_has_the_rank_and_the_powers_of_the_matrix(monodromy):
    matrix, scale = monodromy
    theory = theory_of(matrix, scale, scale**2)
    assert len(theory.sums) == RANK
    apart = np.cos(np.arange(N)) / scale
    y = theory.reading @ apart
    for n in range(1, 40):
        moved = np.linalg.matrix_power(matrix, n) @ apart
        size = np.linalg.norm(scale * moved)
        assert np.linalg.norm(scale * (theory.span.T @ y - moved)) < 1e-11 * size
        y = theory.onward.T @ y


def test_sums_are_the_energies_of_all_periods_to_come(monodromy):
    matrix, scale = monodromy
    energy = scale**2
    theory = theory_of(matrix, scale, energy)
    apart = np.cos(np.arange(N)) / scale
    y, moved, total = theory.reading @ apart, apart, 0.0
    for _ in range(1200):
        moved = matrix @ moved
        total += energy @ moved**2
    assert y @ theory.sums @ y == pytest.approx(total, rel=1e-10)


@pytest.mark.parametrize("largest", [1.0, 1.001, 1e3, 1e60])
def test_sums_of_what_does_not_decay_stay_finite(monodromy, largest):
    matrix, scale = monodromy
    rooms = np.full((8, N, N), np.nan)
    rank, is_stable = fill_theory(largest / 0.97 * matrix, scale, scale**2, rooms)
    assert not is_stable
    assert np.isfinite(rooms[3, :rank, :rank]).all()
    assert fill_theory(0.0 * matrix, scale, scale**2, rooms) == (0, True)


def test_contacts_are_looked_at_until_so_much_of_the_distance_is_left(monodromy):
    """Of two functions of time the second vanishes in period 23: it is met, or lies behind the end."""
    matrix, scale = monodromy
    theory = theory_of(matrix, scale, scale**2)
    apart = np.cos(np.arange(N)) / scale
    row = np.sin(np.arange(N)) * scale
    passed = np.array([row @ np.linalg.matrix_power(matrix, n) @ apart for n in range(60)])
    y, squares = theory.reading @ apart, []
    for _ in range(60):
        squares.append(y @ theory.sums @ y)  # after one period, two, ...
        y = theory.onward.T @ y
    change = np.stack([0.0 * row, row], axis=1)
    parts = np.array([[0, 1, 0, 0], [1, 2, 0, 0]])
    lowest = 1 + int(np.argmin(passed[1:]))
    value = np.array([1.0, -passed[lowest] * (1.0 - 1e-9)])
    watched = Watched(parts, value, np.ascontiguousarray(change), theory.span @ change)
    work = np.empty(2 + 2 * RANK)

    def keeps(n_period, least):
        return keeps_contacts(theory, watched, apart, n_period, least, work)

    assert lowest > 1
    assert keeps(lowest, 0.0)
    assert not keeps(lowest + 1, 0.0)
    assert keeps(1000, squares[lowest - 1] * (1 + 1e-9))
    assert not keeps(1000, squares[lowest - 1] * (1 - 1e-9))


@pytest.mark.parametrize(
    ("value", "begins", "ends", "expected"),
    [
        ([1, 1, 1], False, False, True),
        ([-1, 1, 1], False, False, False),
        ([-1, -1, 1], True, False, True),
        ([1, 1, -1], True, False, False),
        ([-1, 1, -1], True, True, True),
        ([1, -1, 1], True, True, False),  # it closes and opens again within
        ([-1, -1, -1], True, True, False),  # it is left out
        ([1, 1, np.nan], False, False, False),
    ],
)
def test_function_may_be_negative_by_the_ends_where_it_vanishes(value, begins, ends, expected):
    assert plain(is_kept)(np.array(value, dtype=float), begins, ends) is expected
