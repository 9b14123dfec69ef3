"""Motions that starts reach, distinguished in synthetic sections of known motions; intervals; entropy."""

import numpy as np
import pytest
import xarray as xr
from motions_store import NO_CONTACT, PERIODIC, TORUS, store_of
from scipy.stats import binom, binomtest

from postproc.cases.attractors import NO_MOTION, attractors, start_axes
from postproc.cases.basin_shares import basin_entropy, fractions, wilson
from rubhpc.errors import InputError
from rubhpc.schema import INFERRED


def test_motions_are_distinguished_whatever_revolution_they_are_seen_in():
    kinds = ["P2", "free", "P2", "P1", "torus", "other P1", "P2", "long period", "P1"]
    found = attractors(store_of(kinds)).values
    groups = {"free": [1], "P1": [3, 8], "other P1": [5], "P2": [0, 2, 6], "torus": [4, 7]}
    for members in groups.values():
        assert len(set(found[members])) == 1
    assert sorted(set(found)) == [1, 2, 3, 4, 5]


def test_numbers_do_not_depend_on_the_order_of_the_cases():
    store = store_of(["P2", "free", "P1", "torus", "other P1", "P2"])
    order = np.random.default_rng(3).permutation(6)
    xr.testing.assert_equal(
        attractors(store.isel(initial_vertical=order)), attractors(store).isel(initial_vertical=order)
    )


def test_cases_without_a_motion_have_none():
    store = store_of(["P1", "P1", "P2"], settled=[1, 0, -1])  # unknown, of an older store, counts
    store["status"][0] = 0
    assert attractors(store).values.tolist() == [0, 0, 1]


def test_a_motion_keeps_its_number_along_an_axis():
    kinds = [["free", "P2", "P2"], ["P1", "free", "P2"], ["P1", "P1", "free"]]
    store = store_of(kinds, speed_ratio=[1.0, 1.1, 1.2], initial_vertical=[0.0, 1e-5, 2e-5])
    found = attractors(store)
    free, p2 = int(found[0, 0]), int(found[0, 1])
    p1 = int(found[1, 0])
    assert found.values.tolist() == [[free, p2, p2], [p1, free, p2], [p1, p1, free]]
    assert len({free, p2, p1}) == 3
    backwards = store.isel(speed_ratio=[2, 0, 1])
    assert attractors(backwards).equals(found.isel(speed_ratio=[2, 0, 1]))
    shares = fractions(found, ["initial_vertical"], store)
    assert shares["count"].sel(attractor=free).values.tolist() == [1, 1, 1]
    assert shares["motion_period"].sel(attractor=p2).values.tolist() == [2, 2, -1]
    assert shares["motion_regime"].sel(attractor=free).values.tolist() == [NO_CONTACT] * 3


@pytest.mark.parametrize(("count", "n"), [(0, 10), (3, 10), (168, 441), (441, 441)])
def test_intervals_are_wilson_s(count, n):
    expected = binomtest(count, n).proportion_ci(method="wilson")
    low, high = wilson(xr.DataArray(count), xr.DataArray(n))
    assert (float(low), float(high)) == pytest.approx(tuple(expected), abs=1e-12)


@pytest.mark.parametrize("n", [40, 400])
def test_intervals_hold_the_share_as_often_as_they_say(n):
    """Binomial coverage, summed exactly: of Wilson's interval 95 % on average, at few shares less than 92."""
    count = np.arange(n + 1)
    low, high = (end.values for end in wilson(xr.DataArray(count), xr.DataArray(n)))
    shares = np.linspace(0.02, 0.98, 193)
    holds = (low <= shares[:, np.newaxis]) & (shares[:, np.newaxis] <= high)
    coverage = np.where(holds, binom.pmf(count, n, shares[:, np.newaxis]), 0.0).sum(axis=1)
    assert coverage.mean() == pytest.approx(0.95, abs=0.005)
    assert np.quantile(coverage, 0.05) > 0.92


def test_solutions_distinguish_motions_where_they_are_known():
    """Equal sections with other multipliers are two motions; unlike ones with equal ones too: mirrored."""
    kinds = ["P2", "P2", "P2", "other P1", "P1", "P2", "P1"]
    store = store_of(kinds)
    size = np.array([0.5, 0.5 + 1e-9, 0.6, 0.5, 0.5, np.nan, 0.5])
    store["largest_multiplier"] = "initial_vertical", size
    store["multiplier_angle"] = "initial_vertical", np.full(7, 0.3)
    found = attractors(store).values
    assert found[0] == found[1] != found[2]  # the second is seen a revolution later
    assert found[5] in (found[0], found[2])  # not solved for: by its section
    assert found[4] == found[6] != found[3]
    assert len(set(found)) == 4


def test_records_that_agree_with_a_solution_less_well_are_of_it():
    store = store_of(["P1"] * 3)
    for name in ("section_vertical", "section_torsion"):
        store[name] = store[name] * xr.DataArray([1.0, 1.015, 0.985], dims="initial_vertical")
    assert len(set(attractors(store).values)) == 3
    store["largest_multiplier"] = "initial_vertical", np.array([0.5, 0.5, 0.5])
    store["multiplier_angle"] = "initial_vertical", np.zeros(3)
    assert len(set(attractors(store).values)) == 1


