"""Studies with [branch]: what is stored and opened, resumption, refusals and the diagram."""

import re
import shutil

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from running import check_a_lost_chunk, study_of
from study_texts import BRANCHES as STUDY

import rubhpc
from postproc.cases.reduction import reduce_store
from postproc.figures.bifurcation import bifurcation
from postproc.figures.branch_lines import events_at, mark_over_map
from postproc.figures.multipliers import at_edges, multipliers
from postproc.report.budget import write_report
from postproc.report.page import Page
from postproc.store.case_table import case_table
from postproc.store.open import open_live, open_store
from rubhpc.errors import InputError
from rubhpc.integrate.branches import case
from rubhpc.running.plan import make_plan
from rubhpc.running.progress import Progress
from rubhpc.running.sampled_cases import Enough, Trail
from rubhpc.study.study import read_study


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    folder = tmp_path_factory.mktemp("branches")
    (folder / "study.toml").write_text(STUDY)
    study = read_study(folder / "study.toml", folder / "branches.zarr")
    rubhpc.run(study, quiet=True)
    return folder


def test_points_have_a_coordinate_for_every_axis(store):
    points = rubhpc.open(store / "branches.zarr")
    assert set(points.peak_torsion.dims) == {"point"}
    assert set(np.unique(points.speed_ratio)) == {0.74, 0.75}
    assert {"clearance", "speed_ratio", "friction", "branch", "period"} <= set(points.coords)
    one = points.rub.select(speed_ratio=0.75)
    free = one.contact_fraction.max("stator") == 0.0
    grazing = one.clearance[(one.event == 4) & free]
    assert float(grazing[-1]) == pytest.approx(122.3228824e-6, rel=1e-7)
    assert one.clearance[free].min() == pytest.approx(float(grazing[-1]))
    modulus = np.hypot(one.multiplier_real, one.multiplier_imag)[:, 0]
    assert np.array_equal(one.stability.values == 1, modulus.values < 1.0)
    assert np.isfinite(one.section_vertical.values).sum() == int(one.period.sum())


def test_what_is_lost_is_computed_anew_and_says_how_far_it_has_come(store, tmp_path, monkeypatch):
    said = []
    monkeypatch.setattr(Progress, "say", lambda self, doing: said.append(doing))
    study = study_of(tmp_path, STUDY, "again.zarr")
    check_a_lost_chunk(store / "branches.zarr", study, "point_value")
    assert said[-1] == ""
    assert any(text.startswith("20 motions of branches found, now at clearance=1") for text in said)
    assert any(" points recorded; branches: " in text for text in said)


def test_points_are_rows_of_a_table_and_have_quantiles(store):
    path = store / "branches.zarr"
    points = open_store(path)
    table = case_table(points)
    assert table.sizes["row"] == points.sizes["point"]
    assert table["clearance"].values.tolist() == points["clearance"].values.tolist()
    middle = reduce_store(path, "quantiles", "peak_contact_force", levels=[0.5])["peak_contact_force"]
    assert middle.item() == pytest.approx(np.nanmedian(points["peak_contact_force"]))


def test_report_has_the_branches_of_each_case(store):
    written = store / "branches.html"
    write_report(open_live(store / "branches.zarr"), written, 20e6)
    page = written.read_text()
    assert "all section points" in page
    assert page.count("data:image/png;base64,") == 4
    assert "Speed ratio r 0.74" in page
    assert "Speed ratio r 0.75" in page
    assert "periodic motions along clearance" in page


def test_branches_are_drawn_over_simulated_cases(store, tmp_path):
    simulated = STUDY.partition("[branch]")[0] + "[record]\ntransient = 20\nrevolutions = 2\n"
    simulated = simulated.replace('stop = "124 um" }', 'stop = "124 um", num = 3, sweep = "both" }')
    (tmp_path / "study.toml").write_text(simulated)
    rubhpc.run(read_study(tmp_path / "study.toml", tmp_path / "simulated.zarr"), quiet=True)
    points = rubhpc.open(store / "branches.zarr")
    ax = bifurcation(points, over=str(tmp_path / "simulated.zarr")).show()
    names = {line.get_label() for line in ax.lines}
    assert {"P1, stable", "P1, unstable", "grazing", "period doubling", "up", "down"} <= names
    dashed = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert dashed
    assert all("unstable" in str(line.get_label()) or line.get_label().startswith("_") for line in dashed)
    with pytest.raises(InputError, match="over: is for branches"):
        bifurcation(rubhpc.open(tmp_path / "simulated.zarr"), over="other.zarr")


def test_events_are_marked_over_a_map(store, synthetic_path):
    points = rubhpc.open(store / "branches.zarr")
    clearance, ratio = ("clearance", [1.1e-4, 1.2e-4], {"units": "m"}), ("speed_ratio", [0.74, 0.75])
    shown = xr.Dataset(coords={"clearance": clearance, "speed_ratio": ratio, "friction": 0.3})
    marked = events_at(points, shown, "clearance", "speed_ratio")
    ax = Figure().subplots()
    named = mark_over_map(marked, shown, "clearance", "speed_ratio", ax)
    drawn = {line.get_label(): line for line in ax.lines}
    assert [line.get_label() for line in named] == list(drawn)
    assert drawn["grazing"].get_xdata().max() == pytest.approx(122.3228824, abs=1e-3)
    assert set(drawn["grazing"].get_ydata()) == {0.74, 0.75}
    with pytest.raises(InputError, match="there is none at the values of the map"):
        events_at(points, shown.assign_coords(friction=0.1), "clearance", "speed_ratio")
    with pytest.raises(InputError, match="its branches follow clearance, the map is over friction"):
        events_at(points, shown, "friction", "speed_ratio")
    with pytest.raises(InputError, match="events: has no branches"):
        events_at(open_store(synthetic_path), shown, "clearance", "speed_ratio")


