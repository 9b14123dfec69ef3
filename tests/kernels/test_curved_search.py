"""Where a polynomial through a step says that a force vanishes, against roots that it was made of."""

import numpy as np
import pytest
from calling import called

from rubhpc.kernels.curved_search import first_root, next_root

first_root = called(first_root)
next_root = called(next_root)


def falling(*roots):
    """Coefficients of a polynomial of degree 4 with these real roots, positive before the first."""
    others = [3.0 + 1.0j, 3.0 - 1.0j, 5.0, -4.0][: 4 - len(roots)]
    course = np.poly([*roots, *others]).real[::-1]
    return np.ascontiguousarray(course * np.sign(np.polyval(course[::-1], min(roots) - 1e-3)))


@pytest.mark.parametrize("root", [1e-6, 0.1, 1 / 3, 0.5, 0.999])
def test_first_root_is_that_of_the_polynomial(root):
    found = first_root(falling(root, 1.7))
    assert found == pytest.approx(root, abs=1e-8)
    assert found <= root


def test_first_of_several_roots_is_found():
    assert first_root(falling(0.31, 0.37, 0.8)) == pytest.approx(0.31, abs=1e-8)


def test_without_a_root_it_is_where_the_polynomial_is_least():
    course = np.array([0.25 + 1e-6, -1.0, 1.0, 0.0, 0.0])  # (x - 1/2)^2 and a little
    assert first_root(course) == pytest.approx(0.5, abs=1 / 32)


@pytest.mark.parametrize("root", [1.0, 1.01, 1.2])
def test_next_root_lies_beyond_the_step(root):
    assert next_root(falling(root, 2.5)) == pytest.approx(root, abs=1e-4)


def test_what_rises_has_no_next_root():
    assert next_root(np.array([1.0, 0.5, 0.1, 0.0, 0.0])) == np.inf