def test_a_torus_that_passes_slowly_by_a_long_period_is_one_motion():
    """Its records repeat to 0.3 % after seven revolutions, wherever on the torus they are seen."""
    kinds = ["torus"] * 6 + ["P1", "free", "P1"]
    store = store_of(kinds)
    phase = np.array([0.1, 1.6, 2.2, 3.3, 4.9, 6.1])
    angle = phase[:, np.newaxis] + (2 * np.pi + 0.003) * 3 / 7 * np.arange(12)
    store["section_vertical"][:6] = 1e-4 * np.cos(angle)
    store["section_horizontal"][:6] = 0.7e-4 * np.sin(angle)
    store["period"][:5] = 7  # of five records, by chance
    store["regime"][:5] = PERIODIC
    found = attractors(store).values
    assert len(set(found[:6])) == 1
    assert len(set(found)) == 3
    what = fractions(attractors(store), ["initial_vertical"], store).sel(attractor=found[0])
    assert (int(what["motion_regime"]), int(what["motion_period"])) == (TORUS, 0)
    store["largest_multiplier"] = "initial_vertical", np.where(np.arange(9) == 2, 0.9, np.nan)
    store["multiplier_angle"] = "initial_vertical", np.zeros(9)
    with_solution = attractors(store).values  # a motion of that period beside the torus
    assert len(set(with_solution[[0, 1, 3, 4, 5]])) == 1
    assert len(set(with_solution)) == 4


def test_long_periods_that_close_are_distinguished_by_their_points():
    """Two motions of period 6, of one mean and spread, without a solution, one of them seen later."""
    turn = np.arange(12) % 6 * np.pi / 3
    store = store_of(["P1"] * 3)
    store["period"][:] = 6
    for i, angle in enumerate((turn, np.roll(turn, 2), turn + 0.2)):
        store["section_vertical"][i] = 1e-4 * np.cos(angle)
        store["section_horizontal"][i] = 1e-4 * np.sin(angle)
    found = attractors(store).values
    assert found[0] == found[1] != found[2]


def test_inferred_starts_take_the_motion_of_their_surroundings():
    kinds = np.where(np.indices((6, 8))[1] < 4, "free", "P1")
    kinds[5, 7] = "P2"
    axes = {"initial_vertical": np.arange(6.0), "initial_horizontal": np.arange(8.0)}
    whole = store_of(kinds, **axes)
    expected = attractors(whole)
    refined = whole.copy(deep=True)
    inner = np.zeros((6, 8), bool)
    inner[1:5, [1, 2, 5, 6]] = True
    refined["status"].values[inner] = INFERRED
    for name in ("section_vertical", "section_horizontal", "section_torsion"):
        refined[name].values[inner] = np.nan
    assert attractors(refined).equals(expected)
    shares = fractions(attractors(refined), list(axes), refined)
    assert int(shares["n_without_motion"]) == 0


def test_torsion_that_dies_out_distinguishes_nothing():
    store = store_of(["free"] * 4)
    store["section_torsion"] = store["section_torsion"] + xr.DataArray(
        [1e-9, 3e-9, 0.0, 7e-9], dims="initial_vertical"
    )
    assert set(attractors(store).values) == {1}


def test_entropy_of_known_pictures():
    over = ("initial_horizontal", "initial_vertical")
    mixed = xr.DataArray(np.indices((20, 20)).sum(axis=0) % 2 + 1, dims=over)
    share = np.array([13, 12]) / 25  # of a box of a checkerboard
    expected = -(share * np.log(share)).sum()
    assert basin_entropy(mixed, *over[::-1]) == pytest.approx((expected, expected))
    ends = np.array([1, 2, 3, 4]) / 5  # shares in the columns of boxes that a straight boundary divides
    divided = -(ends * np.log(ends) + (1 - ends) * np.log(1 - ends))
    for n, at in ((20, 10), (41, 30), (41, 13)):
        halves = xr.DataArray(np.where(np.arange(n) < at, 1, 2) * np.ones((n, 1), int), dims=over)
        found = basin_entropy(halves, *over[::-1])
        assert found == pytest.approx((divided.sum() / (n - 4), divided.mean()))


def test_entropy_of_one_motion_of_few_starts_and_of_starts_that_have_not_settled():
    over = ("initial_horizontal", "initial_vertical")
    one = xr.DataArray(np.ones((6, 7), int), dims=over)
    entropy, boundary = basin_entropy(one, *over)
    assert entropy == 0.0
    assert np.isnan(boundary)
    for without in (one * NO_MOTION, one[:4]):
        assert np.isnan(basin_entropy(without, *over)).all()
    checkered = xr.DataArray(np.indices((20, 20)).sum(axis=0) % 2 + 1, dims=over)
    settled = checkered.where(np.arange(20)[:, np.newaxis] != 7, NO_MOTION)
    assert np.isclose(basin_entropy(settled, *over), np.log(2.0), rtol=2e-3).all()


def test_entropy_is_of_neighbours_in_any_order_of_the_starts():
    values = np.random.default_rng(1).permutation(20) * 1e-4
    over = {"initial_horizontal": values, "initial_vertical": np.arange(20.0)}
    halves = xr.DataArray(np.where(values < 1e-3, 1, 2)[:, np.newaxis] * np.ones((1, 20), int), over)
    assert basin_entropy(halves, *over) == basin_entropy(halves.sortby("initial_horizontal"), *over)


def test_ten_thousand_starts_are_sorted_in_a_second_or_two():
    """One of many starts stands for those that reach the same motion: no pairs are counted by the square."""
    kinds = np.resize(["P1", "P2", "torus", "free"], 10_000)
    found = attractors(store_of(kinds)).values
    assert [len(set(found[i::4])) for i in range(4)] == [1, 1, 1, 1]
    assert len(set(found)) == 4


def test_starts_that_do_not_differ_are_refused():
    with pytest.raises(InputError, match="basins need starts that differ"):
        start_axes(store_of([["P1", "P2"]], initial_vertical=[0.0], speed_ratio=[1.0, 1.1]))
