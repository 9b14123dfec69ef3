"""Studies whose cases go on from one another: by hand, after stops and damage, grown, and with failures."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr
from closed_form import simulate
from running import Killed, array_of, stored_bytes, write_study

from rubhpc import State, assemble
from rubhpc.errors import InputError, StoppedEarly, StoreError
from rubhpc.rig.reading import read_rig
from rubhpc.running import driver, job, worker
from rubhpc.running.driver import run
from rubhpc.running.plan import make_plan
from rubhpc.running.recompute import reproduce
from rubhpc.schema import DONE, FAILED, MISSING
from rubhpc.storage.in_progress import InProgress
from rubhpc.storage.journal import next_run
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.study import Study, read_study

if TYPE_CHECKING:
    from collections.abc import Callable

SPEEDS = (0.9, 1.2, 1.5, 1.8, 2.1)
RECORD = {"transient": 2, "revolutions": 3}


def swept(folder: Path, sweep: str = "both", speeds: tuple[float, ...] = SPEEDS, **changes: object) -> Study:
    """A study of 5 speeds and 2 clearances, in blocks of 2 speeds."""
    axis = f'{{ values = {list(speeds)}, sweep = "{sweep}" }}'
    settings = {"speed_ratio": axis, "friction": [0.2], "block": 2, **RECORD}
    return read_study(write_study(folder, **(settings | changes)))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Study:
    study = swept(tmp_path_factory.mktemp("finished"))
    summary = run(study, quiet=True)
    assert summary.counts == (0, 20, 0, 0, 0)
    return study


def copied(study: Study, folder: Path) -> Study:
    return replace(study, output=Path(shutil.copytree(study.output, folder / "tiny.zarr")))


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, float]]:
    """Speed (rad/s) and clearance (m) of every case that is computed, in turn."""
    reported: list[tuple[float, float]] = []
    run_case = worker.run_case

    def count(setup: Any, *, clearance: float, **rest: Any) -> Any:
        record = run_case(setup, clearance=clearance, **rest)
        reported.append((setup.spin, clearance))
        return record

    monkeypatch.setattr(worker, "run_case", count)
    monkeypatch.setattr(job, "_warm_up", lambda *_: None)
    return reported


def test_a_study_is_what_one_would_carry_by_hand(finished):
    """Bit for bit, up and down, with the clearance of each speed."""
    store = xr.open_zarr(finished.output).load()
    assert store.status.dims == ("speed_ratio", "clearance_ratio", "friction", "direction")
    assert store.direction.attrs["flag_meanings"] == "up down"
    rig = read_rig("mokhtar2017")
    for i, way in enumerate((SPEEDS, SPEEDS[::-1])):
        state = None
        for speed in way:
            record = simulate(
                rig,
                speed_ratio=speed,
                clearance_ratio=0.85,
                friction=0.2,
                samples_per_revolution=32,
                initial=state,
                **RECORD,
            )
            state = record.final
            case = store.sel(speed_ratio=speed, clearance_ratio=0.85, direction=i).isel(friction=0)
            for name in (
                "section_vertical",
                "peak_contact_force",
                "peak_torsion",
                "energy_residual",
                "steps",
            ):
                assert np.array_equal(case[name].values, np.asarray(getattr(record, name))), name
            assert np.array_equal(case.vertical.values, record.vertical.astype(np.float32))
            assert np.array_equal(case.final_state.values, state.packed())
            again = State.unpacked(case.final_state.values, assemble(rig))
            assert np.array_equal(again.packed(), state.packed())
    up, down = store.peak_torsion.isel(direction=0), store.peak_torsion.isel(direction=1)
    assert not np.array_equal(up.values, down.values)


def test_up_alone_is_the_up_of_both_and_brings_no_dimension(finished, tmp_path):
    up = swept(tmp_path, "up", speeds=SPEEDS[::-1])
    run(up, quiet=True)
    mine, theirs = xr.open_zarr(up.output).load(), xr.open_zarr(finished.output).load().isel(direction=0)
    assert mine.status.dims == ("speed_ratio", "clearance_ratio", "friction")
    assert mine.speed_ratio.values.tolist() == list(SPEEDS)
    for name in ("vertical", "peak_torsion", "final_state"):
        assert np.array_equal(mine[name].values, theirs[name].values)


def kill_after(n_case: int, monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Have the process end in the case after so many; returns what undoes it."""
    run_case, left = worker.run_case, [n_case]

    def count(*given: Any, **named: Any) -> Any:
        if not left[0]:
            raise Killed
        left[0] -= 1
        return run_case(*given, **named)

    monkeypatch.setattr(worker, "run_case", count)
    return lambda: monkeypatch.setattr(worker, "run_case", run_case)


