"""Chains of a sweep on several ranks: equal bytes, killed or not."""

from __future__ import annotations

import signal
import time

import pytest
from running import journalled_cases, processes_of, run, start, stored_bytes, write_slow_study

from rubhpc.storage.verify import verify

SWEPT = {
    "speed_ratio": '{ values = [0.9, 1.2, 1.6, 2.0], sweep = "both" }',
    "friction": [0.2],
    "block": 1,
}


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What one process without MPI stores."""
    folder = tmp_path_factory.mktemp("alone")
    done = run(write_slow_study(folder, **SWEPT))
    assert done.returncode == 0, done.stderr
    return stored_bytes(folder / "tiny.zarr")


def test_two_ranks_carry_as_one_does(tmp_path, alone):
    done = run(write_slow_study(tmp_path, **SWEPT), ranks=2)
    assert done.returncode == 0, done.stderr
    assert "16 done; 16 computed" in done.stdout
    assert stored_bytes(tmp_path / "tiny.zarr") == alone


@pytest.mark.parametrize("moments", [(5,), pytest.param((2, 7), marks=pytest.mark.long)])
def test_chains_that_are_killed_go_on_where_they_were(tmp_path, alone, moments):
    """Four chains on two ranks, killed once or twice; a kill costs each rank its block, one case."""
    study, store = write_slow_study(tmp_path, **SWEPT), tmp_path / "tiny.zarr"
    for n_case in moments:
        job = start(study, ranks=2)
        while journalled_cases(store) < n_case:
            time.sleep(0.01)
            assert job.poll() is None
        for process in processes_of(study).values():
            process.send_signal(signal.SIGKILL)
        job.communicate(timeout=60)
        assert n_case <= journalled_cases(store) < 16
    done = run(study, ranks=2)
    assert done.returncode == 0, done.stderr
    assert journalled_cases(store) == 16  # none was computed twice
    assert stored_bytes(store) == alone
    assert not verify(store)
