"""The launcher is killed again and again, at random moments; nothing is lost, nothing is left running."""

from __future__ import annotations

import random
import subprocess
import time
from pathlib import Path

import pytest
from running import (
    LAUNCHERS,
    Launcher,
    each_launcher,
    processes_of,
    run,
    start,
    stored_bytes,
    write_slow_study,
)

from rubhpc.schema import MISSING
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify

COUNTED = Path(__file__).with_name("poisoned.py")
RANKS, BLOCK = 2, 2  # cases in a block
LONG = pytest.mark.long
PATIENCE = 2.0  # s after which no process of a killed run may be left


def seconds_until_gone(store: Path) -> float:
    """How long processes of a run on the store live on."""
    began = time.monotonic()
    while processes_of(store):
        assert time.monotonic() - began < PATIENCE, processes_of(store)
        time.sleep(0.05)
    return time.monotonic() - began


def wait_until_computing(job: subprocess.Popen[str], store: Path) -> None:
    """Return once a rank has a case in progress, or all is done."""
    before = set((store / ".rubhpc" / "in_progress").glob("*"))
    while job.poll() is None and set((store / ".rubhpc" / "in_progress").glob("*")) <= before:
        time.sleep(0.01)


def storm(folder: Path, launcher: Launcher, n_kill: int, n_friction: int, seed: int) -> None:
    """Kill a run `n_kill` times, complete it, and compare it with one that was left in peace."""
    friction = [round(0.1 + 0.02 * i, 2) for i in range(n_friction)]
    whole = write_slow_study(folder, "whole.toml", output=folder / "whole.zarr", friction=friction)
    assert run(whole, ranks=RANKS, launcher=launcher).returncode == 0
    store = folder / "storm.zarr"
    study = write_slow_study(folder, output=store, friction=friction)
    arguments = ("counted", study, "--output", store)
    count = folder / "count"
    moments = random.Random(seed)
    slowest, n_finished = 0.0, 0
    for _ in range(n_kill):
        job = start(*arguments, ranks=RANKS, launcher=launcher, script=COUNTED, COUNT=str(count))
        if moments.random() < 0.8:  # while it computes; else, in all likelihood, while it starts
            wait_until_computing(job, store)
        try:
            job.wait(timeout=moments.uniform(0.0, 1.0))
            n_finished += 1
        except subprocess.TimeoutExpired:
            job.kill()
        slowest = max(slowest, seconds_until_gone(store))
        job.communicate()
        if (store / ".rubhpc").exists():
            assert not verify(store)  # at every moment, nothing but missing cases
    done = run(*arguments, ranks=RANKS, launcher=launcher, script=COUNTED, COUNT=str(count))
    assert done.returncode == 0, done.stderr
    assert stored_bytes(store) == stored_bytes(folder / "whole.zarr")
    n_case = 4 * n_friction
    again = len(count.read_text().splitlines()) - n_case
    assert 0 <= again <= n_kill * RANKS * BLOCK
    assert not (Store(store).replay().status == MISSING).any()
    assert list((store / ".rubhpc" / "in_progress").iterdir()) == []
    print(
        f"\n{launcher.name}: {n_kill - n_finished} kills of mpirun with {RANKS} ranks: {again} of {n_case} "
        f"cases computed twice (at most {n_kill * RANKS * BLOCK}), last process gone after {slowest:.1f} s"
    )


@each_launcher
def test_a_kill_storm_loses_nothing(tmp_path, launcher):
    storm(tmp_path, launcher, n_kill=2, n_friction=3, seed=20)


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("launcher", LAUNCHERS, ids=lambda launcher: launcher.name)
def test_a_storm_of_twenty_kills_loses_nothing(tmp_path, launcher, seed):
    storm(tmp_path, launcher, n_kill=20, n_friction=20, seed=seed)


@each_launcher
@pytest.mark.parametrize(
    ("moment", "ranks"), [pytest.param(0.3, 2, marks=LONG), (1.0, 2), pytest.param(1.0, 1, marks=LONG)]
)
def test_a_rank_ends_with_its_launcher(tmp_path, launcher, moment, ranks):
    store = tmp_path / "tiny.zarr"
    study = write_slow_study(tmp_path, transient=3000)
    job = start(study, "--output", store, ranks=ranks, launcher=launcher)
    time.sleep(moment)
    job.kill()
    job.communicate()
    seconds_until_gone(store)