def test_multipliers_are_drawn(store):
    points = rubhpc.open(store / "branches.zarr")
    plane, moduli = multipliers(points).show()
    assert "multiplier" in plane.get_xlabel()
    assert moduli.get_ylabel() == "Largest modulus"
    marked = next(line for line in moduli.lines if line.get_label() == "period doubling")
    assert marked.get_ydata() == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(InputError, match="there is no 99"):
        multipliers(points, branch=99)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('{ start = "112 um", stop = "124 um" }', '"112 um"', "clearance: .* follows it; write it as"),
        ('along = "clearance"', 'along = "speed"', "along: speed is not an axis of the grid"),
        ('along = "clearance"', 'along = "clearence"', r"axis of the grid; did you mean clearance\?"),
        ("periods = [1, 2]", "periods = [1.5]", "periods: 1.5 is not a number of revolutions"),
        ("periods = [1, 2]", "periods = []", "periods: "),
        ('step = "4 um"', 'step = "4 kg"', "step: "),
        ('step = "4 um"', "step = 0", "step: 0 is out of range"),
        ("sweeps = 1", "sweep = 1", "unknown key; did you mean sweeps"),
        (
            "[record]",
            '[integrator]\nmethod = "central-difference"\n[record]',
            "branches need .integrator. method",
        ),
        (
            "friction = 0.3",
            "friction = { start = 0.1, stop = 0.3 }\n[sample]\nn = 8",
            r"a study with \[sample\] has no axis to follow; remove one",
        ),
        ("[0.74, 0.75]", '{ values = [0.74, 0.75], sweep = "up" }', "branches need no sweep"),
        ("[record]", "[record]\nlyapunov = 2", "lyapunov: branches have multipliers in its place"),
    ],
)
def test_bad_studies_are_refused(tmp_path, old, new, text):
    (tmp_path / "study.toml").write_text(STUDY.replace(old, new))
    with pytest.raises(InputError, match=text) as caught:
        read_study(tmp_path / "study.toml")
    assert "\n" not in str(caught.value)


def test_keys_of_contact_are_not_followed(tmp_path):
    text = STUDY.replace('{ start = "112 um", stop = "124 um" }', '"112 um"').replace(
        "friction = 0.3", 'friction = 0.3\n"contact.restitution" = { start = 0.1, stop = 0.2 }'
    )
    text = text.replace('along = "clearance"', 'along = "contact.restitution"').replace('step = "4 um"', "")
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(InputError, match=r"\[branch\] along: contact\.restitution cannot be followed"):
        read_study(tmp_path / "study.toml")


def test_another_range_is_another_study(store, tmp_path):
    shutil.copytree(store / "branches.zarr", tmp_path / "branches.zarr")
    (tmp_path / "study.toml").write_text(STUDY.replace("124 um", "125 um"))
    with pytest.raises(rubhpc.StoreError, match=r"branch\.stop was 0\.000124, is 0\.000125"):
        rubhpc.run(read_study(tmp_path / "study.toml", tmp_path / "branches.zarr"), quiet=True)


def test_multipliers_beyond_the_plane_are_at_its_edge_in_their_direction():
    values = np.array([0.5, 3.0, -4.0 + 1j, 0.1 + 2j, -2j, complex(np.nan, np.nan)])
    inside, edges = at_edges(values, 1.5)
    assert inside.tolist() == [0.5]
    assert {marker: places.tolist() for marker, places in edges.items()} == {
        ">": [1.5],
        "<": [-1.5 + 0.375j],
        "^": [pytest.approx(0.075 + 1.5j)],
        "v": [-1.5j],
    }


def test_store_without_points_is_refused(store):
    empty = rubhpc.open(store / "branches.zarr").isel(point=slice(0))
    for figure in (bifurcation, multipliers, Page):
        with pytest.raises(InputError, match="contains no point of a branch"):
            figure(empty)


def test_case_without_a_motion_is_done_with_a_remark(tmp_path, monkeypatch):
    """Its arrays hold NaN, those with a value a stator or a section too."""
    monkeypatch.setattr(case, "starts", lambda *_: iter(()))
    (tmp_path / "study.toml").write_text(STUDY)
    rubhpc.run(read_study(tmp_path / "study.toml", tmp_path / "none.zarr"), quiet=True)
    stored = xr.open_zarr(tmp_path / "none.zarr")
    assert np.isnan(stored.point_multiplier_real).all()
    assert np.isnan(stored.point_section_vertical).all()
    assert rubhpc.open(tmp_path / "none.zarr").sizes["point"] == 0


def test_plan_predicts_branches_from_how_far_the_first_has_come(tmp_path, monkeypatch):
    """Cut off where a motion is sought for the n-th time; later it has come by more of the range."""
    (tmp_path / "study.toml").write_text(STUDY)
    shares = []
    for most in (8, 12):

        class Cut(list):
            def append(self, value, most=most):
                super().append(value)
                if len(self) == most:
                    raise Enough

        monkeypatch.setattr(Trail, "begin", lambda trail, cut=Cut: setattr(trail, "noted", cut()))
        plan = make_plan(read_study(tmp_path / "study.toml", tmp_path / f"{most}.zarr"))
        assert "at least" not in plan.text()
        assert re.search(r"\(\d.* to \d.* on one core\)", plan.text())
        first = plan.sample.batches[0]
        assert first.whole == pytest.approx(first.spent / first.share)
        shares.append(first.share)
    assert 0.0 < shares[0] < shares[1] < 1.0
