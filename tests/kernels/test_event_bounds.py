"""How long no switch function can vanish unseen, against many instants; in Python: nothing is compiled."""

from types import SimpleNamespace

import numpy as np
import pytest

from rubhpc.kernels import event_bounds
from rubhpc.kernels._jit import plain
from rubhpc.kernels.friction_states import FORWARD

TICK = 1e-6  # s
BOUNDS = ("positive_until", "is_positive", "falling_until", "ticks_beyond", "floor_log2")
BOUNDS += ("is_watched", "state_of")
DERIVATIVES = ("switch_re", "switch_im", "rate_re", "rate_im", "bend_re", "bend_im")


@pytest.fixture(autouse=True)
def in_python(monkeypatch):
    for name in BOUNDS:
        monkeypatch.setattr(event_bounds, name, plain(getattr(event_bounds, name)))


@pytest.mark.parametrize("n_fast", [0, 2])
def test_no_function_changes_unseen_within_the_interval_that_is_promised(n_fast):
    """Two of four coordinates may decay fast, without vibration; bounds hold them apart."""

    def values_of(ticks):
        return (rows @ np.exp(np.outer(exponents, TICK * ticks))).real

    random, n_seen, n_long = np.random.default_rng(3), 0, 0
    for _ in range(400):
        m = 4
        exponents = (-random.uniform(0.0, 1e-3, m) + 1j * random.uniform(0.0, 1e-2, m)) / TICK
        exponents[:n_fast] = -(10.0 ** random.uniform(-2.0, 1.0, n_fast)) / TICK
        rows = random.normal(size=(2, m)) + 1j * random.normal(size=(2, m))
        rows *= np.sign(rows.real.sum(axis=1))[:, None]  # positive at first
        rate, bend, size = rows * exponents, rows * exponents**2, abs(rows)
        derivatives = (of[None] for term in (rows, rate, bend) for of in (term.real, term.imag))
        turn = size * abs(exponents) ** 3
        turn[:, :n_fast] *= -1.0
        z_re, z_im = np.ones(m), np.zeros(m)
        known = np.zeros((2, 2), dtype=np.int64)
        now, shortest, longest = 7, 1, 10_000
        tables = SimpleNamespace(**dict(zip(DERIVATIVES, derivatives, strict=True)), turn=turn[None])
        given = (FORWARD, tables, 0, z_re, z_im, now, TICK, shortest, longest)
        free, sure = plain(event_bounds.free_until)(*given, known)
        assert now <= free <= sure <= known[1].min() <= now + longest
        assert free <= known[0].min()
        assert (known[0] <= known[1]).all()
        assert values_of(np.linspace(0.0, free - now, 200)).min() > -1e-12
        n_long += n_fast > 0 and (free - now) * TICK * abs(exponents[:n_fast]).max() > 3.0
        for j in range(2):  # one that has vanished is negative from then on
            is_negative = values_of(np.linspace(0.0, known[1, j] - now, 400))[j] < -1e-12
            assert not (is_negative[:-1] & ~is_negative[1:]).any()
            n_seen += is_negative.any()
        # What is known, and comes later than another, is not asked again.
        later = int(known[1].argmax())
        known[1, later] = marked = known[1, later] + 1
        again = plain(event_bounds.free_until)(*given, known)
        assert again[0] == free
        assert sure <= again[1] <= known[1].min()
        assert known[1, later] == marked
    assert n_seen > 100
    assert n_fast == 0 or n_long > 100  # longer than what decays lasts
