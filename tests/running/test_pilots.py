"""How many cases `rubhpc plan` times."""

from types import SimpleNamespace

import numpy as np
import pytest

from rubhpc.running import pilots


@pytest.mark.parametrize(
    ("costs", "n_pilot"),
    [
        ([1.0] * 64, 6),  # they agree
        ([0.1] * 15 + [9.0] + [0.125] * 48, 29),  # a rub among free motions: 12 s are spent
        ([0.01] * 64, 64),
    ],
    ids=["equal", "one differs", "short"],
)
def test_more_cases_are_timed_where_they_differ(costs, n_pilot, monkeypatch):
    now = [0.0]

    class Pilots:
        loading = compiling = 0.0
        was_cut, record = False, None

        def __init__(self, grid):
            pass

        def pace(self, index, steps):
            now[0] += costs[index[0]]
            return pilots.Pace(costs[index[0]] / steps, 0.0, 0.0, 0.0)

    monkeypatch.setattr(pilots, "_Pilots", Pilots)
    monkeypatch.setattr(pilots, "_picked", lambda *_: (((i,), 1e3) for i in range(64)))
    monkeypatch.setattr(pilots, "time", SimpleNamespace(process_time=lambda: now[0]))
    grid = SimpleNamespace(study=SimpleNamespace(branch=None))
    timing = pilots.time_pilots(grid, None, [], np.ones(1000, dtype=bool))
    assert timing.n_pilot == n_pilot
    assert timing.pace.step == pytest.approx(np.mean(costs[:n_pilot]) / 1e3)
