"""A branch study on several ranks: equal bytes, killed or not."""

from __future__ import annotations

import signal
import time

import pytest
from running import journalled_cases, processes_of, run, start, stored_bytes

from rubhpc.storage.verify import verify

STUDY = """
title = "branches"
rig = "mokhtar2017"
[grid]
clearance = { start = "118 um", stop = "124 um" }
speed_ratio = [0.73, 0.74, 0.75, 0.76]
friction = 0.3
[branch]
along = "clearance"
periods = [1]
step = "2 um"
sweeps = 1
doublings = 0
points = 40
[record]
transient = 40
samples_per_revolution = 32
keep = ["section"]
[run]
block = 1
"""


def written(folder):
    """The study file in a folder, where its store is to lie."""
    (folder / "study.toml").write_text(f'output = "{folder}/branches.zarr"\n' + STUDY)
    return folder / "study.toml"


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What one process without MPI stores."""
    folder = tmp_path_factory.mktemp("alone")
    done = run(written(folder))
    assert done.returncode == 0, done.stderr
    return stored_bytes(folder / "branches.zarr")


@pytest.mark.long
def test_branches_killed_on_two_ranks_and_resumed_have_the_bytes_of_one_process(tmp_path, alone):
    study, store = written(tmp_path), tmp_path / "branches.zarr"
    job = start(study, ranks=2)
    while journalled_cases(store) < 1:
        time.sleep(0.005)
        assert job.poll() is None
    for process in processes_of(study).values():
        process.send_signal(signal.SIGKILL)
    job.communicate(timeout=60)
    assert 1 <= journalled_cases(store) <= 4
    done = run(study, ranks=2)
    assert done.returncode == 0, done.stderr
    assert stored_bytes(store) == alone
    assert not verify(store)
