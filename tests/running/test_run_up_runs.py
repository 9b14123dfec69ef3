"""Studies with [run_up]: what is stored and opened, resumption, one case again, and what is refused."""

import shutil
from functools import partial

import numpy as np
import pandas as pd
import pytest
import running
import xarray as xr
from running import check_a_lost_chunk
from study_texts import RUN_UPS as STUDY

import rubhpc
from postproc.cases.reduction import reduce_store
from postproc.figures.bode import bode
from postproc.figures.orbit import orbit
from postproc.figures.spectrum import spectrum
from postproc.report.budget import write_report
from postproc.signals.sections import section_of
from postproc.signals.waveforms import waveform_data
from postproc.store.case_table import revolution_table, write_table
from postproc.store.open import open_live
from rubhpc.errors import InputError, StoreError
from rubhpc.running.plan import make_plan
from rubhpc.running.recompute import reproduce
from rubhpc.storage.store import Store

study_of = partial(running.study_of, output="run_ups.zarr")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run_ups")
    rubhpc.run(study_of(folder, STUDY), quiet=True)
    return folder


def test_a_store_is_opened_before_its_measures_are_packed(folder, tmp_path):
    shutil.copytree(folder / "run_ups.zarr", tmp_path / "run_ups.zarr")
    whole = open_live(tmp_path / "run_ups.zarr").load()
    (tmp_path / "run_ups.zarr/.rubhpc/packed.json").unlink()
    xr.testing.assert_equal(open_live(tmp_path / "run_ups.zarr").load(), whole)


def test_measures_of_run_ups_have_quantiles(folder):
    path = folder / "run_ups.zarr"
    found = reduce_store(path, "quantiles", "peak_contact_force", levels=[1.0])["peak_contact_force"]
    assert found.item() == rubhpc.open(path)["peak_contact_force"].max()


def test_cases_are_those_of_the_function(folder):
    store = rubhpc.open(folder / "run_ups.zarr")
    assert store.speed.dims == ("run_up_time", "clearance", "friction", "revolution")
    assert store.sizes["revolution"] == 13
    case = store.sel(run_up_time=0.3, clearance=1e-4, friction=0.2)
    alone = rubhpc.run_up(
        "mokhtar2017",
        start="1800 rpm",
        stop="1500 rpm",
        time="0.3 s",
        clearance="100 um",
        friction=0.2,
        samples_per_revolution=32,
        probes=[{"name": "left", "node": 1, "angle": "-45 deg"}],
        model="mokhtar2017",
    )
    n = alone.sizes["revolution"]
    assert n == 8
    assert alone.contact_fraction.max() > 0.0
    for name in ("speed", "time", "amplitude_probe_left", "phase_torsion"):
        assert np.array_equal(case[name].values[:n], alone[name].values), name
        assert np.isnan(case[name].values[n:]).all(), name
    assert np.array_equal(case.probe_left.values[: 32 * n], alone.probe_left.values.astype(np.float32))
    force = alone.peak_contact_force.values
    assert np.array_equal(case.revolution_peak_contact_force.values[:n], force)
    assert case.peak_contact_force.values == pytest.approx(force.max(axis=0))
    work = alone.friction_work.values.sum(axis=0)
    assert case.friction_work.values * n == pytest.approx(work)


def test_a_resumed_study_has_the_same_bytes(folder, tmp_path):
    check_a_lost_chunk(folder / "run_ups.zarr", study_of(tmp_path, STUDY), "revolution_speed")


def test_a_longer_case_is_refused_with_the_reason(folder, tmp_path):
    shutil.copytree(folder / "run_ups.zarr", tmp_path / "run_ups.zarr")
    longer = study_of(tmp_path, STUDY.replace('"0.5 s"]', '"0.5 s", "0.9 s"]'))
    with pytest.raises(StoreError, match=r"its arrays have room for 13 revolutions, and a case needs 24"):
        rubhpc.run(longer, quiet=True)


def test_a_plan_counts_the_revolutions_of_every_case(tmp_path):
    first, second = (
        make_plan(study_of(tmp_path, STUDY.replace('["0.3 s", "0.5 s"]', f'"{time} s"'))).steps
        for time in (0.3, 0.5)
    )
    assert first / second == pytest.approx(8 / 13)


