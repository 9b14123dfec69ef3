"""The launcher is killed again and again, at random moments; nothing is lost, nothing is left running."""

from __future__ import annotations

import random
import subprocess
import time
from typing import TYPE_CHECKING

import psutil
import pytest
from running import journalled_cases, run, start, stored_bytes, write_slow_study

if TYPE_CHECKING:
    from pathlib import Path

KILLS, RANKS, BLOCK = 5, 2, 2  # cases in a block, unless told


def descendants_alive(store: Path) -> list[int]:
    """Processes of any run on the store."""
    return [
        process.pid
        for process in psutil.process_iter(["cmdline", "status"])
        if str(store) in " ".join(process.info["cmdline"] or ())
        and process.info["status"] != psutil.STATUS_ZOMBIE
    ]


def test_a_kill_storm_loses_nothing(tmp_path):
    whole = write_slow_study(tmp_path, "whole.toml", output=tmp_path / "whole.zarr")
    assert run(whole, ranks=RANKS).returncode == 0
    store = tmp_path / "storm.zarr"
    study = write_slow_study(tmp_path, output=store)
    moments = random.Random(20)
    for _ in range(KILLS):
        job = start(study, "--output", store, ranks=RANKS)
        try:
            job.wait(timeout=moments.uniform(0.4, 2.5))
        except subprocess.TimeoutExpired:
            job.kill()
        job.communicate()
    done = run(study, "--output", store, ranks=RANKS)
    assert done.returncode == 0, done.stderr
    assert stored_bytes(store) == stored_bytes(tmp_path / "whole.zarr")
    assert journalled_cases(store) - 12 <= KILLS * RANKS * BLOCK
    deadline = time.monotonic() + 2
    while descendants_alive(store) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert descendants_alive(store) == []


@pytest.mark.parametrize("moment", [0.3, 1.0])
def test_a_rank_ends_with_its_launcher(tmp_path, moment):
    store = tmp_path / "tiny.zarr"
    job = start(write_slow_study(tmp_path, transient=3000), "--output", store, ranks=RANKS)
    time.sleep(moment)
    job.kill()
    job.communicate()
    time.sleep(2)
    assert descendants_alive(store) == []
