"""Any number of ranks computes the same bytes, and ranks that cannot work together say so."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import psutil
import pytest
from running import (
    complaint,
    each_launcher,
    journalled_cases,
    processes_of,
    run,
    start,
    stored_bytes,
    wait_for_a_case,
    write_slow_study,
    write_study,
)

from rubhpc.storage.verify import verify

LONG = {"transient": 100, "revolutions": 64, "block": 1}
POISONED = Path(__file__).parents[1] / "faults" / "poisoned.py"


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What one process without MPI stores."""
    folder = tmp_path_factory.mktemp("alone")
    done = run(write_slow_study(folder))
    assert done.returncode == 0, done.stderr
    return stored_bytes(folder / "tiny.zarr")


@each_launcher
@pytest.mark.parametrize("ranks", [*(pytest.param(n, marks=pytest.mark.long) for n in (1, 2, 4)), 3])
def test_any_number_of_ranks_stores_equal_bytes(tmp_path, alone, ranks, launcher):
    done = run(write_slow_study(tmp_path), ranks=ranks, launcher=launcher)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("12 done; 12 computed") == 1  # one rank speaks
    assert stored_bytes(tmp_path / "tiny.zarr") == alone
    files = sorted((tmp_path / "tiny.zarr" / ".rubhpc" / "journal").iterdir())
    cases = [line.split()[1] for path in files for line in path.read_text().splitlines()[1:]]
    assert len(cases) == len(set(cases)) == 12
    assert ranks == 1 or len(files) > 1  # each computes blocks of its own


@pytest.mark.long
def test_the_modal_integrator_does_not_see_how_many_ranks_share_the_machine(tmp_path):
    """Four ranks on two cores: every kernel call takes longer than alone, and none may end elsewhere."""
    stored = []
    for ranks in (0, 4):
        store = tmp_path / f"{ranks}.zarr"
        done = run(write_study(tmp_path, **LONG), "--output", store, ranks=ranks)
        assert done.returncode == 0, done.stderr
        stored.append(stored_bytes(store))
    assert stored[0] == stored[1]


def test_a_resumed_run_of_other_size_stores_equal_bytes(tmp_path, alone):
    study, store = write_slow_study(tmp_path), tmp_path / "tiny.zarr"
    job = start(study, ranks=2)
    while journalled_cases(store) == 0:
        time.sleep(0.02)
        assert job.poll() is None
    job.send_signal(signal.SIGTERM)
    job.communicate(timeout=60)
    assert job.returncode == 75
    assert 0 < journalled_cases(store) < 12
    done = run(study, ranks=3)
    assert done.returncode == 0, done.stderr
    assert journalled_cases(store) == 12  # none was computed twice
    assert stored_bytes(store) == alone


def test_no_rank_outlives_the_daemon_that_started_it(tmp_path):
    """Not even while MPI waits, at its start, for ranks that have ended: only the daemon is killed."""
    study = write_slow_study(tmp_path, **LONG)
    job = start(study, ranks=2)
    while len(processes_of(study)) < 3:  # mpirun and the ranks
        assert job.poll() is None
        time.sleep(0.01)
    psutil.Process(processes_of(study)[0].ppid()).kill()
    job.communicate(timeout=60)
    assert job.returncode != 0
    began = time.monotonic()
    while ranks := [p for number, p in processes_of(study).items() if number >= 0]:
        assert time.monotonic() - began < 10, ranks  # 2 s alone; they would run on for minutes
        time.sleep(0.05)


def test_an_input_error_is_reported_once(tmp_path):
    done = run(tmp_path / "nowhere.toml", ranks=3)
    assert done.returncode == 2
    assert done.stderr.count("nowhere.toml: no such file") == 1


@pytest.mark.parametrize(("mode", "what"), [("rank1", "LookupError: a slip"), ("exit1", "SystemExit")])
def test_a_rank_that_slips_ends_the_job(tmp_path, mode, what):
    began = time.monotonic()
    done = run(mode, write_slow_study(tmp_path, transient=2000), ranks=2, script=POISONED, timeout=60)
    assert done.returncode == 70
    assert time.monotonic() - began < 30  # the study itself takes minutes
    assert complaint(done.stderr).startswith(f"rubhpc: rank 1: {what}; the traceback is in ")
    assert "Traceback" not in done.stderr
    (log,) = (tmp_path / "tiny.zarr" / ".rubhpc" / "logs").iterdir()
    assert what in log.read_text()


INTERRUPTED = "def build():\n    raise KeyboardInterrupt\n"


@each_launcher
def test_an_interrupt_within_a_rig_ends_all_ranks(tmp_path, launcher):
    (tmp_path / "rig.py").write_text(INTERRUPTED)
    study = write_study(tmp_path)
    study.write_text(study.read_text().replace('rig = "mokhtar2017"', 'rig = "rig.py:build"'))
    done = run(study, "--trust-rig", ranks=2, launcher=launcher, timeout=60)
    assert done.returncode == 75
    assert complaint(done.stderr) == "rubhpc: interrupted; run the same command again"


def kill_rank(rank: int, store: Path) -> None:
    """Kill a rank as the kernel does for want of memory."""
    processes_of(store)[rank].kill()


@each_launcher
@pytest.mark.parametrize("rank", [pytest.param(0, marks=pytest.mark.long), 1])
def test_a_rank_that_is_killed_ends_the_job_and_the_next_run_completes(tmp_path, alone, rank, launcher):
    study, store = write_slow_study(tmp_path), tmp_path / "tiny.zarr"
    arguments = (study, "--output", store)
    job = start(*arguments, ranks=2, launcher=launcher)
    wait_for_a_case(job, store)
    began = time.monotonic()
    kill_rank(rank, store)
    job.communicate(timeout=60)
    print(f"\n{launcher.name}: rank {rank} killed, the job ended after {time.monotonic() - began:.1f} s")
    assert job.returncode != 0
    assert not verify(store)
    done = run(*arguments, ranks=2, launcher=launcher)
    assert done.returncode == 0, done.stderr
    assert "12 done" in done.stdout
    assert stored_bytes(store) == alone
