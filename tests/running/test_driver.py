"""Runs with a stub in place of the physics: what becomes of each case, and of the run."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr
from running import array_of, journalled_cases, write_sample, write_study
from stub_physics import Physics, record

from rubhpc.errors import RubError, StoppedEarly
from rubhpc.integrate.compilation import compilation
from rubhpc.running import computing, job, stopping, worker
from rubhpc.running.case_setup import count_set_ups
from rubhpc.running.driver import run
from rubhpc.running.pool import Pool
from rubhpc.schema import (
    DIVERGED,
    DONE,
    FAILED,
    MISSING,
)
from rubhpc.storage.status import read_status
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import Integrator, read_study

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from rubhpc.integrate.record import Record
    from rubhpc.study.study import Recording, Study


@pytest.fixture
def physics(monkeypatch: pytest.MonkeyPatch) -> Physics:
    return Physics().put_in(monkeypatch)


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return read_study(write_study(tmp_path, block=3))


def raise_error(**_: Any) -> Record:
    raise ZeroDivisionError("by\nzero")


def diverge(*, recording: Recording, **_: Any) -> Record:
    return record(recording, float("nan"), DIVERGED, "grew past 1 m")


def test_every_case_gets_its_own_numbers(physics, study):
    summary = run(study, quiet=True)
    assert summary.counts == (0, 12, 0, 0, 0)
    assert summary.exit_code == 0
    ds = xr.open_zarr(study.output)
    assert (ds.status == DONE).all()
    for name in ("vertical", "spectrum_contact_force", "section_torsion", "contact_fraction"):
        array, friction = xr.broadcast(ds[name], ds.friction)
        np.testing.assert_array_equal(array, friction.astype(array.dtype))
    assert (ds.period == 7).all()
    assert not verify(study.output)


def test_failed_cases_are_computed_anew_on_request_only(physics, study):
    physics.poison = raise_error
    run(study, quiet=True)
    physics.poison = lambda **_: None
    physics.frictions.clear()
    assert run(study, quiet=True).counts[FAILED] == 4
    assert physics.frictions == []
    summary = run(study, quiet=True, retry_failed=True)
    assert summary.counts == (0, 12, 0, 0, 0)
    assert physics.frictions == [0.3] * 4
    assert not verify(study.output)
    ds = xr.open_zarr(study.output)
    assert np.array_equal(ds.vertical.isel(sample=0).values[0, 0], np.array([0.1, 0.3, 0.5], "f4"))


def test_a_diverged_case_is_a_result(physics, study):
    physics.poison = diverge
    summary = run(study, quiet=True)
    assert summary.counts == (0, 8, 0, 4, 0)
    assert summary.exit_code == 0
    assert run(study, quiet=True, retry_failed=True).computed == 0
    ledger = Store(study.output).replay()
    assert set(ledger.reasons.values()) == {"grew past 1 m"}
    assert not verify(study.output)


def test_a_balance_that_is_off_is_named(physics, study):
    """The result stands, and both the run's end and `rubhpc status` say what is wrong with it."""

    def lose_energy(*, recording: Recording, **_: Any) -> Record:
        case = record(recording, 0.3)
        case.measures.update(energy_residual=0.25, left_closed_form=0)
        return case

    assert "energy balance" not in run(study, quiet=True).text()
    physics.poison = lose_energy
    other = replace(study, output=study.output.with_name("other.zarr"))
    summary = run(other, quiet=True)
    assert summary.counts == (0, 12, 0, 0, 0)
    assert summary.exit_code == 0
    assert "4 done with a remark" in summary.text()
    failures = read_status(other.output).failures
    assert len(failures) == 4
    assert {reported for _, reported in failures} == {
        "its energy balance is off by 25 %; use a smaller accuracy"
    }
    assert "friction=0.3: done" in failures[0][0]


def test_a_run_with_too_many_failures_stops(physics, study):
    physics.poison = raise_error
    summary = run(study, quiet=True, max_failures=0)
    assert summary.counts[FAILED] == 1
    assert summary.counts[MISSING] > 0
    assert summary.exit_code == 1
    assert "--max-failures" in summary.complaint()


