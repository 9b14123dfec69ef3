"""Poisoned cases, locks, and disks that will not be written to."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import subprocess
import time
from pathlib import Path

import xarray as xr
from running import (
    command,
    complaint,
    each_launcher,
    environment,
    run,
    start,
    write_slow_study,
    write_study,
)

from rubhpc.schema import DONE, FAILED
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify

POISONED = Path(__file__).with_name("poisoned.py")


@each_launcher
def test_poisoned_cases_fail_and_the_others_finish(tmp_path, launcher):
    poisoned = {"friction": [0.1, 0.3, 0.5, 0.7], "run": 'case_time_limit = "4 s"'}
    study = write_study(tmp_path, speed_ratio=[0.9], **poisoned)
    done = run("cases", study, ranks=2, script=POISONED, launcher=launcher)
    assert done.returncode == 1, done.stderr
    line = complaint(done.stderr)
    assert line.startswith(f"rubhpc: {tmp_path / 'tiny.zarr'}: 6 of 8 cases failed; the first, ")
    reported = run("status", tmp_path / "tiny.zarr").stdout
    assert "8 cases: 2 done, 6 failed, 0 diverged, 0 missing" in reported
    reasons = {
        0.3: "ZeroDivisionError: a poisoned case",
        0.5: "over its time limit of 4 s",
        0.7: "FloatingPointError: torsion is not finite",
    }
    ledger = Store(tmp_path / "tiny.zarr").replay()
    manifest = Store(tmp_path / "tiny.zarr").manifest
    for flat, status in enumerate(ledger.status.tolist()):
        friction = manifest.points.at_flat(flat)[2]
        assert (status, ledger.reasons.get(flat)) == (
            (DONE, None) if friction == 0.1 else (FAILED, reasons[friction])
        )
    assert not verify(tmp_path / "tiny.zarr")
    stored = xr.open_zarr(tmp_path / "tiny.zarr")
    assert (stored.torsion.isnull().all("sample") == (stored.status == FAILED)).all()
    healthy = run(study, "--retry-failed")
    assert healthy.returncode == 0, healthy.stderr
    assert "8 done; 6 computed" in healthy.stdout


def test_a_second_run_on_a_store_is_refused_and_status_shows_of_the_first(tmp_path):
    study, store = write_slow_study(tmp_path, transient=2000), tmp_path / "tiny.zarr"
    first = start(study)
    lock = store / ".rubhpc" / "lock"
    while not lock.exists():
        time.sleep(0.02)
        assert first.poll() is None
    second = run(study)
    assert second.returncode == 3
    assert f"in use by process {first.pid} on " in second.stderr
    assert second.stderr.count("\n") == 1
    reported = run("status", store)
    assert reported.returncode == 0
    assert f"running: process {first.pid} on " in reported.stdout
    first.send_signal(signal.SIGTERM)
    first.communicate(timeout=20)
    assert first.returncode == 75


def bound_by_permissions(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the program as one whom permissions bind: root loses the privilege to pass them by."""

    def drop_privilege() -> None:
        if os.geteuid() == 0:
            capability_drop, dac_override = 24, 1  # PR_CAPBSET_DROP, CAP_DAC_OVERRIDE
            assert ctypes.CDLL(None).prctl(capability_drop, dac_override, 0, 0, 0) == 0

    return subprocess.run(
        command(*arguments),
        env=environment(),
        preexec_fn=drop_privilege,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_a_store_that_cannot_be_written_is_reported_in_a_line(tmp_path):
    study, store = write_study(tmp_path), tmp_path / "tiny.zarr"
    part = write_study(tmp_path, "part.toml", speed_ratio=[0.9])
    assert run(part).returncode == 0
    before = {path: path.read_bytes() for path in store.rglob("*") if path.is_file()}
    folders = [tmp_path, *(path for path in tmp_path.rglob("*") if path.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    try:
        for arguments in ((study,), (study, "--output", tmp_path / "new.zarr")):
            done = bound_by_permissions(*arguments)
            assert done.returncode == 3, done.stderr
            assert done.stderr.startswith(f"rubhpc: {tmp_path}")
            assert "permission" in done.stderr
            assert done.stderr.count("\n") == 1
        assert bound_by_permissions("status", store).returncode == 0
    finally:
        for folder in folders:
            folder.chmod(0o755)
    assert {path: path.read_bytes() for path in store.rglob("*") if path.is_file()} == before
    assert run(study).returncode == 0


def test_a_full_disk_is_reported_in_a_line_and_the_run_goes_on_once_there_is_space(tmp_path):
    """A limit on the size of files stands for the disk: a journal may not grow beyond a few lines."""
    study, store = write_study(tmp_path, block=1), tmp_path / "tiny.zarr"
    assert run(write_study(tmp_path, "empty.toml", block=1), "--time-limit", "1 ms").returncode == 75
    full = subprocess.run(
        command(study),
        env=environment(),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2500, 2500)),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert full.returncode == 3, full.stderr
    assert full.stderr.startswith(f"rubhpc: {store}: the file size limit is reached")
    assert full.stderr.count("\n") == 1
    done = run(study)
    assert done.returncode == 0, done.stderr
    assert not verify(store)
    n_kept = int(done.stdout.split("/12 cases are stored")[0])
    assert 0 < n_kept < 12
