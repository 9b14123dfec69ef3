"""Signals, the file STOP and the time limit end a run with 75; the next one completes it."""

from __future__ import annotations

import signal
import time
from typing import TYPE_CHECKING

import pytest
from running import (
    LAUNCHERS,
    OWN,
    complaint,
    each_launcher,
    journalled_cases,
    run,
    start,
    wait_for_a_case,
    write_slow_study,
)

from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify

if TYPE_CHECKING:
    import subprocess
    from pathlib import Path

LONG = 10  # transient revolutions: a case takes a fifth of a second


def ended_early(job: subprocess.Popen[str]) -> str:
    """The one line of a run that stopped early, soon: in a second or two, where nothing else runs."""
    began = time.monotonic()
    _, err = job.communicate(timeout=10)
    took = time.monotonic() - began
    assert took < 8  # 0.6 s on idle cores; ten processes may share two
    assert job.returncode == 75
    line = complaint(err)
    assert "cases missing; run the same command again" in line
    print(f"\nended {took:.1f} s after the signal")
    return line


def complete(study: Path, store: Path, **rest: object) -> None:
    """No half case is marked done, and the next run computes what is missing, and nothing else."""
    assert not verify(store)
    n_before = journalled_cases(store)
    assert n_before < 12
    done = run(study, **rest)
    assert done.returncode == 0, done.stderr
    assert f"12 done; {12 - n_before} computed" in done.stdout
    assert not verify(store)


@pytest.mark.parametrize(
    ("number", "ranks", "launcher"),
    [
        pytest.param(signal.SIGTERM, 0, OWN, marks=pytest.mark.long),
        (signal.SIGTERM, 2, OWN),
        (signal.SIGINT, 0, OWN),
        pytest.param(signal.SIGUSR1, 2, OWN, marks=pytest.mark.long),
        *((number, 2, one) for one in LAUNCHERS[1:] for number in (signal.SIGTERM, signal.SIGUSR1)),
    ],
)
def test_a_signal_stops_a_run(tmp_path, number, ranks, launcher):
    """Open MPI's own mpirun ends with 1 on TERM, whatever its ranks say, and gives them half a second."""
    study, store = write_slow_study(tmp_path, transient=LONG, block=1), tmp_path / "tiny.zarr"
    job = start(study, ranks=ranks, launcher=launcher)
    wait_for_a_case(job, store)
    job.send_signal(number)
    if launcher.is_open_mpi and number == signal.SIGTERM:
        _, err = job.communicate(timeout=10)
        assert job.returncode
        assert "Traceback" not in err
    else:
        assert number.name in ended_early(job)
        assert journalled_cases(store) > 0
        assert Store(store).is_packed()
        with Store(store).lock():  # it is free
            pass
    complete(study, store, ranks=ranks, launcher=launcher)


@each_launcher
def test_the_file_stop_stops_all_ranks_and_the_next_run_completes(tmp_path, launcher):
    study, store = write_slow_study(tmp_path, transient=LONG, block=1), tmp_path / "tiny.zarr"
    job = start(study, ranks=2, launcher=launcher)
    wait_for_a_case(job, store)
    (store / "STOP").touch()
    assert "the file STOP" in ended_early(job)
    assert not (store / "STOP").exists()
    complete(study, store, ranks=2, launcher=launcher)


@each_launcher
def test_the_time_limit_stops_a_run(tmp_path, launcher):
    began = time.monotonic()
    study = write_slow_study(tmp_path, transient=2000)
    done = run(study, "--time-limit", "1.5 s", ranks=2, launcher=launcher)
    assert done.returncode == 75
    assert time.monotonic() - began < 12  # a case takes half a minute
    assert "stopped by the time limit with 12 of 12 cases missing" in done.stderr


def test_a_signal_before_the_first_case_stops_a_run_too(tmp_path):
    job = start(write_slow_study(tmp_path, transient=2000))
    time.sleep(0.4)
    job.send_signal(signal.SIGTERM)
    _, err = job.communicate(timeout=20)
    assert job.returncode == 75, err