def after(n_case: int, action: Callable[[], None], physics: Physics) -> None:
    """Do something when the case after the first `n_case` begins."""

    def on_case() -> None:
        if len(physics.frictions) == n_case:
            action()

    physics.on_case = on_case


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGUSR1])
def test_a_signal_drops_the_case_in_hand_and_keeps_the_finished_ones(physics, study, number):
    after(5, lambda: os.kill(os.getpid(), number), physics)
    handler = signal.getsignal(number)
    with pytest.raises(StoppedEarly, match=f"stopped by {number.name} with 7 of 12 cases missing"):
        run(study, quiet=True)
    assert signal.getsignal(number) == handler
    assert journalled_cases(study.output) == 5
    assert (xr.open_zarr(study.output).status == DONE).sum() == 5
    physics.on_case = lambda: None
    assert run(study, quiet=True).computed == 7
    assert not verify(study.output)


class Clock:
    """A time that passes when the test says so."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1000.0
        clock = SimpleNamespace(monotonic=lambda: self.now, perf_counter=lambda: self.now, time=time.time)
        for module in (worker, stopping):
            monkeypatch.setattr(module, "time", clock)

    def passes(self, seconds: float) -> None:
        self.now += seconds


def test_nothing_is_begun_that_will_not_fit(physics, study, monkeypatch):
    """Cases of one speed take 10 s each and 35 s are given: the fourth would not end in time."""
    study = replace(study, axes=(replace(study.axes[0], values=(0.9,)), *study.axes[1:]))
    clock = Clock(monkeypatch)
    slow = run_slowly(physics, clock, 10)
    monkeypatch.setattr(worker, "run_case", slow)
    with pytest.raises(StoppedEarly, match="the time limit"):
        run(study, quiet=True, time_limit=35)
    assert clock.now == 1030
    assert journalled_cases(study.output) == 3


def test_a_short_case_still_fits_where_a_long_one_does_not(physics, study, monkeypatch):
    """At 20 times the speed the central difference takes a twentieth of the steps, and so of the time."""
    axes = (replace(study.axes[0], values=(0.2, 4.0)), *study.axes[1:])
    study = replace(study, integrator=Integrator(method="central-difference"))
    clock = Clock(monkeypatch)
    slow = run_slowly(physics, clock, 10)
    fast = run_slowly(physics, clock, 0.5)
    monkeypatch.setattr(
        worker, "run_case", lambda setup, **rest: (slow if setup.spin < 100 else fast)(setup, **rest)
    )
    with pytest.raises(StoppedEarly, match="the time limit"):
        run(replace(study, axes=axes), quiet=True, time_limit=35)
    status = xr.open_zarr(study.output).status
    assert (status[0] == DONE).sum() == 3
    assert (status[1] == DONE).all()


def run_slowly(physics: Physics, clock: Clock, seconds: float) -> Callable[..., Record]:
    def slow(*arguments: Any, **named: Any) -> Record:
        result = physics.run_case(*arguments, **named)
        clock.passes(seconds)
        return result

    return slow


def test_the_end_of_the_slurm_job_stops_a_run(physics, study, monkeypatch):
    monkeypatch.setenv("SLURM_JOB_END_TIME", str(int(time.time()) + 29))
    with pytest.raises(StoppedEarly, match="the time limit"):
        run(study, quiet=True)
    monkeypatch.setenv("SLURM_JOB_END_TIME", str(int(time.time()) + 3600))
    assert run(study, quiet=True).counts == (0, 12, 0, 0, 0)


def test_a_block_found_damaged_on_the_way_is_computed_whole(physics, study):
    """Its kept case no longer matches its checksum, so it is not carried over into the new chunk."""
    physics.poison = raise_error
    run(study, quiet=True)
    physics.poison = lambda **_: None
    store = Store(study.output)
    array_of(store.path, "torsion")[0, 0, 0, 5] = 99.0
    physics.frictions.clear()
    summary = run(study, quiet=True, retry_failed=True)
    assert summary.counts == (0, 12, 0, 0, 0)
    assert sorted(physics.frictions) == [0.1, 0.3, 0.3, 0.3, 0.3]
    assert not verify(study.output)


def test_an_error_of_the_programs_own_leaves_its_traceback_in_a_log(physics, study, monkeypatch):
    def burst(*_: Any) -> None:
        raise LookupError("a slip")

    monkeypatch.setattr(worker.Worker, "work", burst)
    with pytest.raises(RubError, match="LookupError: a slip") as reported:
        run(study, quiet=True)
    assert reported.value.exit_code == 70
    (log,) = (study.output / ".rubhpc" / "logs").iterdir()
    assert str(log) in str(reported.value)
    assert "burst" in log.read_text()


def test_progress_goes_to_the_output_and_quiet_says_nothing(physics, study, capsys):
    run(study, quiet=True)
    assert capsys.readouterr() == ("", "")
    run(replace(study, output=study.output.with_name("b.zarr")))
    assert "0/12 cases" in capsys.readouterr().out


def test_what_a_killed_run_left_is_packed_when_the_next_begins(physics, study, monkeypatch):
    monkeypatch.setattr(Store, "pack", lambda *_: None)  # killed before it could
    after(6, lambda: os.kill(os.getpid(), signal.SIGTERM), physics)
    with pytest.raises(StoppedEarly):
        run(study, quiet=True)
    assert (xr.open_zarr(study.output).status == MISSING).all()
    monkeypatch.undo()
    seen: list[int] = []
    physics.on_case = lambda: seen.append(int((xr.open_zarr(study.output).status == DONE).sum()))
    physics.put_in(monkeypatch)
    run(study, quiet=True)
    assert set(seen) == {6}


def test_results_are_packed_now_and_then_for_those_who_look_on(physics, study, monkeypatch):
    monkeypatch.setattr(computing, "_PACKING_GAP", 0.0)
    seen: list[int] = []
    physics.on_case = lambda: seen.append(int((xr.open_zarr(study.output).status == DONE).sum()))
    run(study, quiet=True)
    assert seen == [0, 0, 0, 3, 3, 3, 6, 6, 6, 9, 9, 9]


def test_a_second_interrupt_does_not_wait(physics, study):
    def twice() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)

    after(2, twice, physics)
    with pytest.raises(KeyboardInterrupt):
        run(study, quiet=True)
    with Store(study.output).lock():  # released all the same
        pass


def test_compilations_are_announced_and_are_no_time_of_the_run(physics, study, monkeypatch, capsys):
    def compile_slowly(*_: Any) -> None:
        began = time.perf_counter()
        compilation.announce_set_of("advance")
        time.sleep(0.5)
        compilation.seconds += time.perf_counter() - began

    monkeypatch.setattr(job, "_warm_up", compile_slowly)
    monkeypatch.setattr("rubhpc.integrate.compilation._announced", [])
    monkeypatch.setattr(compilation, "seconds", compilation.seconds)
    began = time.perf_counter()
    summary = run(study)
    assert summary.seconds < time.perf_counter() - began - 0.49
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("compiling kernels, once after an installation: ")
    assert first.endswith("about 10 s on a free core")


def test_the_first_rank_alone_announces_compilations(physics, study, monkeypatch, capsys):
    monkeypatch.setattr(job, "_warm_up", lambda *_: compilation.announce_set_of("advance"))
    monkeypatch.setattr("rubhpc.integrate.compilation._announced", [])
    monkeypatch.setattr(Pool, "rank", 1)
    run(study)
    assert "compiling" not in capsys.readouterr().out


def test_what_another_rank_compiles_is_no_time_of_the_run_either(physics, study, monkeypatch):
    monkeypatch.setattr(job, "_warm_up", lambda *_: time.sleep(0.25))  # for the other rank's kernels
    gathered = Pool.gather
    monkeypatch.setattr(
        Pool,
        "gather",
        lambda self, value: [value, value + 0.2] if isinstance(value, float) else gathered(self, value),
    )
    began = time.perf_counter()
    summary = run(study, quiet=True)
    assert 0.05 <= summary.seconds < time.perf_counter() - began - 0.19


SWEEP = '{ start = 0.9, stop = 2.0, num = 12, sweep = "up" }'


@pytest.mark.parametrize(
    "write",
    [
        write_study,
        write_sample,
        lambda folder: write_study(folder, speed_ratio=SWEEP, block=4),
        lambda folder: write_study(folder, speed_ratio=[0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5], block=16),
    ],
    ids=["grid", "sample", "sweep", "many speeds"],
)
def test_as_many_speeds_are_prepared_as_are_predicted(physics, tmp_path, write):
    read = read_study(write(tmp_path))
    grid = CaseGrid(read)
    predicted = count_set_ups(grid, np.ones(grid.shape, bool))
    run(read, quiet=True)
    assert predicted == len(physics.prepared)


def test_set_ups_of_many_cases_are_predicted_from_a_part(tmp_path, monkeypatch):
    grid = CaseGrid(read_study(write_sample(tmp_path, n=64)))
    whole = count_set_ups(grid, np.ones(grid.shape, bool))
    monkeypatch.setattr("rubhpc.running.case_setup._MOST_COUNTED", 200)
    part = count_set_ups(grid, np.ones(grid.shape, bool))
    assert part == pytest.approx(whole, rel=0.25)
