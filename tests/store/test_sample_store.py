"""The store of a sampled study, drawn and selected: points over what was drawn, cases by range and number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.figure import Figure
from running import write_sample

from postproc.cases.maps import scatter_axes
from postproc.figures.bifurcation import bifurcation
from postproc.figures.cascade import cascade
from postproc.figures.map import map as map_of
from postproc.figures.palette import REGIME_COLORS
from postproc.store.axes import drawn_axes
from postproc.store.open import open_store
from postproc.store.rig_of_case import natural_frequencies, rig_of
from postproc.store.select import select
from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.modes import modes
from rubhpc.running.driver import run
from rubhpc.schema import DIVERGED, DONE, REGIME
from rubhpc.study.study import read_study

if TYPE_CHECKING:
    import xarray as xr


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """32 points of speed, stator and disc, at two clearances."""
    folder = tmp_path_factory.mktemp("sample")
    grid = (
        '0.3\n"stator.youngs_modulus" = { start = "1 GPa", stop = "30 GPa", scale = "log" }\n'
        '"rotor.disc.thickness" = { start = "25 mm", stop = "35 mm" }'
    )
    run(read_study(write_sample(folder, friction=grid, samples_per_revolution=64)), quiet=True)
    return open_store(folder / "tiny.zarr")


def drawn_on(cases: xr.Dataset, value: str, **words: object) -> list:
    drawing = map_of(cases, value, **words)
    figure = Figure()
    axes = list(figure.subplots(*(drawing.panels or (1, 1)), squeeze=False).ravel())
    drawing.draw(axes)
    figure.draw_without_rendering()
    return axes


def test_points_stand_where_they_were_drawn_and_have_the_colour_of_their_value(cases):
    (ax,) = drawn_on(cases.isel(clearance_ratio=0), "peak_torsion", y="stator.youngs_modulus")
    points = ax.collections[0]
    expected = np.column_stack((cases["speed_ratio"], cases["stator_youngs_modulus"] / 1e9))
    np.testing.assert_allclose(np.asarray(points.get_offsets()), expected)
    in_mrad = 1e3 * cases["peak_torsion"].isel(clearance_ratio=0).squeeze()
    np.testing.assert_allclose(points.get_array(), in_mrad)
    assert (ax.get_xscale(), ax.get_yscale()) == ("linear", "log")
    assert ax.get_ylabel() == "Stator modulus $E_s$ (GPa)"


def test_cases_without_a_result_are_crosses(cases):
    spoilt = cases.isel(clearance_ratio=0).load()
    spoilt["status"][3] = DIVERGED
    spoilt["regime"][:] = REGIME.index("periodic")
    (ax,) = drawn_on(spoilt, "regime")
    assert len(ax.collections[0].get_offsets()) == 39
    np.testing.assert_allclose(ax.collections[0].get_facecolors()[0, :3], _rgb(REGIME_COLORS[1]))
    cross = next(c for c in ax.collections if c.get_label() == "diverged")
    assert cross.get_offsets()[0, 0] == spoilt["speed_ratio"][3]


def test_each_value_of_a_list_has_its_panel(cases):
    first, second = drawn_on(cases, "peak_torsion", facet="clearance_ratio")
    done = (cases["status"] == DONE).values.reshape(-1, 2)
    assert [len(ax.collections[0].get_offsets()) for ax in (first, second)] == done.sum(axis=0).tolist()
    assert first.get_title() != second.get_title()
    assert map_of(cases, "peak_torsion").lines[0].startswith("clearance_ratio = 0.7: the first of 2")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            {"x": "friction"},
            "friction: is an axis: name it with --facet; the sample has speed_ratio, stator_",
        ),
        ({"x": "speed"}, "speed: was not drawn; the sample has speed_ratio"),
        ({"x": "speed_ratio", "y": "speed_ratio"}, "speed_ratio is on both axes"),
        ({"contours": 3}, "points of a sample have no contours"),
    ],
)
def test_maps_that_a_sample_does_not_have_are_refused(cases, words, says):
    with pytest.raises(InputError) as refused:
        map_of(cases, "peak_torsion", **words)
    assert says in str(refused.value)


def test_axes_of_a_scatter_begin_with_the_speed(cases):
    others = ["stator_youngs_modulus", "rotor_disc_thickness"]
    assert drawn_axes(cases) == ["speed_ratio", *others]
    assert scatter_axes(cases) == ("speed_ratio", others[0])
    assert scatter_axes(cases, y="speed_ratio") == (others[0], "speed_ratio")
    assert scatter_axes(cases, x="rotor.disc.thickness") == (others[1], "speed_ratio")


def test_cases_are_selected_by_number_and_by_what_was_drawn(cases):
    stiff = select(cases, {"stator.youngs_modulus": "10 GPa..30 GPa", "speed_ratio": "1.5..2"})
    modulus, speed = cases["stator_youngs_modulus"].values, cases["speed_ratio"].values
    expected = np.flatnonzero((modulus >= 1e10) & (speed >= 1.5) & (speed <= 2.0))
    assert 0 < expected.size < 20
    assert stiff["case"].values.tolist() == expected.tolist()
    one = select(cases, {"case": 7})
    assert float(one["stator_youngs_modulus"]) == modulus[7]
    assert rig_of(one).stator[0].youngs_modulus == modulus[7]
    with pytest.raises(
        InputError, match=r"was drawn at random; select a range of it, such as 1\.\d+\.\.2\.\d+, or"
    ):
        select(cases, {"speed_ratio": 1.7})
    with pytest.raises(InputError, match="no value in that range"):
        select(cases, {"speed_ratio": "3..4"})


def test_nothing_runs_along_what_was_drawn(cases):
    one = cases.isel(clearance_ratio=0)
    for figure in (cascade, bifurcation):
        with pytest.raises(InputError, match="the cases of a sample have no order, rubhpc map draws them"):
            figure(one)
        with pytest.raises(InputError, match="speed_ratio: was drawn at random and is not an axis"):
            figure(one, along="speed_ratio")
    assert bifurcation(cases.isel(case=3)).shown.sizes["clearance_ratio"] == 2


def test_each_case_has_the_natural_frequencies_of_its_own_rig(cases):
    found = natural_frequencies(cases, "case")["torsional"]
    assert found.dims == ("case",)
    assert found.size == 40
    for i in (0, 7, 39):
        kinds = modes(assemble(rig_of(cases.isel(case=i))).rotor)
        assert float(found[i]) == min(m.frequency for m in kinds if m.kind == "torsional" and m.frequency > 0)
    assert len(np.unique(found)) > 8


def _rgb(colour: str) -> list[float]:
    return [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
