"""A measure of several stators as one value a case: the worst of them."""

import numpy as np
import pytest
import synthetic_store
import xarray as xr
from printing import printed

from postproc.cases.reduction import quantiles
from postproc.cases.sensitivity import sensitivity
from postproc.figures.map import map as map_of
from postproc.store.select import narrow, select, worst_of_stators
from postproc.store.units import caption
from rubhpc.schema import VARIABLES

N_STATOR = 4
ONE_PLANE = {"friction": 0.1, "stator_youngs_modulus": 3e9}


@pytest.fixture(scope="module")
def ring():
    """A store in which stator 1 never touches and stator 3 carries the most."""
    store = synthetic_store.make(keep=(), n_stator=N_STATOR)
    share = xr.DataArray([0.0, 0.5, 1.0, 0.25], dims="stator")
    slip = xr.DataArray([np.nan, 2.0, -1.0, 3.0], dims="stator")
    force = (store["peak_contact_force"] * share).assign_attrs(store["peak_contact_force"].attrs)
    low = xr.zeros_like(store["minimum_slip_speed"]) + slip
    about = store["minimum_slip_speed"].attrs
    return store.assign(peak_contact_force=force, minimum_slip_speed=low.assign_attrs(about))


def test_the_worst_is_the_largest_or_as_declared_the_smallest(ring):
    found = worst_of_stators(ring, ["peak_contact_force", "minimum_slip_speed", "peak_torsion"])
    one = synthetic_store.make(keep=())["peak_contact_force"].isel(stator=0)
    assert found["peak_contact_force"].values == pytest.approx(one.values, nan_ok=True)
    assert np.nanmax(found["minimum_slip_speed"]) == np.nanmin(found["minimum_slip_speed"]) == -1.0
    assert found["peak_contact_force"].attrs["long_name"] == "peak contact force, largest of 4 stators"
    assert found["minimum_slip_speed"].attrs["of_stators"] == "smallest of 4 stators"
    assert found["peak_torsion"].identical(ring["peak_torsion"])
    assert {n for n, v in VARIABLES.items() if v.worst == "min"} == {"minimum_slip_speed"}


def test_a_single_stator_is_left_alone():
    store = synthetic_store.make(keep=())
    assert worst_of_stators(store, ["peak_contact_force"]).identical(store)


def test_a_map_is_of_the_worst_stator_or_of_the_one_selected(ring):
    plane = select(ring, ONE_PLANE)
    drawing = map_of(plane)
    assert not drawing.lines  # no stator was taken for the others
    assert drawing.show().figure.axes[1].get_ylabel() == "Peak contact force,\nlargest of 4 stators (N)"
    assert float(drawing.shown["peak_contact_force"].max()) == pytest.approx(100 * 1.7 * 84 / 70)
    third = map_of(select(plane, {"stator": 3})).shown["peak_contact_force"]
    assert third.values == pytest.approx(drawing.shown["peak_contact_force"].values, nan_ok=True)
    fourth = map_of(select(plane, {"stator": 4})).shown["peak_contact_force"]
    assert fourth.values == pytest.approx(0.25 * third.values, nan_ok=True)


def test_stators_can_be_facets(ring):
    drawing = map_of(select(ring, ONE_PLANE), facet="stator")
    assert drawing.panels == (1, N_STATOR)
    axes = drawing.show()
    assert [ax.get_title(loc="left") for ax in axes] == [f"stator = {i}" for i in range(1, N_STATOR + 1)]
    assert [text.get_text() for text in axes[0].texts] == ["0 in all cases"]
    assert not axes[2].texts


def test_a_map_of_zeros_says_so_and_has_no_scale(ring):
    ax = map_of(select(ring, {**ONE_PLANE, "stator": 1})).show()
    assert [text.get_text() for text in ax.texts] == ["Peak contact force (N):\n0 in all cases"]
    assert len(ax.figure.axes) == 1


def test_indices_and_quantiles_are_of_the_worst_stator(ring):
    done = ring.assign(status=xr.ones_like(ring["status"])).fillna(1.0)
    found = sensitivity(done, "peak_contact_force", n_draw=5)
    single = done.assign(peak_contact_force=done["peak_contact_force"].isel(stator=2, drop=True))
    alone = sensitivity(single, "peak_contact_force", n_draw=5)
    assert found["total"].values == pytest.approx(alone["total"].values)
    assert found.attrs["of_stators"] == "largest of 4 stators"
    worst = quantiles(done.chunk(), "peak_contact_force", [0.5])
    assert "stator" not in worst["peak_contact_force"].dims
    assert float(worst["cases"]) == done["status"].size
    pooled = quantiles(done.chunk(), "peak_contact_force", [0.5], [*ring["status"].dims, "stator"])
    assert float(pooled["cases"]) == N_STATOR * done["status"].size


def test_the_command_names_what_it_draws(ring, tmp_path):
    synthetic_store.write(tmp_path / "ring.zarr", ring)
    said = printed("map", tmp_path / "ring.zarr", "--figure", tmp_path / "map.svg")
    assert "stator = 1" not in said
    assert "largest of 4 stators" in (tmp_path / "map.svg").read_text()


def test_a_signal_is_that_of_the_stator_with_the_largest_force(ring):
    rest = {**ONE_PLANE, "clearance": 84e-6}
    waves = synthetic_store.make(n_stator=N_STATOR)[["stator_lateral", "section_vertical", "contact_force"]]
    several = waves * xr.DataArray([1.0, 2.0, 3.0, 4.0], dims="stator")
    cases = select(ring.assign(stator_lateral=several["stator_lateral"].assign_attrs(units="m")), rest)
    taken = narrow(select(cases, {"speed_ratio": 1.5}), ["stator_lateral"])
    third = narrow(select(cases, {"speed_ratio": 1.5, "stator": 3}), ["stator_lateral"])
    assert taken["stator_lateral"].equals(third["stator_lateral"])
    assert "stator = 3 (largest force of 4)" in caption(taken)
    assert "largest" not in caption(third)
    along = narrow(cases, ["stator_lateral"], ["speed_ratio"])  # one stator for all
    assert int(along["stator"]) == 3
    no_contact = cases.assign(peak_contact_force=0 * cases["peak_contact_force"])
    assert "stator = 1 (none of 4 in contact)" in caption(
        narrow(no_contact, ["stator_lateral"], ["speed_ratio"])
    )
