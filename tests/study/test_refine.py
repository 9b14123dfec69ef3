"""Refined maps: which cases are computed, what is inferred, and what [refine] refuses."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rubhpc.errors import InputError
from rubhpc.study.edges import Results
from rubhpc.study.levels import Levels
from rubhpc.study.study import read_study

BASE = """
rig = "mokhtar2017"
output = "x.zarr"
[grid]
speed_ratio = {speed}
clearance_ratio = {{ start = 0.5, stop = 0.9, num = 5 }}
friction = [0.1, 0.3]
{rest}
"""
SPEEDS = "{ start = 1.0, stop = 2.0, num = 9 }"


def results(known, truth, values=None, tolerance=0.1):
    measured = [] if values is None else [(np.where(known, values, np.nan), tolerance)]
    nothing = np.zeros(known.shape, bool)
    return Results(is_known=known, is_failed=nothing, classes=[np.where(known, truth, -1)], values=measured)


def refined(truth, levels, values=None, tolerance=0.1, known=None):
    """Run all levels on a known map: the cases that are computed, and how many levels it took."""
    known = np.zeros(levels.shape, bool) if known is None else known.copy()
    n_round = 0
    while True:
        n_round += 1
        asked = levels.asked(results(known, truth, values, tolerance))
        if asked.is_all:
            return asked.cases, n_round - 1
        known |= asked.cases


def by_hand(truth, axes, coarse):
    """The same by the words of the guide, line by line and case by case."""
    places = {
        a: sorted({*range(0, n, coarse), n - 1} if a in axes else range(n)) for a, n in enumerate(truth.shape)
    }
    asked = set(itertools.product(*places.values()))
    value = {p: truth[p] for p in asked}

    def moved(p, axis, place):
        return (*p[:axis], place, *p[axis + 1 :])

    for axis in axes:
        step = coarse
        while step > 1:
            step //= 2
            ends = places[axis]
            if len(ends) == 1:
                break
            pairs = list(itertools.pairwise(ends))
            fine = sorted({*range(0, truth.shape[axis], step), truth.shape[axis] - 1})
            lines = {moved(p, axis, 0) for p in itertools.product(*places.values())}
            new = {}
            for line in lines:
                differ = [value[moved(line, axis, a)] != value[moved(line, axis, b)] for a, b in pairs]
                for i, (a, b) in enumerate(pairs):
                    is_open = any(differ[max(i - 1, 0) : i + 2])
                    for place in (p for p in fine if a <= p <= b):
                        at = moved(line, axis, place)
                        if is_open:
                            asked.add(at)
                        if at not in value:
                            new[at] = value[moved(line, axis, a if place - a <= b - place else b)]
            value |= new
            value |= {p: truth[p] for p in asked}
            places[axis] = fine
    while True:
        beside = set()
        for p in value:
            for axis in axes:
                after = moved(p, axis, p[axis] + 1)
                if after in value and value[after] != value[p]:
                    beside |= {p, after}
        if beside <= asked:
            break
        asked |= beside
        value |= {p: truth[p] for p in asked}
    mask = np.zeros(truth.shape, bool)
    for p in asked:
        mask[p] = True
    return mask


def disc(shape, centre, radius):
    """1 within a circle, 0 around it."""
    x, y = np.ogrid[: shape[0], : shape[1]]
    return (((x - centre[0]) ** 2 + (y - centre[1]) ** 2) < radius**2).astype(int)


@pytest.mark.parametrize(
    ("truth", "axes", "coarse"),
    [
        (disc((18, 13), (7, 6), 4.2), (0, 1), 4),
        (disc((11, 22), (2, 17), 5.0), (0, 1), 8),
        (np.repeat(disc((14, 9), (9, 3), 3.3)[:, None, :], 2, axis=1), (0, 2), 4),
        (disc((20, 6), (10, 2), 6.0), (0,), 8),
        (disc((13, 16), (7, 6), 4.2) + 2 * disc((13, 16), (3, 12), 2.4), (1, 0), 4),
        (disc((9, 1), (4, 0), 2.0), (0, 1), 4),
    ],
)
def test_levels_compute_what_the_rule_says(truth, axes, coarse):
    levels = Levels(truth.shape, axes, coarse)
    cases, _ = refined(truth, levels)
    assert (cases == by_hand(truth, axes, coarse)).all()


def test_a_map_with_edges_wider_than_the_first_step_is_inferred_without_error():
    truth = disc((100, 80), (40, 30), 18.0) + 2 * (np.arange(100)[:, None] > 75)
    levels = Levels(truth.shape, (0, 1), 8)
    cases, _ = refined(truth, levels)
    assert cases.mean() < 0.3
    assert (levels.filled(np.where(cases, truth, -1), cases) == truth).all()


def test_an_island_between_the_first_nodes_is_missed_and_no_other_case():
    truth = disc((65, 65), (20, 20), 2.5)  # between values of the first level, 16 and 24
    cases, _ = refined(truth, Levels(truth.shape, (0, 1), 8))
    assert not (truth[cases]).any()
    assert cases.sum() == 9 * 9
    island = disc((65, 65), (20, 20), 8.6)  # larger: met, and complete
    levels = Levels(truth.shape, (0, 1), 8)
    cases, _ = refined(island, levels)
    assert (levels.filled(np.where(cases, island, -1), cases) == island).all()


def test_what_else_is_known_changes_no_decision():
    truth = disc((33, 33), (12, 20), 7.0)
    levels = Levels(truth.shape, (0, 1), 8)
    alone, _ = refined(truth, levels)
    others = np.random.default_rng(1).random(truth.shape) < 0.3
    among, _ = refined(truth, levels, known=others)
    assert (alone == among).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_order_of_results_changes_nothing(seed):
    """Results come a few at a time: what is certain stays, and is in the end what the rule says."""
    rng = np.random.default_rng(seed)
    truth = disc((23, 14), rng.uniform(0, 14, 2), 5.0) + 2 * disc((23, 14), rng.uniform(0, 14, 2), 3.0)
    truth[rng.integers(23), rng.integers(14)] = 3
    axes = (seed % 2, 1 - seed % 2)
    levels = Levels(truth.shape, axes, 4)
    known, before, n_round = np.zeros(truth.shape, bool), np.zeros(truth.shape, bool), 0
    edges, fresh = None, np.zeros(0, np.int64)
    while True:
        asked = levels.asked(results(known, truth))
        assert not (before & ~asked.cases).any()
        if edges is not None:
            edges.follow(results(known, truth), fresh)
            assert (edges.asked == asked.cases).all()
        edges = asked.edges
        if asked.is_all:
            break
        before, n_round = asked.cases.copy(), n_round + 1
        waiting = np.flatnonzero(asked.cases & ~known)
        fresh = rng.choice(waiting, min(len(waiting), int(rng.integers(1, 9))), replace=False)
        known.flat[fresh] = True
    assert edges is not None
    assert (asked.cases == by_hand(truth, axes, 4)).all()


def test_what_does_not_depend_on_a_missing_case_is_asked_for():
    """One case of the first level is missing: the map is decided but for the three steps around it."""
    truth = disc((65, 65), (20, 20), 8.6)
    levels = Levels(truth.shape, (0, 1), 8)
    whole, n_level = refined(truth, levels)
    known, n_round = np.zeros(truth.shape, bool), 0
    while n_round < n_level:
        asked = levels.asked(results(known, truth))
        known, n_round = asked.cases.copy(), n_round + 1
        known[56, 56] = False
    assert not asked.is_all
    assert asked.edges is None
    assert (asked.cases == whole).all()


def test_a_measure_is_refined_where_it_changes_by_more_than_its_share():
    x = np.linspace(0.0, 1.0, 513)
    force = 300.0 + 100.0 * np.tanh((x - 0.7) / 0.02)[:, None] + np.zeros((513, 2))
    levels = Levels(force.shape, (0,), 16)
    cases, _ = refined(np.zeros(force.shape, int), levels, force, tolerance=0.05)
    filled = levels.filled(np.where(cases, force, np.nan), cases)
    assert cases.mean() < 0.3
    assert np.abs(filled - force).max() < 0.05 * force.max()


def test_interpolation_is_exact_for_a_linear_measure_and_passes_over_nan():
    x, y = np.meshgrid(np.linspace(0, 1, 21), np.linspace(2, 3, 14), indexing="ij")
    levels = Levels(x.shape, (0, 1), 4)
    computed = np.zeros(x.shape, bool)
    computed[np.ix_([0, 4, 8, 12, 16, 20], [0, 4, 8, 12, 13])] = True
    plane = 3.0 * x - 2.0 * y
    assert levels.filled(np.where(computed, plane, np.nan), computed) == pytest.approx(plane, abs=1e-12)
    per_stator = levels.filled(np.stack([plane, -plane], axis=-1), computed)
    assert per_stator[..., 1] == pytest.approx(-plane, abs=1e-12)
    plane[0, 0] = np.nan
    assert np.isfinite(levels.filled(plane, computed)[1:, 1:]).all()


def test_the_estimate_is_that_of_edges_and_ends_at_the_truth():
    truth = disc((129, 129), (60, 60), 30.0)
    levels = Levels(truth.shape, (0, 1), 16)
    known, estimates = np.zeros(truth.shape, bool), []
    while True:
        asked = levels.asked(results(known, truth))
        estimates.append(asked.n_expected)
        if asked.is_all:
            break
        known |= asked.cases
    assert estimates[-1] == asked.cases.sum()
    assert estimates[5] == pytest.approx(estimates[-1], rel=0.3)


@pytest.mark.parametrize(
    ("speed", "rest", "message"),
    [
        (SPEEDS, "[refine]\ncoarse = 6", "coarse: 6 is not a power of two; write 4 or 8"),
        (SPEEDS, '[refine]\nby = "regme"', "regme.*did you mean regime"),
        (SPEEDS, "[refine]\nby = []", "by: empty"),
        (SPEEDS, '[refine]\nby = ["peak_contact_force"]', "write { peak_contact_force = 0.1 }"),
        (SPEEDS, "[refine]\nby = { regime = 0.1 }", 'is a flag, which has no difference; write "regime"'),
        (SPEEDS, '[refine]\naxes = ["friction"]', "friction is a list"),
        (SPEEDS, '[refine]\naxes = ["speed"]', "speed is not an axis of"),
        ('{ start = 1.0, stop = 2.0, num = 9, sweep = "up" }', "[refine]", "remove sweep or .refine."),
        ("{ start = 1.0, stop = 2.0 }", "[refine]\n[sample]\nn = 8\nmethod = 'random'", "remove .refine. or"),
        (SPEEDS, "[refine]\ncorse = 8", "did you mean coarse"),
    ],
)
def test_what_cannot_be_refined_is_refused_in_one_line(tmp_path, speed, rest, message):
    path = tmp_path / "a.toml"
    text = BASE.format(speed=speed, rest=rest)
    if "sample" in rest:
        text = text.replace("num = 5", 'scale = "lin"')
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_study(path)
    assert "\n" not in str(caught.value)


def test_criteria_and_axes_are_read(tmp_path):
    path = tmp_path / "a.toml"
    rest = '[refine]\nby = ["regime", { peak_contact_force = 0.1 }]\naxes = ["speed_ratio"]\ncoarse = 4'
    path.write_text(BASE.format(speed=SPEEDS, rest=rest))
    study = read_study(path)
    assert study.refine is not None
    assert study.refine.by == (("regime", 0.0), ("peak_contact_force", 0.1))
    assert study.refine.refined(study.axes) == ["speed_ratio"]
    path.write_text(BASE.format(speed=SPEEDS, rest="[refine]"))
    study = read_study(path)
    assert study.refine.refined(study.axes) == ["speed_ratio", "clearance_ratio"]
