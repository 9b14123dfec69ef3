"""Open MPI under `--with-ft ulfm`: who is left after the loss of a rank finishes the study.

Collected where Open MPI is installed.
"""

from __future__ import annotations

import subprocess
import time

import pytest
from running import (
    LAUNCHERS,
    OWN,
    complaint,
    environment,
    processes_of,
    run,
    start,
    stored_bytes,
    wait_for_a_case,
    write_slow_study,
)

from rubhpc.schema import DONE
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify

OPEN_MPI = [launcher for launcher in LAUNCHERS if launcher.is_open_mpi]
SURVIVE = ("--with-ft", "ulfm")


@pytest.mark.parametrize("launcher", OPEN_MPI, ids=lambda launcher: launcher.name)
@pytest.mark.parametrize("victims", [[0], [2], [1, 0]], ids=["first", "last", "two"])
def test_the_survivors_of_lost_ranks_finish_the_study(tmp_path, launcher, victims):
    whole = write_slow_study(tmp_path, "whole.toml", output=tmp_path / "whole.zarr")
    assert run(whole).returncode == 0
    study, store = write_slow_study(tmp_path), tmp_path / "tiny.zarr"
    job = start(study, "--output", store, ranks=3, launcher=launcher, options=SURVIVE)
    wait_for_a_case(job, store)
    began = time.monotonic()
    for victim in victims:
        processes_of(store)[victim].kill()
    out, err = job.communicate(timeout=60)
    assert job.returncode == 71, err
    print(f"\nranks {victims} of 3 killed, the others finished {time.monotonic() - began:.1f} s later")
    lost = "a rank was lost" if len(victims) == 1 else "2 ranks were lost"
    assert complaint(err) == (
        f"rubhpc: {store}: {lost} during the run; the others finished the study, and no case is missing"
    )
    assert "12 done" in out
    assert (Store(store).replay().status == DONE).all()
    assert not verify(store)
    assert stored_bytes(store) == stored_bytes(tmp_path / "whole.zarr")
    assert not (store / ".rubhpc" / "lock").exists()
    assert run(study, "--output", store).returncode == 0


@pytest.mark.parametrize("launcher", OPEN_MPI, ids=lambda launcher: launcher.name)
def test_a_foreign_launcher_is_refused_in_earnest(tmp_path, launcher):
    """Open MPI's mpirun starts a Python whose mpi4py is another's: N worlds of one rank each, all refuse."""
    study = write_slow_study(tmp_path)
    command = [*launcher.command(2)[:-1], str(OWN.folder / "python"), "-m", "rubhpc", str(study)]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2, done.stderr
    assert "the launcher started 2 processes, but MPI (" in complaint(done.stderr)
    assert [path.name for path in tmp_path.iterdir()] == ["tiny.toml"]
