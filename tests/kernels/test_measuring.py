"""What the exact integrator measures between its steps."""

import numpy as np
import pytest
from calling import called

from rubhpc.kernels.cubics import turning_value

turning_value = called(turning_value)


@pytest.mark.parametrize("seed", range(20))
def test_turning_value_is_the_cubics_extremum(seed):
    rng = np.random.default_rng(seed)
    step = 10.0 ** rng.uniform(-6, 0)
    before, after = rng.normal(size=2)
    rate_before = rng.normal() / step
    rate_after = -np.sign(rate_before) * rng.uniform(0.01, 3.0) / step
    rows = np.array([[0, 0, 0, 1], [1, 1, 1, 1], [0, 0, 1, 0], [3, 2, 1, 0]], dtype=float)
    cubic = np.linalg.solve(rows, [before, after, rate_before * step, rate_after * step])
    root = np.roots(np.polyder(cubic))
    inside = root[(root.imag == 0) & (root.real > 0) & (root.real < 1)].real
    assert inside.size == 1
    found = turning_value(before, rate_before, after, rate_after, step)
    assert found == pytest.approx(np.polyval(cubic, inside[0]), rel=1e-9, abs=1e-12)
