"""Small multiples of a map of a synthetic store, and its contours."""

import itertools

import numpy as np
import pytest
import synthetic_store
import xarray as xr
from printing import printed

from postproc.cases.maps import default_axes, facet_axes, map_data
from postproc.figures.drawing import house_style, new_figure
from postproc.figures.map import draw_maps
from postproc.figures.map import map as draw_map
from postproc.figures.small_multiples import name_facets
from postproc.store.open import open_store
from rubhpc.errors import InputError
from rubhpc.schema import FAILED

FACETS = ["stator_youngs_modulus", "friction"]  # down, across


@pytest.fixture
def axes():
    with house_style():
        yield new_figure(2, 120, 180, 2)[1]


def data(synthetic_path, value):
    return map_data(open_store(synthetic_path), value, ["speed_ratio", "clearance"], FACETS)


def test_each_panel_shows_its_own_cases_in_one_scale(synthetic_path, axes):
    shown = data(synthetic_path, "peak_contact_force")
    assert shown["peak_contact_force"].dims == (*FACETS, "clearance", "speed_ratio")
    shown["peak_contact_force"][1, 1] *= 2.0
    draw_maps(shown, "peak_contact_force", axes)
    meshes = [ax.collections[0] for ax in axes]
    for i, mesh in enumerate(meshes):
        there = shown["peak_contact_force"].values[divmod(i, 2)]
        assert np.ma.filled(mesh.get_array(), np.nan).reshape(there.shape) == pytest.approx(
            there, nan_ok=True
        )
        assert mesh.get_clim() == meshes[0].get_clim()
    assert [ax.get_title(loc="left") for ax in axes] == [
        "$E_s$ = 3 GPa, $\\mu$ = 0.1",
        "$E_s$ = 3 GPa, $\\mu$ = 0.3",
        "$E_s$ = 30 GPa, $\\mu$ = 0.1",
        "$E_s$ = 30 GPa, $\\mu$ = 0.3",
    ]
    assert [bool(ax.get_xlabel()) for ax in axes] == [False, False, True, True]
    assert [bool(ax.get_ylabel()) for ax in axes] == [True, False, True, False]


def test_panels_share_one_legend_and_the_names_of_regimes(synthetic_path, axes):
    draw_maps(data(synthetic_path, "regime"), "regime", axes)
    figure = axes[0].figure
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [
        "missing",
        "failed",
        "diverged",
        "out of range in 24 of 57 cases: slip (24), Euler load (12)",
    ]
    names = [text.get_text() for text in figure.axes[-1].get_yticklabels()]
    assert names == ["no contact", "periodic", "quasi-periodic", "chaotic"]


def test_contours_lie_at_their_level(synthetic_path, axes):
    """The force is 100 N r / (g / 84 um): a line of equal force is straight through the origin."""
    shown = data(synthetic_path, "peak_contact_force")
    draw_maps(shown, "peak_contact_force", axes, n_contour=4)
    lines = axes[3].collections[-1]
    assert len(lines.levels) >= 3
    for level, path_ in zip(lines.levels, lines.get_paths(), strict=True):
        r, g = path_.vertices.T
        assert 100 * r / (g / 84) == pytest.approx(level, rel=0.03)  # linear between grid values


def test_regimes_have_no_contours(synthetic_path, axes):
    with pytest.raises(InputError, match="without --contours"):
        draw_maps(data(synthetic_path, "regime"), "regime", axes, n_contour=3)


def test_facets_are_other_axes_of_few_values(synthetic_path):
    store = open_store(synthetic_path)
    assert facet_axes(store, ["friction", "stator.youngs_modulus"], ["speed_ratio", "clearance"]) == FACETS
    with pytest.raises(InputError, match="other than speed_ratio or clearance"):
        facet_axes(store, ["clearance"], ["speed_ratio", "clearance"])
    with pytest.raises(InputError, match="one or two axes"):
        facet_axes(store, ["friction", "friction"], ["speed_ratio", "clearance"])
    many = store.isel(friction=[0] * 7)
    with pytest.raises(InputError, match="7 values are more than 6; keep some with --select friction"):
        facet_axes(many, ["friction"], ["speed_ratio", "clearance"])


def test_command_draws_a_panel_for_each_value(synthetic_path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    args = [str(synthetic_path), "--facet", "friction", "--contours", "3", "--log", "--data", "map.csv"]
    said = printed("map", *args).splitlines()
    assert said[0].startswith("stator_youngs_modulus = 3 GPa: the first of 2")
    assert said[-2:] == ["study_map.png", "map.csv"]
    table = np.genfromtxt("map.csv", delimiter=",", names=True, deletechars="")
    assert len(table) == 2 * 3 * 5


@pytest.mark.parametrize("value", ["regime", "period", "status"])
def test_flags_have_no_logarithmic_scale(synthetic_path, value):
    store = open_store(synthetic_path).isel(friction=0, stator_youngs_modulus=0)
    with pytest.raises(InputError, match=f"map: {value} has no scale; draw it without --log"):
        draw_map(store, value, log=True).show()


def test_maps_spread_over_what_the_facets_leave(synthetic_path):
    store = open_store(synthetic_path).isel(clearance=[0, 1], speed_ratio=[1, 2, 3])
    assert default_axes(store, facets=["speed_ratio"]) == ("clearance", "friction")
    with pytest.raises(InputError, match="over one axis, draw rubhpc bifurcation"):
        default_axes(store.isel(clearance=0, friction=0, stator_youngs_modulus=0))


def test_regimes_that_no_case_has_need_no_bar(synthetic_path, axes):
    shown = data(synthetic_path, "regime")
    shown["status"][...] = FAILED
    draw_maps(shown, "regime", axes)
    assert axes[0].figure.axes == axes


def test_a_map_reads_speeds_in_rpm_as_its_axes_do(synthetic_path, axes):
    draw_maps(data(synthetic_path, "spin_speed"), "spin_speed", axes)
    assert axes[0].figure.axes[-1].get_ylabel() == "Spin speed (rpm)"
    assert axes[0].collections[0].get_clim()[1] == pytest.approx(1.7 * synthetic_store.FIRST_LATERAL * 60)


def test_names_of_facets_stay_within_their_panels():
    name = "rotor_unbalance_radius"
    reported = {"long_name": name.replace("_", " "), "units": "m"}
    radius = xr.DataArray(0.1 + 0.05 * np.arange(5.0), dims=name, attrs=reported)
    data = xr.Dataset(coords={"friction": [0.0, 0.1], name: radius})
    with house_style():
        figure, axes = new_figure(2, 120, 180, 5)
        name_facets(axes, data, ["friction", name], "x", "y")
        figure.canvas.draw()
        panels = [ax.get_tightbbox(for_layout_only=False) for ax in axes[1:5]]  # no labels on their left
    for one, other in itertools.pairwise(panels):
        assert one.x1 < other.x0