@pytest.mark.parametrize("n_case", [0, 1, 2, 7])
def test_a_chain_goes_on_where_a_kill_has_cut_it(finished, tmp_path, monkeypatch, computed, n_case):
    study = swept(tmp_path)
    undo = kill_after(n_case, monkeypatch)
    with pytest.raises(Killed):
        run(study, quiet=True)
    undo()
    run(study, quiet=True)
    assert stored_bytes(study.output) == stored_bytes(finished.output)
    assert len(computed) <= 20 + 1  # all but the last block had been stored


def test_a_stop_keeps_what_has_ended_of_a_chain(finished, tmp_path, monkeypatch, computed):
    study = swept(tmp_path)
    stopping = driver.Stopping()
    run_case = worker.run_case

    def stop_in_the_fourth(*given: Any, **named: Any) -> Any:
        record = run_case(*given, **named)
        if len(computed) == 4:
            stopping.ask("a test")
        return record

    monkeypatch.setattr(worker, "run_case", stop_in_the_fourth)
    with pytest.raises(StoppedEarly, match="16 of 20 cases missing"):
        run(study, quiet=True, stopping=stopping)
    run(study, quiet=True)
    assert len(computed) == 20
    assert stored_bytes(study.output) == stored_bytes(finished.output)


def test_what_is_damaged_in_a_chain_is_computed_again_and_nothing_else(finished, tmp_path, computed):
    study = copied(finished, tmp_path)
    store = Store(study.output)
    array = array_of(store.path, "section_vertical")
    array[1, 0, 0, 0, 0] = array[1, 0, 0, 0, 0] + 1e-9  # 1.2, in the block before 1.5
    assert len(verify(study.output).cases) == 1
    run(study, quiet=True)
    assert len(computed) == 1
    # Found on the way: the case behind it is missing, and its own block is believed to be whole.
    store = Store(study.output)
    array[1, 0, 0, 0, 0] = array[1, 0, 0, 0, 0] + 1e-9
    flat = int(np.ravel_multi_index((2, 0, 0, 0), store.manifest.shape))
    store.mark_missing(store.replay(), [flat], next_run(store.journal_directory), "test")
    run(study, quiet=True)
    assert len(computed) == 3
    assert stored_bytes(study.output) == stored_bytes(finished.output)
    assert not verify(study.output)


def test_a_value_put_in_makes_new_cases_of_those_behind_it(finished, tmp_path, computed):
    """1.6 comes after three of the five speeds on the way up, after two on the way down."""
    grown = (*SPEEDS[:3], 1.6, *SPEEDS[3:])
    study = swept(tmp_path, speeds=grown)
    shutil.copytree(finished.output, study.output)
    assert make_plan(study).counts[MISSING] == 2 * (3 + 4)
    computed.clear()
    run(study, quiet=True)
    assert len(computed) == 2 * (3 + 4)
    (tmp_path / "fresh").mkdir()
    fresh = swept(tmp_path / "fresh", speeds=grown)
    run(fresh, quiet=True)
    mine, theirs = (xr.open_zarr(s.output).load() for s in (study, fresh))
    for name in mine.data_vars:
        assert name == "wall_time" or np.array_equal(mine[name].values, theirs[name].values, equal_nan=True)


def test_growth_of_another_axis_keeps_every_chain(finished, tmp_path, computed):
    study = swept(tmp_path, friction=[0.2, 0.4])
    shutil.copytree(finished.output, study.output)
    run(study, quiet=True)
    assert len(computed) == 20


def poisoned(monkeypatch: pytest.MonkeyPatch, speed: float) -> Callable[[], None]:
    """Have the cases of a speed fail; returns what undoes it."""
    run_case = worker.run_case

    def fail(setup: Any, **named: Any) -> Any:
        if abs(setup.spin - speed) < 1e-6:
            raise ZeroDivisionError("a poisoned case")
        return run_case(setup, **named)

    monkeypatch.setattr(worker, "run_case", fail)
    return lambda: monkeypatch.setattr(worker, "run_case", run_case)


