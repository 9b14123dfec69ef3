"""Starts where a case of a store has ended: the case goes on, ids follow the state, misfits are refused."""

import shutil

import numpy as np
import pytest
from closed_form import simulate
from trial_rig import trial_rig

import rubhpc
from rubhpc import assemble
from rubhpc.errors import InputError
from rubhpc.running.driver import run
from rubhpc.study.cases import CaseGrid
from rubhpc.study.identity import identity_parts
from rubhpc.study.stored_state import StoredState
from rubhpc.study.study import read_study

GRID = '[grid]\nspeed_ratio = [0.75, 0.8]\nclearance = "100 um"\nfriction = 0.3\n'
RECORD = "[record]\ntransient = 0\nrevolutions = 2\nsamples_per_revolution = 32\n"
LAW = '[contact]\nmodel = "mokhtar2017"\n'
CASE = {"clearance": "100 um", "friction": 0.3, "transient": 0, "samples_per_revolution": 32}


def study_of(folder, name, text):
    path = folder / f"{name}.toml"
    path.write_text('rig = "mokhtar2017"\n' + text + "\n" + LAW)
    return read_study(path, folder / f"{name}.zarr")


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """Folder with a store that keeps final states."""
    folder = tmp_path_factory.mktemp("first")
    study = study_of(folder, "first", GRID + RECORD + 'keep = ["section", "state"]\n')
    assert run(study, quiet=True).counts[1] == 2
    return folder


def start_from(store, select="{ speed_ratio = 0.8 }", more=""):
    return f'[initial]\nfrom = "{store}"\nselect = {select}\n{more}'


def test_a_case_goes_on_where_another_has_ended(first, tmp_path):
    text = GRID.replace("[0.75, 0.8]", "0.8") + RECORD + start_from(first / "first.zarr")
    study = study_of(tmp_path, "second", text)
    run(study, quiet=True)
    whole = simulate("mokhtar2017", speed_ratio=0.8, revolutions=4, **CASE)
    with rubhpc.open(study.output) as store:
        assert "final_state" not in store
        second = store.section_vertical.values.ravel()
    np.testing.assert_allclose(second, whole.section_vertical[2:], rtol=0, atol=1e-9 * 1e-4)
    before = simulate("mokhtar2017", speed_ratio=0.8, revolutions=2, **CASE)
    start = {"from": str(first / "first.zarr"), "select": {"speed_ratio": 0.8}}
    for initial in (before.final, start):
        after = simulate("mokhtar2017", speed_ratio=0.8, revolutions=2, initial=initial, **CASE)
        np.testing.assert_array_equal(second, after.section_vertical)
    moved = simulate(
        "mokhtar2017", speed_ratio=0.8, revolutions=1, initial=start | {"vertical": 1e-6}, **CASE
    )
    assert moved.section_vertical[0] - second[0] == pytest.approx(1e-6, rel=1e-6)


def test_the_state_is_what_identifies_a_study(first, tmp_path):
    shutil.copytree(first / "first.zarr", tmp_path / "moved.zarr")
    stores = first / "first.zarr", tmp_path / "moved.zarr"
    here, there = (study_of(tmp_path, "second", GRID + RECORD + start_from(at)) for at in stores)
    assert CaseGrid(here).identity == CaseGrid(there).identity
    other = study_of(tmp_path, "second", GRID + RECORD + start_from(stores[0], "{ speed_ratio = 0.75 }"))
    assert CaseGrid(here).identity != CaseGrid(other).identity
    assert set(identity_parts(here)["initial"]) >= {"state", "vertical"}
    assert here.as_dict()["initial"]["select"] == {"speed_ratio": 0.8}


def test_states_of_axes_and_samples_take_their_place(first, tmp_path):
    drawn = '"initial.vertical" = { start = "-1 um", stop = "1 um" }\n'
    sample = '[sample]\nmethod = "random"\nn = 3\n'
    study = study_of(tmp_path, "drawn", GRID + drawn + sample + RECORD + start_from(first / "first.zarr"))
    grid = CaseGrid(study)
    cases = [case for block in grid.blocks() for case in grid.cases(block)]
    assert len({case.initial.vertical for case in cases}) == 3
    assert {case.initial.state for case in cases} == {study.initial.state}


@pytest.mark.parametrize(
    ("select", "grid", "message"),
    [
        ("{}", "", r"2 values of speed_ratio.*write select = \{ speed_ratio = 0.75 \}"),
        ("{ speed_ratio = 0.9 }", "", "not on the grid of the store; choose one of 0.75, 0.8"),
        ("{ speed = 80 }", "", "has no axis .*speed.*; it has speed_ratio, clearance, friction"),
        ("{ speed_ratio = true }", "", "is not a value"),
        ("5", "", "is not a table"),
        ("{ speed_ratio = 0.8 }", '"stator.elements" = [6, 8]\n', "does not fit this rig"),
    ],
)
def test_what_cannot_start_a_case_is_refused(first, tmp_path, select, grid, message):
    text = GRID + grid + RECORD + start_from(first / "first.zarr", select)
    with pytest.raises(InputError, match=message) as refused:
        CaseGrid(study_of(tmp_path, "second", text))
    assert "\n" not in str(refused.value)
    assert "second.toml" in str(refused.value)


def test_stores_without_a_state_are_refused(first, tmp_path):
    study = study_of(tmp_path, "none", GRID + RECORD)
    CaseGrid(study)
    run(study, quiet=True)
    for start, message in (
        (str(study.output), "keeps no final states; run its study with"),
        (str(tmp_path), "is not a store of a study"),
        ("sweep.zarr", "is not available; choose one of .* or the path of a store"),
    ):
        with pytest.raises(InputError, match=message):
            simulate("mokhtar2017", speed_ratio=0.8, initial={"from": start}, **CASE)
    with pytest.raises(InputError, match="select: it belongs to a store"):
        simulate("mokhtar2017", speed_ratio=0.8, initial={"select": {"friction": 0.3}}, **CASE)
    with pytest.raises(InputError, match=r'stator.elements: .* remove this axis, or "state" from'):
        CaseGrid(
            study_of(tmp_path, "two", GRID + '"stator.elements" = [6, 8]\n' + RECORD + 'keep = ["state"]')
        )


def test_bodies_are_compared_one_by_one():
    """Two rigs may have as many degrees of freedom in all, but others in each body."""
    model = assemble(trial_rig(2))
    n = 2 * model.body_start[-1] + 2 * len(model.stators)
    state = StoredState.of(np.zeros(n), model)
    state.check_fit(model)
    other = StoredState(
        values=state.values,
        bodies=(state.bodies[0] - 1, *state.bodies[1:-1], state.bodies[-1] + 1),
        n_stator=2,
    )
    assert other.digest != state.digest
    with pytest.raises(InputError, match=r"in 2 stators does not fit this rig"):
        other.check_fit(model)
