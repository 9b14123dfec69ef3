"""Studies with [drive]: what is stored and opened, resumption, one case again, and what is refused."""

import math
from functools import partial

import numpy as np
import pytest
import running

import rubhpc
from postproc.figures.bifurcation import bifurcation
from postproc.figures.bode import bode
from postproc.figures.map import map as map_figure
from postproc.figures.speed import speed
from postproc.report.page import Page
from rubhpc.errors import InputError
from rubhpc.study.cases import CaseGrid

STUDY = """
rig = "mokhtar2017"
[drive]
start = "1800 rpm"
revolutions = 10
lowest = "1500 rpm"
inertia = "0.002 kg m^2"
[grid]
"drive.torque" = ["-5 N m", "1 N m"]
clearance = ["100 um", "5 mm"]
friction = 0.2
[contact]
model = "mokhtar2017"
[record]
samples_per_revolution = 32
[run]
block = 1
"""


study_of = partial(running.study_of, output="driven.zarr")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("driven")
    rubhpc.run(study_of(folder, STUDY), quiet=True)
    return folder


def test_cases_are_those_of_the_function(folder):
    store = rubhpc.open(folder / "driven.zarr")
    assert store.speed.dims == ("drive_torque", "clearance", "friction", "revolution")
    case = store.sel(drive_torque=1.0, clearance=1e-4, friction=0.2)
    drive = {
        "torque": "1 N m",
        "start": "1800 rpm",
        "revolutions": 10,
        "lowest": "1500 rpm",
        "inertia": 0.002,
    }
    keys = {"clearance": "100 um", "friction": 0.2, "samples_per_revolution": 32}
    alone = rubhpc.run_up("mokhtar2017", drive=drive, **keys, model="mokhtar2017")
    assert alone.contact_fraction.max() > 0.0
    for name in ("speed", "time", "amplitude_vertical"):
        assert np.array_equal(case[name].values, alone[name].values), name
    for name in ("drive_work", "braking_torque"):
        assert np.array_equal(case[f"revolution_{name}"].values, alone[name].values), name
    assert case.drive_work.values == pytest.approx(20.0 * math.pi)
    assert float(case.last_speed) == alone.last_speed
    assert float(case.energy_residual) == alone.energy_residual < 1e-5


def test_a_record_ends_where_the_spin_is_too_slow(folder):
    store = rubhpc.open(folder / "driven.zarr").isel(friction=0)
    ended = store.record_end.values
    assert ended.tolist() == [[1, 1], [0, 0]]
    turned = store.revolutions_turned.values
    assert (turned[0] < 10).all()
    assert np.isnan(store.speed.values[0, 1, turned[0, 1] :]).all()
    assert (store.last_speed.values[0] <= 50.0 * math.pi).all()
    assert (store.status.values == 1).all()


def test_a_case_does_not_depend_on_the_others_of_its_study(folder, tmp_path):
    other = study_of(tmp_path, STUDY.replace('"-5 N m", "1 N m"', '"1 N m", "9 N m"'))
    both = ((study_of(folder, STUDY), 1), (other, 0))
    ids = {CaseGrid(each).case((i, 0, 0, 0)).id for each, i in both}
    speeds = {CaseGrid(each).case((i, 0, 0, 0)).speed for each, i in both}
    assert len(ids) == len(speeds) == 1


def test_a_plan_counts_the_revolutions(tmp_path):
    first, second = (
        sum(block.cost for block in CaseGrid(study_of(tmp_path, STUDY.replace("= 10", f"= {n}"))).blocks())
        for n in (10, 20)
    )
    assert second == 2 * first


def test_a_sample_draws_torques(tmp_path):
    text = STUDY.replace('["-5 N m", "1 N m"]', '{ start = "0.5 N m", stop = "2 N m" }')
    study = study_of(tmp_path, text + '[sample]\nmethod = "lhs"\nn = 5\n')
    grid = CaseGrid(study)
    torques = {case.speed_law.torque for block in grid.blocks() for case in grid.cases(block)}
    assert len(torques) == 5
    assert all(0.5 <= torque <= 2.0 for (torque,) in torques)


