"""The largest mean of a force over a short time, against the same from a fine grid of its impulse."""

import math
from itertools import pairwise

import numpy as np
import pytest
from calling import called

from rubhpc.integrate.measuring.samples import following_accumulator, new_accumulator
from rubhpc.kernels.accumulators import Accumulator
from rubhpc.kernels.force_average import AVERAGING_TIME, LOUD, MOST_PIECES, add_force

add_force = called(add_force)


def add(pieces, accumulator: Accumulator | None = None, i=0):
    """Mean found of pieces (begin, step, impulse, first, last)."""
    accumulator = accumulator or new_accumulator(2)
    for piece in pieces:
        add_force(
            i,
            *piece,
            accumulator.origin,
            accumulator.force_piece,
            accumulator.force_held,
            accumulator.peak_force,
        )
    return accumulator


def pieces_of(force, integral, ends):
    """Pieces of a force between ends (s), of which the integral is known."""
    return [(a, b - a, integral(b) - integral(a), force(a), force(b)) for a, b in pairwise(ends)]


def on_a_grid(pieces, n=400_000):
    """The same from the impulse at n times, by linear interpolation of forces within pieces."""
    begin, step, impulse, first, last = np.array(pieces).T
    total = np.concatenate([[0.0], np.cumsum(impulse)])
    times = np.linspace(begin[0] - AVERAGING_TIME, (begin + step)[-1] + AVERAGING_TIME, n)

    def passed(time):
        k = np.searchsorted(begin, time, side="right") - 1
        s = np.clip((time - begin[k]) / np.where(step[k] > 0.0, step[k], 1.0), 0.0, 1.0)
        s = np.where(step[k] > 0.0, s, 1.0)
        a, b = first[k] * step[k], last[k] * step[k]
        within = s * (a + s * (3.0 * impulse[k] - 2.0 * a - b + s * (a + b - 2.0 * impulse[k])))
        within = np.where(step[k] > 0.0, within, impulse[k])
        return np.where(k < 0, 0.0, total[np.maximum(k, 0)] + within)

    return (passed(times) - passed(times - AVERAGING_TIME)).max() / AVERAGING_TIME


@pytest.mark.parametrize("longest", [1e-6, 8e-6, 60e-6])
def test_pieces_that_cannot_pass_the_peak_are_left_out_bit_for_bit(longest):
    rng = np.random.default_rng(7)
    quick, whole, n_quiet, time = new_accumulator(1), new_accumulator(1), 0, 0.0
    for n in range(3000):
        step = 0.0 if rng.random() < 0.02 else longest * rng.random()
        first, last = rng.random(2) * (0.2 + math.sin(0.01 * n) ** 2)
        share = step * (0.5 * (first + last) + 0.1 * rng.random()) if step > 0.0 else 1e-6 * rng.random()
        for seen in (quick, whole):
            add([(time, step, share, first, last)], seen)
        n_quiet += time - AVERAGING_TIME >= quick.force_piece[0, LOUD, 0]
        whole.force_piece[0, LOUD, 0] = np.inf
        assert quick.peak_force.tobytes() == whole.peak_force.tobytes()
        time += step + (0.0 if rng.random() < 0.9 else longest * rng.random())
    assert n_quiet > 300


@pytest.mark.parametrize("step", [0.7e-6, 7e-6, 35e-6])
def test_mean_of_half_a_sine_is_lower_by_a_known_share(step):
    """The mean over T about the crest is sin(w T / 2) / (w T / 2) of it."""
    w = math.pi / 1e-3
    ends = np.append(np.arange(0.0, 1e-3, step), 1e-3)
    found = add(pieces_of(lambda t: math.sin(w * t), lambda t: (1.0 - math.cos(w * t)) / w, ends))
    half = 0.5 * w * AVERAGING_TIME
    assert found.peak_force == pytest.approx([math.sin(half) / half, 0.0], rel=1e-6)  # of cubics over 35 us


def test_mean_of_a_force_that_is_infinite_at_touch_is_finite():
    """That of a viscous rod, one over the root of time: its largest mean is twice its value at the end."""
    ends = np.concatenate([[0.0], 1e-12 * 1.5 ** np.arange(45)])
    pieces = pieces_of(lambda t: t**-0.5 if t > 0.0 else 1e6, lambda t: 2.0 * t**0.5, ends)
    assert add(pieces).peak_force[0] == pytest.approx(2.0 * AVERAGING_TIME**-0.5, rel=1e-3)


def test_impulses_are_shared_out_over_the_averaging_time():
    found = add([(0.0, 0.0, 3e-3, 0.0, 0.0), (15e-6, 0.0, 1e-3, 0.0, 0.0), (30e-6, 0.0, 2e-3, 0.0, 0.0)])
    assert found.peak_force[0] == pytest.approx(4e-3 / AVERAGING_TIME)


@pytest.mark.parametrize("seed", range(8))
def test_random_contacts_impacts_and_flights_agree_with_a_fine_grid(seed):
    rng = np.random.default_rng(seed)
    pieces, time, last = [], 0.0, 0.0
    for _ in range(60):
        kind = rng.integers(4)
        if kind == 0:
            time, last = time + 30e-6 * rng.random(), 0.0
        elif kind == 1:
            pieces.append((time, 0.0, 1e-3 * rng.random(), 0.0, 0.0))
        else:
            step, after = 10.0 ** rng.uniform(-7, -4.5), 100.0 * rng.random()
            first = last if kind == 2 else 100.0 * rng.random()
            pieces.append((time, step, step * (0.5 * (first + after) + 5.0 * rng.random()), first, after))
            time, last = time + step, after
    assert add(pieces, i=1).peak_force[1] == pytest.approx(on_a_grid(pieces), rel=2e-4)


@pytest.mark.parametrize("n", [100, 1000])
def test_short_pieces_become_one(n):
    """Of steps of 60 and 6 ns there are more than there is room for."""
    ends, w = np.linspace(0.0, 3.0 * AVERAGING_TIME, 10 * n), 2e5
    pieces = pieces_of(lambda t: 2.0 + math.sin(w * t), lambda t: 2.0 * t - math.cos(w * t) / w, ends)
    found = add(pieces)
    assert found.peak_force[0] == pytest.approx(on_a_grid(pieces), rel=1e-4)
    assert found.force_held[0, 1] <= MOST_PIECES
    halves = []
    for begin, step, impulse, first, last in pieces:  # one half sudden: no two pieces may become one
        halves.append((begin, 0.0, 0.5 * impulse, 0.0, 0.0))
        halves.append((begin, step, 0.5 * impulse, 0.5 * first, 0.5 * last))
    assert add(halves).peak_force[0] == pytest.approx(on_a_grid(pieces), rel=2e-2)


def test_means_reach_back_beyond_the_beginning_of_a_following_march():
    """Six pieces of 5 us, the first three of another march, whose clock has begun 15 us before."""
    force = [1.0, 4.0, 5.0, 9.0, 3.0, 2.0]
    pieces = [(5e-6 * n, 5e-6, 5e-6 * f, f, f) for n, f in enumerate(force)]
    whole = add(pieces)
    first = add(pieces[:3])
    second = add(
        [(piece[0] - 15e-6, *piece[1:]) for piece in pieces[3:]], following_accumulator(first, 15e-6)
    )
    assert second.peak_force[0] == whole.peak_force[0] == pytest.approx(5.25)
    assert first.peak_force[0] == pytest.approx(2.5)  # as it was
