"""The search for an event within a step, against every tick of it; in Python, so that nothing is compiled."""

from types import SimpleNamespace

import numpy as np
import pytest

from rubhpc.kernels import coordinate_steps, event_loop, event_search
from rubhpc.kernels._jit import plain
from rubhpc.kernels.friction_states import FORWARD, OPEN, FrictionBodies
from rubhpc.kernels.mode_change import GAP_TOLERANCE

LEVEL, TICK = 10, 1e-6  # 1024 ticks
N_TICK = 1 << LEVEL
BODIES = FrictionBodies(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((2, 0)), np.zeros((2, 2)))
NAMES = (
    "root_between",
    "look_ahead",
    "move_ticks",
    "find_change",
    "go_on",
    "dot",
    "state_of",
)
NAMES += ("stuck_pairs", "used_width", "floor_log2")
STEPS = ("turn_on", "lowest_level", "floor_log2")


@pytest.fixture(autouse=True)
def in_python(monkeypatch):
    for name in NAMES:
        monkeypatch.setattr(event_search, name, plain(getattr(event_search, name)))
    for name in STEPS:
        monkeypatch.setattr(coordinate_steps, name, plain(getattr(coordinate_steps, name)))


def tables_of(exponents, rows, state):
    """Tables of one mode with these exponents (m,), 1/s, and switch functions (2, m) of the coordinates."""
    power = np.exp(np.outer(TICK * 2.0 ** np.arange(LEVEL + 1), exponents))
    rate = rows * exponents
    return SimpleNamespace(
        mask=np.array([state]),
        n_eigenmode=np.array([0]),
        switch_re=rows.real[None],
        switch_im=rows.imag[None],
        rate_re=rate.real[None],
        rate_im=rate.imag[None],
        bound=(abs(rows) * abs(exponents) ** 2)[None],
        bend_re=(rate * exponents).real[None],
        bend_im=(rate * exponents).imag[None],
        turn=(abs(rows) * abs(exponents) ** 3)[None],
        power_re=power.real[None],
        power_im=power.imag[None],
    )


def values_of(exponents, rows, ticks):
    """Switch functions (2, n) at these ticks, from coordinates that are 1 at tick 0."""
    return (rows @ np.exp(np.outer(exponents, TICK * ticks))).real


def changes_at(tables, z, overlap, known):
    """Bits of the switch functions that are negative at coordinates (2, m)."""
    switch, rate = (tables.switch_re, tables.switch_im), (tables.rate_re, tables.rate_im)
    given = (tables.mask[0], 0, *switch, *z, *rate, overlap, N_TICK, known)
    return plain(event_search.find_change)(*given)


def search(exponents, rows, state=FORWARD):
    """Ticks passed, and what is negative a tick later; coordinates stand at that tick."""
    tables = tables_of(exponents, rows, state)
    z = np.array([np.ones(exponents.size), np.zeros(exponents.size)])
    end = np.empty((2, exponents.size))
    plain(event_search.move_ticks)(tables, BODIES, 0, N_TICK, TICK, z, end)
    known = np.zeros((2, 2), dtype=np.int64)
    crossing = changes_at(tables, end, GAP_TOLERANCE, known)
    assert crossing != 0
    clock = SimpleNamespace(tick=TICK)
    passed, crossing = plain(event_search.approach_change)(
        tables, BODIES, clock, 0, crossing, GAP_TOLERANCE, N_TICK, z, end, 0, known
    )
    assert z[0] + 1j * z[1] == pytest.approx(np.exp(exponents * TICK * passed), rel=1e-12)
    return passed, crossing


def bits(values):
    return int(values[0] < 0.0) | int(values[1] < 0.0) << 1


def around(root, *waves):
    """Exponents and the row of `sum a sin(w (t - root))`, t in ticks, waves (a, w)."""
    exponents = np.array([1j * w / TICK for _, w in waves])
    return exponents, np.array([-1j * a * np.exp(-1j * w * root) for a, w in waves])


PLACES = (0.4, 1.5, 300.37, 511.9, 512.2, 1022.3, 1023.6)