def test_one_case_is_computed_again(folder):
    study = study_of(folder, STUDY)
    name = Store(folder / "run_ups.zarr").manifest.case_id(2)
    assert "holds the same, bit for bit" in reproduce(study, name).verdict


def test_bode_plots_lay_cases_over_one_another(folder):
    store = rubhpc.open(folder / "run_ups.zarr").isel(run_up_time=1)
    amplitude, phase = bode(store, "probe_left", over="clearance").show()
    assert len(amplitude.lines) == len(phase.lines) == 2
    assert amplitude.get_xlim() == pytest.approx((1530, 1778), abs=20)


def test_figures_of_one_case_see_its_signals(folder):
    store = rubhpc.open(folder / "run_ups.zarr").isel(run_up_time=1, clearance=0)
    waves = waveform_data(store, ["probe_left", "contact_force"], None)
    assert waves["revolution"].values[[0, 32]] == pytest.approx([0.0, 1.0])
    assert section_of(store, "vertical").sizes["section"] == 13
    assert len(orbit(store).show().lines) > 0
    for signal in ("torsion", "probe_left"):
        with pytest.raises(InputError, match="the speed changes, and this figure needs a constant one"):
            spectrum(store, signal)


def test_waveforms_end_with_their_own_case(folder):
    """The store is as long as its longest case."""
    store = rubhpc.open(folder / "run_ups.zarr").isel(clearance=1)
    short, long = (waveform_data(store.isel(run_up_time=i), ["vertical"], 2) for i in (0, 1))
    assert short["vertical"].notnull().all()
    assert short["revolution"][0] < long["revolution"][0]
    both = waveform_data(store, ["vertical"], 2, over="run_up_time")
    assert both["revolution"].values[[0, -1]] == pytest.approx([-2.0, -1 / 32])
    for i, alone in enumerate((short, long)):
        assert (both["vertical"][i].values == alone["vertical"].values).all()
    assert orbit(store.isel(run_up_time=0), revolutions=2).show().get_title(loc="left").endswith("rpm")


