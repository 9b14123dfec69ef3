"""Motions that starts reach, told apart in synthetic sections of known motions; intervals; entropy."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from motions_store import NO_CONTACT, store_of
from scipy.stats import binomtest

from postproc.cases.attractors import attractors, basin_entropy, fractions, start_axes, wilson
from rubhpc.errors import InputError


def test_motions_are_told_apart_whatever_revolution_they_are_seen_in():
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


def test_entropy_of_known_pictures():
    over = ("initial_horizontal", "initial_vertical")
    mixed = xr.DataArray(np.indices((20, 20)).sum(axis=0) % 2 + 1, dims=over)
    share = np.array([13, 12]) / 25  # of a box of a checkerboard
    expected = -(share * np.log(share)).sum()
    assert basin_entropy(mixed, *over[::-1]) == pytest.approx((expected, expected))
    halves = xr.DataArray(np.where(np.arange(20) < 10, 1, 2) * np.ones((20, 1), int), dims=over)
    entropy, boundary = basin_entropy(halves, *over[::-1])
    assert entropy == 0.0
    assert np.isnan(boundary)


def test_ten_thousand_starts_are_sorted_in_a_second_or_two():
    """One of many starts stands for those that reach the same motion: no pairs are counted by the square."""
    kinds = np.resize(["P1", "P2", "torus", "free"], 10_000)
    found = attractors(store_of(kinds)).values
    assert [len(set(found[i::4])) for i in range(4)] == [1, 1, 1, 1]
    assert len(set(found)) == 4


def test_starts_that_do_not_differ_are_refused():
    with pytest.raises(InputError, match="basins need starts that differ"):
        start_axes(store_of([["P1", "P2"]], initial_vertical=[0.0], speed_ratio=[1.0, 1.1]))
