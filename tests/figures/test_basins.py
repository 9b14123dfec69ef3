"""Figures of basins: cells, shares along an axis, points of a sample; what the command prints and refuses."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PolyCollection
from motions_store import store_of

from postproc.catalogue import figures
from postproc.figures.palette import MOTION_COLORS, REGIME_COLORS
from rubhpc.errors import InputError
from rubhpc.study.sampling import CASE

FIGURE = figures()["basins"]


@pytest.fixture
def plane():
    kinds = np.where(np.indices((6, 7)).sum(axis=0) < 6, "free", "P1")
    store = store_of(
        kinds, initial_vertical=np.linspace(-1, 1, 6) * 1e-4, initial_horizontal=np.linspace(-1, 1, 7) * 1e-4
    )
    store["peak_contact_force"] = store.regime * 120.0
    store["peak_contact_force"].attrs = {"units": "N", "long_name": "peak contact force"}
    return store


def test_cells_have_the_colour_of_their_motion(plane, tmp_path):
    drawing = FIGURE.of(plane)
    ax, beside = drawing.show()
    points = [line for line in beside.lines if line.get_marker() == "o"]
    assert [line.get_color() for line in points] == [REGIME_COLORS[0], MOTION_COLORS[0]]
    assert drawing.shown["example_initial_vertical"].sel(attractor=2) == pytest.approx(-1e-4)
    cells = ax.collections[0].get_array()
    reached = drawing.shown["attractor_reached"].transpose("initial_vertical", "initial_horizontal").values
    assert (np.asarray(cells).reshape(6, 7) + 1 == reached).all()
    assert ax.get_xlabel().startswith("Initial horizontal displacement")
    labels = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert labels[0].startswith("1: no contact, 50 % (35.5 to 64.5)")
    assert any("21 of 42 starts; peak contact force 120 N" in line for line in drawing.lines)
    assert drawing.save(tmp_path / "basins.png").stat().st_size > 5000


def test_no_entropy_is_printed_of_boundaries_that_are_not_there(plane):
    (said,) = [line for line in FIGURE.of(plane).lines if "basin entropy" in line]
    assert "(fractal above 0.693)" in said
    alone = store_of(
        np.full((6, 7), "free"), initial_vertical=np.arange(6) * 1e-4, initial_horizontal=np.arange(7) * 1e-4
    )
    assert "basin entropy 0, on the boundaries none: there is one motion" in FIGURE.of(alone).lines
    few = plane.isel(initial_vertical=slice(2), initial_horizontal=slice(2))
    assert not any("nan" in line for line in FIGURE.of(few).lines)
    unsettled = FIGURE.of(plane.assign(settled=0 * plane.settled))
    assert unsettled.lines == ("without a motion: 42 starts, not done or not settled",)


def test_a_boundary_is_seen_wherever_it_runs():
    """Two motions that hold 73.2 and 26.8 % of 41 by 41 starts, beside a boundary at every fifth start."""
    kinds = np.array([["free"] * 30 + ["P1"] * 11] * 41)
    starts = np.linspace(-1e-4, 1e-4, 41)
    lines = FIGURE.of(store_of(kinds, initial_vertical=starts, initial_horizontal=starts)).lines
    assert "basin entropy 0.0634, on the boundaries 0.587 (fractal above 0.693)" in lines
    assert any("no contact, 73.2 %" in line for line in lines)
    apart = np.array([["free"] * 3 + ["P1"] * 8] * 6)
    settled = [[1] * 3 + [0] * 5 + [1] * 3] * 6
    two = store_of(apart, settled, initial_vertical=starts[:6], initial_horizontal=starts[:11])
    assert "basin entropy 0, on the boundaries none: no box has two motions" in FIGURE.of(two).lines


def test_shares_are_stacked_along_an_axis(plane):
    stores = [plane.assign(regime=plane.regime), plane]
    both = xr.concat(stores, xr.DataArray([1.0, 1.2], dims="speed_ratio", name="speed_ratio"), join="exact")
    both = both.transpose("speed_ratio", ...)
    drawing = FIGURE.of(both, along="speed_ratio")
    assert drawing.shown["fraction"].sum("attractor").values == pytest.approx([1.0, 1.0])
    ax, below = drawing.show()
    assert below.get_xlabel() == "Speed ratio $r$"
    assert {line.get_color() for line in below.lines} == {REGIME_COLORS[0], MOTION_COLORS[0]}
    areas = [area for area in ax.collections if isinstance(area, PolyCollection)]
    tops = [area.get_paths()[0].vertices[:, 1].max() for area in areas]
    assert tops[-1] == pytest.approx(1.0)
    with pytest.raises(InputError, match="is a start"):
        FIGURE.of(both, along="initial.vertical")


def test_points_of_a_sample(plane):
    stacked = plane.stack({CASE: ("initial_vertical", "initial_horizontal")}).reset_index(CASE)
    stacked = stacked.assign_coords({CASE: np.arange(stacked.sizes[CASE])}).transpose(CASE, ...)
    stacked.attrs["study"] = {"grid": {"initial.vertical": {}, "initial.horizontal": {}}}
    ax, _ = FIGURE.of(stacked).show()
    assert sum(len(points.get_offsets()) for points in ax.collections) == 42


def test_a_start_and_a_parameter_make_a_plane(plane):
    line = plane.isel(initial_horizontal=0, drop=True)
    both = xr.concat([line] * 3, xr.DataArray([1.0, 1.1, 1.2], dims="speed_ratio", name="speed_ratio"))
    ax = FIGURE.of(both.transpose("speed_ratio", ...)).show()
    assert ax.get_xlabel() == "Speed ratio $r$"
    assert ax.get_ylabel().startswith("Initial vertical displacement")


def test_one_axis_is_no_picture(plane):
    with pytest.raises(InputError, match="a picture needs two axes"):
        FIGURE.of(plane.isel(initial_horizontal=0, drop=True))
    with pytest.raises(InputError, match="no axis speed"):
        FIGURE.of(plane, x="speed")