def test_waveforms_and_orbits_around_a_speed(folder):
    """Run-ups of different rates have a speed in different revolutions."""
    store = rubhpc.open(folder / "run_ups.zarr").isel(clearance=1)
    speeds, at = store["speed"].squeeze().values, 1680.0 / 9.5493
    own = [int(np.nanargmin(abs(row - at))) for row in speeds]
    assert own[0] != own[1]
    both = waveform_data(store, ["vertical"], 2, over="run_up_time", at=at)
    assert both["revolution"].values[[0, -1]] == pytest.approx([-1.0, 1 - 1 / 32])
    for i, turn in enumerate(own):
        whole = store["vertical"].isel(run_up_time=i).values.ravel()
        assert (both["vertical"][i].values == whole[(turn - 1) * 32 : (turn + 1) * 32]).all()
    ax = orbit(store.isel(run_up_time=0), at="1680 rpm").show()
    first, last = (int(word) for word in ax.get_title(loc="left").removesuffix(" rpm").split(" to "))
    assert first >= 1680 >= last  # a coast-down
    with pytest.raises(InputError, match="5000 rpm is none of its speeds, 15"):
        orbit(store.isel(run_up_time=0), at="5000 rpm")


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_revolutions_are_exported_as_rows(folder, tmp_path, kind):
    store, path = rubhpc.open(folder / "run_ups.zarr"), tmp_path / f"table.{kind}"
    if kind == "parquet":
        pytest.importorskip("pyarrow")
    names = ["phase_probe_left", "revolution_peak_contact_force"]
    write_table(revolution_table(store, names), path)
    table = pd.read_csv(path) if kind == "csv" else pd.read_parquet(path)
    of, unit = (lambda name, unit: f"{name} ({unit})") if kind == "csv" else (lambda name, unit: name), "rad"
    case = table[(table[of("run_up_time", "s")] == 0.5) & (table[of("clearance", "m")] == 1e-4)]
    turns = int(np.isfinite(store.speed.values[1, 0, 0]).sum())
    assert turns > 10
    assert len(table) == np.isfinite(store.speed.values).sum()
    assert list(case["revolution"]) == list(range(turns))
    expected = {
        of("speed", "rad s-1"): store.speed,
        of("time", "s"): store.time,
        of("phase_probe_left_order_0.333", unit): store.phase_probe_left.isel(order=0),
        of("revolution_peak_contact_force", "N"): store.revolution_peak_contact_force.isel(stator=0),
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(case[name], values.values[1, 0, 0, :turns])


def test_a_report_shows_measures_and_pictures(folder, monkeypatch, tmp_path):
    monkeypatch.setattr("postproc.report.pictures.MOST_DRAWN", 1)
    load = write_report(rubhpc.open(folder / "run_ups.zarr"), tmp_path / "report.html", 20e6)
    reported = "Of cases that change speed the page shows measures and pictures over their revolutions."
    assert load.notes == [reported]
    page = (tmp_path / "report.html").read_text()
    assert "peak_contact_force" in page
    assert "start 1800 rpm, stop 1500 rpm" in page
    assert page.count('alt="Speed, ') == page.count('alt="Bode plot, ') == 1
    assert 'alt="Waterfall' not in page  # of 13 revolutions at most
    assert "Speed, and Bode plot and waterfall of the probe left; the first 1 of 4 cases are drawn." in page


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('start = "1800 rpm"', "", "[run_up] start: missing; give start, stop and time, or law"),
        ('"run_up.time" = ["0.3 s", "0.5 s"]', "", "[run_up] time: missing; give one, or the axis"),
        ('stop = "1500 rpm"', 'stop = "1500 rpm"\ntime = "1 s"', "run_up.time is also an axis"),
        ('stop = "1500 rpm"', 'stop = "1500 rpm"\nlaw = [[0, 9], [1, 9]]', "start: conflicts with law"),
        ('["0.3 s", "0.5 s"]', '"1 ms"', "run_up.time: 0.001 s: the shaft turns by 0.0275"),
        ('["0.3 s", "0.5 s"]', '"1e9 s"', "1e+09 s: the shaft turns by 2.75e+10 revolutions, above 100000"),
        ('start = "1800 rpm"\nstop = "1500 rpm"', "law = 3", "[run_up.law]: 3 contains no pairs; write [["),
        (
            'start = "1800 rpm"\nstop = "1500 rpm"',
            "law = [[1, 100], [0, 90]]",
            "study.toml: [run_up] law: its times do not rise",
        ),
        ("friction = 0.2", "friction = 0.2\nspeed = 100.0", "[grid] speed: conflicts with [run_up]"),
        ('clearance = ["100 um", "5 mm"]', "clearance_ratio = 0.7", "clearance_ratio: the speed changes"),
        ("[record]", '[integrator]\nmethod = "central-difference"\n[record]', "keeps the speed constant"),
        ("[record]", "[refine]\n[record]", "not combined with [refine]"),
        ("friction = 0.2", 'friction = { values = [0.1, 0.2], sweep = "up" }', "remove sweep"),
        ('[run_up]\nstart = "1800 rpm"\nstop = "1500 rpm"', "", "add the table [run_up]"),
    ],
)
def test_what_is_no_run_up_is_refused(tmp_path, old, new, says):
    assert old in STUDY
    with pytest.raises(InputError) as error:
        study_of(tmp_path, STUDY.replace(old, new, 1))
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_a_law_takes_the_place_of_start_and_stop(tmp_path):
    text = STUDY.replace(
        'start = "1800 rpm"\nstop = "1500 rpm"', 'law = [["0 s", 100], ["1 s", 120], [2, 90]]'
    )
    study = study_of(tmp_path, text.replace('"run_up.time" = ["0.3 s", "0.5 s"]', ""))
    law = study.run_up.law_at(None)
    assert law.time == (0.0, 1.0, 2.0)
    assert law.speed == (100.0, 120.0, 90.0)
    assert study.axis("speed").values == (120.0,)