def test_figures_of_run_ups_show_driven_rotors(folder):
    store = rubhpc.open(folder / "driven.zarr")
    amplitude, _ = bode(store.isel(drive_torque=1), over="clearance").show()
    assert len([line for line in amplitude.lines if "$g$" in line.get_label()]) == 2


def test_maps_show_measures_of_the_drive_and_none_of_a_steady_speed(folder):
    store = rubhpc.open(folder / "driven.zarr")
    speeds = map_figure(store, "last_speed")
    assert (speeds.shown["last_speed"].sel(drive_torque=1.0) > 188.0).all()
    assert "last_speed" in Page(store).measures.names
    assert map_figure(store, "record_end").show().collections
    for draw in (map_figure, lambda cases, _: bifurcation(cases)):
        with pytest.raises(InputError, match="steady"):
            draw(store, "regime")
    assert "regime" not in Page(store).measures.names


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('start = "1800 rpm"', "", "[drive] start: missing; give one, or the axis drive.start"),
        ('"drive.torque" = ["-5 N m", "1 N m"]', "", "[drive] torque: missing; give one, or the axis"),
        ("revolutions = 10", "", "[drive] revolutions: missing"),
        ("revolutions = 10", "revolutions = 10\ntorque = 1.0", "[drive] torque: is also an axis of the grid"),
        ("revolutions = 10", "revolutions = 10\nspeed = [1, 2]", "speed: goes with a table of torques"),
        ('lowest = "1500 rpm"', 'lowest = "1900 rpm"', "[drive] lowest: 1900 rpm is not below the start"),
        ('lowest = "1500 rpm"', 'highest = "1700 rpm"', "[drive] highest: 1700 rpm is not above the start"),
        ("friction = 0.2", "friction = 0.2\nspeed = 100.0", "[grid] speed: conflicts with [drive]"),
        ('"drive.torque"', '"drive.torqe"', "unknown axis; did you mean drive.torque?"),
        ('clearance = ["100 um", "5 mm"]', "clearance_ratio = 0.7", "clearance_ratio: the speed changes"),
        ("[record]", '[integrator]\nmethod = "central-difference"\n[record]', "keeps the speed constant"),
        ("[record]", "[refine]\n[record]", "[drive]: run-ups are not combined with [refine]"),
        ("[record]", "[run_up]\nstart = 9\nstop = 8\ntime = 9\n[record]", "not combined with [run_up]"),
        ("friction = 0.2", 'friction = { values = [0.1, 0.2], sweep = "up" }', "remove sweep"),
    ],
)
def test_what_drives_nothing_is_refused(tmp_path, old, new, says):
    assert old in STUDY
    with pytest.raises(InputError) as error:
        study_of(tmp_path, STUDY.replace(old, new, 1))
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_torque_without_a_drive_is_refused(tmp_path):
    text = STUDY[: STUDY.index("[drive]")] + STUDY[STUDY.index("[grid]") :]
    with pytest.raises(InputError, match=r"drive.torque: nothing drives the rotor; add the table \[drive\]"):
        study_of(tmp_path, text.replace("friction = 0.2", "friction = 0.2\nspeed = 100.0"))


def test_a_table_of_torques_is_read(tmp_path):
    text = STUDY.replace('"drive.torque" = ["-5 N m", "1 N m"]', '"drive.start" = ["1600 rpm", "1800 rpm"]')
    text = text.replace('start = "1800 rpm"\n', 'torque = ["2 N m", 0]\nspeed = ["0 rpm", "3000 rpm"]\n')
    study = study_of(tmp_path, text)
    laws = [CaseGrid(study).case((i, 0, 0, 0)).speed_law for i in (0, 1)]
    assert laws[0].at(50.0 * math.pi) == pytest.approx(1.0)
    assert [law.start for law in laws] == pytest.approx([160.0 * math.pi / 3.0, 60.0 * math.pi])


def test_speeds_of_several_torques_are_laid_over_one_another(folder):
    store = rubhpc.open(folder / "driven.zarr").isel(clearance=0)
    top, bottom = speed(store, over="drive_torque").show()
    assert len([line for line in top.lines if "drive torque" in line.get_label()]) == 2
    assert bottom.lines[1].get_ydata()[0] == pytest.approx(-5.0)
