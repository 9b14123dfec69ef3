"""A refined map is killed on its way, again and again, with several processes: its bytes do not change."""

from __future__ import annotations

import random
import time

import pytest
from running import each_launcher, run, start, stored_bytes, write_study

from rubhpc.schema import INFERRED
from rubhpc.storage.status import read_status
from rubhpc.storage.verify import verify

GRID = {
    "speed_ratio": "{ start = 0.9, stop = 2.0, num = 9 }",
    "friction": "{ start = 0.0, stop = 0.4, num = 9 }",
    "transient": 5,
    "keep": '["section"]',
    "run": "[refine]\ncoarse = 4",
}


SLABS = GRID | {"run": '[refine]\ncoarse = 4\naxes = ["friction"]'}


def killed_and_completed(folder, grid=GRID, **how):
    """Run a map at once, and another with kills; whether both are the same, and what is inferred."""
    whole = write_study(folder, "whole.toml", output=folder / "whole.zarr", **grid)
    assert run(whole).returncode == 0
    store = folder / "tiny.zarr"
    study = write_study(folder, output=store, **grid)
    moments = random.Random(3)
    for _ in range(2):
        job = start(study, *how.get("options", ()), ranks=how.get("ranks", 0), **how.get("under", {}))
        while job.poll() is None and not any((store / ".rubhpc" / "journal").glob("*.journal")):
            time.sleep(0.02)
        time.sleep(moments.uniform(0.0, 0.4))
        job.kill()
        job.communicate()
        time.sleep(1.0)
        assert not verify(store)
    assert (
        run(study, *how.get("options", ()), ranks=how.get("ranks", 0), **how.get("under", {})).returncode == 0
    )
    assert read_status(store).counts[INFERRED] > 0
    assert stored_bytes(store) == stored_bytes(folder / "whole.zarr")


def test_kills_of_workers(tmp_path):
    killed_and_completed(tmp_path, options=("--workers", "2"))


@pytest.mark.long
def test_kills_of_workers_within_slabs(tmp_path):
    killed_and_completed(tmp_path, SLABS, options=("--workers", "2"))


@pytest.mark.long
@each_launcher
def test_kills_of_ranks(tmp_path, launcher):
    killed_and_completed(tmp_path, ranks=3, under={"launcher": launcher})
