"""Where a motion that settles will end, from its last revolutions."""

import numpy as np
import pytest

from rubhpc.integrate.periodic_motions.extrapolation import extrapolated

N = 12


def passed(n_mode, n_motion):
    """Motions about a fixed point in some modes, the fixed point, and weights."""
    random = np.random.default_rng(n_mode)
    shapes = np.linalg.qr(random.standard_normal((N, N)))[0]
    values = np.zeros(N)
    values[:n_mode] = np.linspace(0.99, -0.9, n_mode)
    matrix = shapes @ np.diag(values) @ shapes.T
    fixed, apart = random.standard_normal(N), shapes[:, :n_mode] @ np.ones(n_mode)
    motions = []
    for _ in range(n_motion):
        motions.append(fixed + apart)
        apart = matrix @ apart
    return np.array(motions), fixed, 1.0 + random.random(N)


@pytest.mark.parametrize(("n_mode", "n_motion"), [(1, 3), (3, 5), (5, 7), (5, 12)])
def test_fixed_point_is_found_where_few_modes_are_left(n_mode, n_motion):
    motions, fixed, energy = passed(n_mode, n_motion)
    away = np.abs(motions[-1] - fixed).max()
    assert np.abs(extrapolated(motions, energy) - fixed).max() < 1e-6 * away


def test_too_few_motions_do_not_show_it():
    motions, fixed, energy = passed(5, 6)
    assert np.abs(extrapolated(motions, energy) - fixed).max() > 1e-3
    for few in (1, 2):
        assert np.array_equal(extrapolated(motions[:few], energy), motions[few - 1])


@pytest.mark.parametrize("width", [2, 4])
def test_few_degrees_and_many_motions(width):
    motions = 2.0 + np.outer(0.5 ** np.arange(12), np.arange(1.0, width + 1.0))
    assert extrapolated(motions, np.ones(width)) == pytest.approx(np.full(width, 2.0), abs=1e-12)
