"""How long no switch function can vanish unseen, against many instants; in Python: nothing is compiled."""

import numpy as np
import pytest

from rubhpc.kernels import earlier_spans, event_bounds
from rubhpc.kernels._jit import plain
from rubhpc.kernels.friction_states import FORWARD

TICK = 1e-6  # s
BOUNDS = ("positive_until", "is_positive", "least_until", "falling_until", "ticks_beyond", "floor_log2")
BOUNDS += ("is_watched", "known_until", "note_interval")
SPANS = ("is_watched", "learn", "weigh", "compare", "state_of")


@pytest.fixture(autouse=True)
def in_python(monkeypatch):
    for module, names in ((event_bounds, BOUNDS), (earlier_spans, SPANS)):
        for name in names:
            monkeypatch.setattr(module, name, plain(getattr(module, name)))


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
        given = (FORWARD, 0, *derivatives, turn[None], z_re, z_im, now, TICK, shortest, longest)
        none = earlier_spans.no_earlier_spans()
        free, sure = plain(event_bounds.free_until)(*given, known, none)
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
        again = plain(event_bounds.free_until)(*given, known, none)
        assert again[0] == free
        assert sure <= again[1] <= known[1].min()
        assert known[1, later] == marked
    assert n_seen > 100
    assert n_fast == 0 or n_long > 100  # longer than what decays lasts


def test_an_earlier_span_answers_for_those_that_begin_near_it():
    """Spans of random coordinates, slow, fast and decaying, from random beginnings near that of the first."""
    random, n_compared, n_asked, n_whole = np.random.default_rng(5), 0, 0, 0
    pace = 10.0 ** np.array([-5.0, -4.0, -3.0, -2.5, -2.0, -1.0]) / TICK
    for _ in range(100):
        m = pace.size
        exponents = pace * np.exp(1j * random.uniform(0.5, 0.7, m) * np.pi)
        # Fast decays, and one that grows.
        exponents[-2:], exponents[0] = (
            -pace[-2:],
            1j * pace[0] + 1e-6 / TICK,
        )
        rows = random.normal(size=(2, m)) + 1j * random.normal(size=(2, m))
        rows[:, 1] = -rows[:, 0] * (1.0 + 1e-3 * random.normal(size=2))  # two that nearly cancel
        power = np.exp(np.outer(TICK * 2.0 ** np.arange(14), exponents))
        begun = random.normal(size=m) + 1j * random.normal(size=m)
        rows *= np.sign((rows @ begun).real)[:, None]
        turn = abs(rows) * abs(exponents) ** 3 * np.where(exponents.imag == 0.0, -1.0, np.exp(0.02))
        parts = [part[None] for term in (rows, rows * exponents) for part in (term.real, term.imag)]
        bends = [part[None] for part in ((rows * exponents**2).real, (rows * exponents**2).imag)]
        earlier, tick, asked = earlier_spans.earlier_spans(m, 1), 100, None
        for distance in (0.0, 1e-6, 1e-4, 1e-2, 1.0):
            away = distance * (random.normal(size=m) + 1j * random.normal(size=m))
            away[1] = away[0]
            z = begun + away
            tables = (*parts, abs(exponents)[None], power.real[None], power.imag[None])
            earlier.now[earlier_spans.ROLE] = earlier_spans.AWAITED
            is_compared = plain(earlier_spans.begin_bounds)(
                earlier, FORWARD, 0, *tables, z.real.copy(), z.imag.copy(), tick, TICK
            )
            now, known = tick + 4, np.full((2, 2), tick)
            while now < tick + 3000:
                here = z * np.exp(exponents * TICK * (now - tick))
                if (rows @ here).real.min() < 0.0:
                    break
                given = (FORWARD, 0, *parts, *bends, turn[None], here.real, here.imag, now, TICK, 4, 2**13)
                free, _ = plain(event_bounds.free_until)(*given, known, earlier)
                for j in range(2):
                    ticks = np.linspace(now - tick, known[0, j] - tick, 200)
                    values = (rows[j] @ (z[:, None] * np.exp(np.outer(exponents, TICK * ticks)))).real
                    assert values.min() > -1e-12
                now = max(free, now + 4)
            n_now = int(earlier.now[earlier_spans.ASKED])
            asked = n_now if asked is None else asked
            if is_compared and distance == 1e-6:
                n_compared, n_asked, n_whole = n_compared + 1, n_asked + n_now, n_whole + asked
            plain(earlier_spans.end_bounds)(earlier, FORWARD, now)
            tick = now
    assert n_compared == 100
    assert n_asked < 0.5 * n_whole  # bounds are found elsewhere


def test_a_span_that_answers_for_nothing_is_asked_less_and_less():
    earlier, moves, tick = earlier_spans.earlier_spans(1, 1), np.ones((1, 1)), 0
    parts = [part * moves[None] for part in (1.0, 0.0, 0.0, 1.0)]
    roles = []
    for k in range(60):
        z = np.array([float(k)])
        tables = (*parts, moves, moves[None], moves[None])
        earlier.now[earlier_spans.ROLE] = earlier_spans.AWAITED
        plain(earlier_spans.begin_bounds)(earlier, FORWARD, 0, *tables, z, z, tick, TICK)
        roles.append(int(earlier.now[earlier_spans.ROLE]))
        earlier.now[earlier_spans.ASKED], tick = 3, tick + 100
        plain(earlier_spans.end_bounds)(earlier, FORWARD, tick)
    assert roles[:4] == [earlier_spans.LEARNING, earlier_spans.COMPARED] * 2
    assert roles[40:].count(earlier_spans.IDLE) > 14