@pytest.mark.parametrize("root", PLACES)
@pytest.mark.parametrize(
    "waves",
    [
        ((-1.0, 1e-3),),  # a simple root
        ((-1.0, 5e-4), (0.5, 1e-3)),  # a threefold one: flat
        ((-1.0, 1e-5), (-1e-3, 0.3)),  # a fast ripple on a slow fall; falls more than once near the root
    ],
)
def test_a_root_is_found_to_the_tick(root, waves):
    exponents, row = around(root, *waves)
    rows = np.stack([row, 0.0 * row])
    exponents, rows = np.append(exponents, 0.0), np.column_stack([rows, [0.0, 1.0]])  # the other stays 1
    passed, crossing = search(exponents, rows)
    values = values_of(exponents, rows, np.arange(N_TICK + 1))
    assert bits(values[:, passed]) == 0 or passed == 0
    assert crossing == bits(values[:, passed + 1]) == 1
    if len(waves) == 1 or waves[1][1] < 0.1:  # there is one root only
        assert passed == int(root)


def test_first_of_two_functions_is_found_and_both_where_they_fall_together():
    for places in ((300.5, 700.5), (700.5, 300.5), (300.5, 300.6)):
        parts = [around(place, (-1.0, 1e-3)) for place in places]
        exponents = np.array([parts[0][0][0]])
        passed, crossing = search(exponents, np.stack([part[1] for part in parts]))
        assert passed == int(min(places))
        assert crossing == sum(1 << j for j in range(2) if int(places[j]) == passed)


def test_a_function_that_begins_negative_ends_at_the_first_tick():
    exponents, row = around(-5.0, (-1.0, 1e-3))
    assert search(exponents, np.stack([row, -row]))[0] == 0


def test_a_double_root_is_passed_on_the_way_to_the_next():
    """It comes within 1e-6 of zero at tick 300.5, and falls below it once, after tick 850."""
    w = 2.0 * np.pi / 600.0
    exponents = np.array([0.0, 1j * w, 0.03]) / TICK
    rows = np.zeros((2, 3), dtype=complex)
    rows[0], rows[1, 0] = (1.0 + 1e-6, -np.exp(-300.5j * w), -10.0 * np.exp(-0.03 * N_TICK)), 1.0
    negative = values_of(exponents, rows, np.arange(N_TICK + 1))[0] < 0.0
    passed, crossing = search(exponents, rows)
    assert crossing == 1
    assert passed + 1 == np.argmax(negative) > 850


def test_an_open_pair_is_looked_at_for_its_gap_alone():
    exponents, row = around(400.5, (-1.0, 1e-3))
    assert search(exponents, np.stack([row, -row]), state=OPEN) == (400, 1)


def test_a_step_of_any_ticks_is_made_up_of_powers_of_two():
    exponents = np.array([-300.0 + 4000.0j, -5.0 + 90.0j])
    tables = tables_of(exponents, np.ones((2, 2), dtype=complex), FORWARD)
    for count in (1, 2, 3, 12, 37, 640, 1023, N_TICK):
        after, z = np.exp(exponents * TICK * count), np.array([np.ones(2), np.zeros(2)])
        end = np.empty((2, 2))
        plain(coordinate_steps.go_on)(count, tables.power_re[0], tables.power_im[0], *z, *end)
        assert end[0] + 1j * end[1] == pytest.approx(after, rel=1e-12)
        plain(coordinate_steps.turn_on)(count, tables.power_re[0], tables.power_im[0], *z)
        assert np.array_equal(z, end)


@pytest.mark.parametrize(
    ("exponent", "overlap", "is_seen"),
    [(-1.0, 1e-5, False), (-1.0, 1e-7, True), (-1.0, GAP_TOLERANCE, True), (1.0, 1e-5, True)],
)
def test_overlap_of_an_open_pair(exponent, overlap, is_seen, monkeypatch):
    """It is no event while the pair parts, up to a bound; an overlap that grows is one."""
    tables = tables_of(np.array([exponent]), np.array([[-1e-6], [1.0]]), OPEN)
    z = np.array([[1.0], [0.0]])
    known = np.zeros((2, 2), dtype=np.int64)
    assert changes_at(tables, z, overlap, known) == is_seen
    found, soon, *_ = plain(event_search.look_ahead)(tables, 0, 0, overlap, 1e-30, N_TICK, known, *z)
    assert found == soon == is_seen
    monkeypatch.setattr(event_loop, "dot", plain(event_loop.dot))
    rows = [part[:, :1] for part in (tables.switch_re, tables.switch_im, tables.rate_re, tables.rate_im)]
    assert plain(event_loop.find_crossing)(0, 0, *rows, z[0], z[1], overlap) == is_seen
