"""Signals, the file STOP and the time limit end a run with 75; the next one completes it."""

from __future__ import annotations

import signal
import time
from typing import TYPE_CHECKING

import pytest
from running import journalled_cases, run, start, write_slow_study

from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify

if TYPE_CHECKING:
    import subprocess
    from pathlib import Path

LONG = 20  # transient revolutions: a case takes a third of a second


def wait_for_a_case(job: subprocess.Popen[str], store: Path) -> None:
    while journalled_cases(store) == 0:
        assert job.poll() is None
        time.sleep(0.02)


def ended_early(job: subprocess.Popen[str]) -> str:
    """The one line of a run that stopped early, within a second or so."""
    began = time.monotonic()
    _, err = job.communicate(timeout=10)
    assert time.monotonic() - began < 3
    assert job.returncode == 75
    (line,) = [line for line in err.splitlines() if line.startswith("rubhpc: ")]
    assert "cases missing; run the same command again" in line
    return line


@pytest.mark.parametrize(
    ("number", "ranks"), [(signal.SIGTERM, 0), (signal.SIGTERM, 2), (signal.SIGINT, 0), (signal.SIGUSR1, 2)]
)
def test_a_signal_stops_a_run(tmp_path, number, ranks):
    study, store = write_slow_study(tmp_path, transient=LONG, block=1), tmp_path / "tiny.zarr"
    job = start(study, ranks=ranks)
    wait_for_a_case(job, store)
    job.send_signal(number)
    assert number.name in ended_early(job)
    n_done = journalled_cases(store)
    assert 0 < n_done < 12
    assert not verify(store)
    assert Store(store).is_packed()
    with Store(store).lock():  # it is free
        pass


def test_the_file_stop_stops_all_ranks_and_the_next_run_completes(tmp_path):
    study, store = write_slow_study(tmp_path, block=1), tmp_path / "tiny.zarr"
    job = start(study, ranks=2)
    wait_for_a_case(job, store)
    (store / "STOP").touch()
    assert "the file STOP" in ended_early(job)
    assert not (store / "STOP").exists()
    n_before = journalled_cases(store)
    done = run(study, ranks=2)
    assert done.returncode == 0, done.stderr
    assert f"12 done; {12 - n_before} computed" in done.stdout


def test_the_time_limit_stops_a_run(tmp_path):
    began = time.monotonic()
    done = run(write_slow_study(tmp_path, transient=2000), "--time-limit", "1.5 s", ranks=2)
    assert done.returncode == 75
    assert time.monotonic() - began < 12  # a case takes half a minute
    assert "stopped by the time limit with 12 of 12 cases missing" in done.stderr


def test_a_signal_before_the_first_case_stops_a_run_too(tmp_path):
    job = start(write_slow_study(tmp_path, transient=2000))
    time.sleep(0.4)
    job.send_signal(signal.SIGTERM)
    _, err = job.communicate(timeout=20)
    assert job.returncode == 75, err
