"""Worker processes without MPI: the same bytes, and what becomes of a run that loses some of them."""

from __future__ import annotations

import signal
import subprocess
import sys

import psutil
import pytest
from running import (
    complaint,
    environment,
    journalled_cases,
    run,
    start,
    stored_bytes,
    wait_for_a_case,
    write_slow_study,
    write_study,
)

import rubhpc
from rubhpc.errors import InputError
from rubhpc.running.pool import Totals
from rubhpc.running.workers import Sums
from rubhpc.schema import DONE
from rubhpc.storage.store import Store


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of the slow study, computed by one process."""
    folder = tmp_path_factory.mktemp("whole")
    assert run(write_slow_study(folder)).returncode == 0
    return stored_bytes(folder / "tiny.zarr")


def workers_of(job: subprocess.Popen[str]) -> list[psutil.Process]:
    return [
        child
        for child in psutil.Process(job.pid).children()
        if "rubhpc.running.worker_process" in child.cmdline()
    ]


def test_workers_store_the_bytes_of_one_process(tmp_path, whole):
    done = run(write_slow_study(tmp_path), "--workers", 2)
    assert done.returncode == 0, done.stderr
    assert "12 done" in done.stdout
    assert stored_bytes(tmp_path / "tiny.zarr") == whole
    journals = [*(tmp_path / "tiny.zarr" / ".rubhpc" / "journal").glob("*rank*")]
    assert len(journals) == 2
    assert sum(len(path.read_bytes().splitlines()) > 1 for path in journals) == 2  # they shared the work


def test_a_script_needs_no_main_guard(tmp_path):
    """Run as a script, and with a working directory in which rubhpc is not found."""
    study = write_study(tmp_path)
    script = tmp_path / "script.py"
    script.write_text(f"import rubhpc\nprint(rubhpc.run({str(study)!r}, workers=2, quiet=True).counts)\n")
    done = subprocess.run(
        [sys.executable, script], env=environment(), cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "(0, 12, 0, 0, 0)\n"


def test_the_loss_of_a_worker_does_not_end_the_run(tmp_path, whole):
    study, store = write_slow_study(tmp_path), tmp_path / "tiny.zarr"
    job = start(study, "--workers", 2)
    wait_for_a_case(job, store)
    workers_of(job)[0].kill()
    out, err = job.communicate(timeout=120)
    assert job.returncode == 71, err
    assert "a rank was lost during the run; the others finished the study" in complaint(err)
    assert "12 done" in out
    assert (Store(store).replay().status == DONE).all()
    assert stored_bytes(store) == whole


def test_workers_end_with_their_parent(tmp_path, whole):
    study, store = write_slow_study(tmp_path), tmp_path / "tiny.zarr"
    job = start(study, "--workers", 3)
    wait_for_a_case(job, store)
    workers = workers_of(job)
    assert len(workers) == 2
    job.kill()
    _, alive = psutil.wait_procs(workers, timeout=20)
    assert not alive
    job.communicate()
    assert run(study).returncode == 0
    assert stored_bytes(store) == whole


def test_an_interrupt_stops_all_of_them(tmp_path):
    study, store = write_slow_study(tmp_path), tmp_path / "tiny.zarr"
    job = start(study, "--workers", 2)
    wait_for_a_case(job, store)
    workers = workers_of(job)
    assert len(workers) == 1
    job.send_signal(signal.SIGINT)
    _, err = job.communicate(timeout=60)
    assert job.returncode == 75, err
    assert "stopped by SIGINT" in complaint(err)
    assert not any(worker.is_running() for worker in workers)
    assert 0 < journalled_cases(store) < 12


def test_workers_beside_mpirun_are_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("PMI_RANK", "0")
    monkeypatch.setenv("PMI_SIZE", "2")
    with pytest.raises(InputError, match="workers: mpirun has started several processes already"):
        rubhpc.run(write_study(tmp_path), workers=2)
    with pytest.raises(InputError, match="workers: 0 is out of range"):
        rubhpc.run(write_study(tmp_path), workers=0)


def test_sums_are_those_of_all_who_add(tmp_path):
    """Two handles of one file, as two processes have them."""
    with (tmp_path / "sums").open("w+b") as one, (tmp_path / "sums").open("r+b") as other:
        first, second = Sums(one.fileno()), Sums(other.fileno())
        assert first.add(Totals(claimed=1)) == Totals()
        assert second.add(Totals(claimed=1, done=3)) == Totals(claimed=1)
        assert first.add(Totals()) == Totals(claimed=2, done=3)
        second.reset()
        assert first.add(Totals()) == Totals()
