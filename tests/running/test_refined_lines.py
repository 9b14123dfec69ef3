"""Cases that a refined map will compute, from some of its lines, against those that its rule asks for."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rubhpc.running.refined_lines import Lines, OutOfTime, count_on_lines
from rubhpc.study.edges import Results
from rubhpc.study.levels import Levels


class Map:
    """A refined map of flags that are known from the start, asked for as `storage.refined.Refinement` is."""

    def __init__(self, levels, flags, flat=None):
        self.levels, self._flags = levels, flags
        self._flat = np.arange(flags.size) if flat is None else flat
        self.is_known = np.zeros(levels.shape, bool)

    def _results(self):
        flags = np.where(self.is_known, self._flags, -1)
        return Results(is_known=self.is_known, is_failed=np.zeros(flags.shape, bool), classes=[flags])

    def asked(self):
        return self.levels.asked(self._results())

    def missing_cases(self):
        return self._flat[np.flatnonzero(self.asked().cases & ~self.is_known)]

    def count_ends(self):
        return self.levels.count_ends(self._results())

    def within(self, window):
        flat = self._flat.reshape(self.levels.shape)[window]
        levels = Levels(flat.shape, self.levels.refined, self.levels.coarse)
        return Map(levels, self._flags[window], flat.ravel())

    def enter(self, cases):
        self.is_known.reshape(-1)[np.searchsorted(self._flat, cases)] = True

    def n_computed(self):
        """Cases that are computed in the end."""
        while len(missing := self.missing_cases()):
            self.enter(missing)
        return int(self.is_known.sum())


def tongues(n, m, number, seed):
    """Flags (n, m) with leaning, wavy tongues."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, m), indexing="ij")
    flags = np.zeros((n, m), int)
    for i in range(number):
        foot, lean, turn = rng.uniform(size=3)
        centre = foot + (lean - 0.5) * (y - turn) + 0.02 * np.sin(40 * y * turn + 6 * lean)
        flags[np.abs(x - centre) < rng.uniform(0.002, 0.15) * (0.2 + y)] = i + 1
    return flags


@pytest.mark.parametrize(
    ("n", "m", "number", "coarse"), [(200, 200, 10, 8), (100, 40, 5, 4), (300, 200, 40, 16)]
)
@pytest.mark.parametrize("seed", [0, 1])
def test_number_of_cases_of_a_map_of_tongues(n, m, number, coarse, seed):
    flags = tongues(n, m, number, seed)
    levels = Levels(flags.shape, (1, 0), coarse)
    found = count_on_lines(Map(levels, flags), int, 60.0)
    computed = Map(levels, flags).n_computed()
    assert 0.1 * flags.size < computed < 0.8 * flags.size
    assert found.n_case == pytest.approx(computed, abs=max(0.12 * computed, 2.5 * found.error))
    assert found.error <= 0.08 * found.n_case


@pytest.mark.parametrize("n_speed", [1, 5])
def test_lines_that_are_alike_are_counted_exactly(n_speed):
    flags = np.tile(np.array([0] * 23 + [1] * 3 + [2] * 39), (n_speed, 1))
    levels = Levels(flags.shape, (1,), 8)
    found = count_on_lines(Map(levels, flags), int, 60.0)
    assert found == (Map(levels, flags).n_computed(), 0.0)


@pytest.mark.parametrize("sizes", [(60, 40, 5), (40, 30, 17)])
def test_three_axes(sizes):
    n, m, k = sizes
    flags = np.stack([tongues(n, m, 6, 4)] * k, axis=2)
    flags[:, 25:, k // 2 :] += 20
    levels = Levels(flags.shape, (0, 1, 2), 4)
    found = count_on_lines(Map(levels, flags), int, 60.0)
    assert found.n_case == pytest.approx(Map(levels, flags).n_computed(), rel=0.25)


def test_no_time():
    flags = tongues(60, 40, 8, 0)
    levels, count = Levels(flags.shape, (0, 1), 4), itertools.count()

    def compute(flat):
        if next(count) > 30:
            raise OutOfTime
        return flat

    assert count_on_lines(Map(levels, flags), compute, 60.0) is None
    assert count_on_lines(Map(levels, flags), int, 2.0, lambda: float(next(count))) is None


@pytest.mark.parametrize("sizes", [(7, 5), (1, 50, 40), (30, 30, 1)])
def test_the_first_lines_lie_evenly(sizes):
    places = [np.arange(n) * 2 for n in sizes]
    lines = Lines(places, 0)
    windows = [lines.line(k) for k in range(min(lines.number, 32))]
    assert len(set(map(str, windows))) == len(windows)
    for dim, n in list(enumerate(sizes))[1:]:
        at = sorted(window[dim].start // 2 for window in windows)
        assert np.mean(at) == pytest.approx(0.5 * (n - 1), abs=0.06 * n)