def test_a_case_that_fails_breaks_its_chain_and_a_retry_completes_it(
    finished, tmp_path, monkeypatch, computed
):
    study = swept(tmp_path)
    speed = float(xr.open_zarr(finished.output).spin_speed[2])
    undo = poisoned(monkeypatch, speed)
    summary = run(study, quiet=True)
    undo()
    assert summary.counts == (0, 16, 4, 0, 0)
    assert "4 done with a remark, rubhpc status lists them" in summary.text()
    ledger = Store(study.output).replay()
    reported = sorted({text for i, text in ledger.reasons.items() if ledger.status[i] == DONE})
    assert reported == ["it starts at rest, as speed_ratio=1.5 before it has failed"]
    store = xr.open_zarr(study.output).load()
    assert (store.status.values[2] == FAILED).all()
    alone = simulate(
        "mokhtar2017",
        speed_ratio=1.8,
        clearance_ratio=0.7,
        friction=0.2,
        samples_per_revolution=32,
        **RECORD,
    )
    assert float(store.peak_torsion[3, 0, 0, 0]) == alone.peak_torsion
    del computed[:]
    run(study, quiet=True)
    assert computed == []
    run(study, quiet=True, retry_failed=True)
    assert len(computed) == 2 * (3 + 3)  # and those behind them
    assert stored_bytes(study.output) == stored_bytes(finished.output)


def test_those_behind_a_case_that_kills_its_rank_wait_for_it(finished, tmp_path, monkeypatch, computed):
    study = swept(tmp_path)
    with pytest.raises(StoppedEarly):
        run(study, quiet=True, time_limit=1e-9)
    store = Store(study.output)
    flat = int(np.ravel_multi_index((1, 0, 0, 0), store.manifest.shape))
    for _ in range(3):
        progress = InProgress(store.in_progress_directory, 1, "rank00000")
        progress.take(flat, store.manifest.case_id(flat))
    run(study, quiet=True)
    assert len(computed) == 20
    slowest = [spin for spin, _ in computed[-4:]]
    assert slowest == sorted(slowest)  # 1.2 to 2.1 on the way up came last, in turn
    assert stored_bytes(study.output) == stored_bytes(finished.output)


def test_one_case_is_computed_again_from_the_store_or_from_the_beginning(finished, tmp_path):
    manifest = Store(finished.output).manifest
    flat = int(np.ravel_multi_index((2, 1, 0, 1), manifest.shape))
    name = manifest.case_id(flat)
    reported = reproduce(finished, name)
    assert "direction=down" in reported.case
    assert "holds the same, bit for bit" in reported.verdict
    elsewhere = reproduce(replace(finished, output=tmp_path / "none.zarr"), name)
    assert elsewhere.measures["peak_torsion"] == reported.measures["peak_torsion"]
    grown = swept(tmp_path, speeds=(*SPEEDS, 2.4))
    with pytest.raises(InputError, match="no case has such an id"):  # another comes before it
        reproduce(replace(grown, output=finished.output), name)


def test_a_sweep_is_part_of_what_a_study_is(finished, tmp_path):
    for sweep, message in (("up", "sweep.speed_ratio was"), ("from_rest", "sweep was")):
        with pytest.raises(StoreError, match=message):
            run(replace(swept(tmp_path, sweep), output=finished.output), quiet=True)


def test_the_plan_shows_how_many_ranks_have_work(finished):
    plan = make_plan(finished)
    assert (
        "12, at most 2 cases each; in 4 sequential sweeps: more ranks than that would be idle" in plan.text()
    )
    assert plan.counts[DONE] == 20


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        ({"friction": '{ values = [0.1, 0.2], sweep = "up" }'}, "speed_ratio is swept already"),
        (
            {"friction": '[0.1]\n"stator.elements" = [4, 6]'},
            "stator.elements: changes the number of degrees of freedom",
        ),
        ({"friction": "[0.1]\ndirection = [0, 1]"}, "direction: unknown axis"),
    ],
)
def test_what_no_motion_can_be_carried_through_is_refused(tmp_path, grid, message):
    with pytest.raises(InputError, match=message) as caught:
        make_plan(swept(tmp_path, **grid))
    assert "\n" not in str(caught.value)
