"""The Slurm scripts, run with a stand-in for Slurm: what is put back into the queue, and what is not."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "jobs" / "slurm"
SWEEP = SCRIPTS / "sweep.sh"

# A step: says that it runs, and ends with CODE at once, or as soon as USR1 or TERM reaches it.
SRUN = """#!/usr/bin/env bash
echo "$@" > step.arguments
trap 'echo USR1 >> step.signals; exit 75' USR1
trap 'echo TERM >> step.signals; exit 75' TERM
touch step.running
[ -n "$CODE" ] && exit "$CODE"
for _ in $(seq 600); do sleep 0.05; done
exit 99
"""
SCONTROL = """#!/usr/bin/env bash
echo "$@" >> scontrol.arguments
"""


@pytest.fixture
def slurm(tmp_path: Path) -> dict[str, str]:
    """Environment of a job in `tmp_path` whose Slurm is made of two scripts."""
    commands = tmp_path / "bin"
    commands.mkdir()
    for name, text in (("srun", SRUN), ("mpirun", SRUN), ("scontrol", SCONTROL)):
        (commands / name).write_text(text)
        (commands / name).chmod(0o755)
    return {"PATH": f"{commands}:{os.environ['PATH']}", "SLURM_JOB_ID": "4711", "CODE": ""}


def start(
    arguments: list[str], environment: dict[str, str], folder: Path, script: Path = SWEEP
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        ["bash", script, *arguments],
        cwd=folder,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def wait_for(path: Path) -> None:
    deadline = time.monotonic() + 20
    while not path.exists():
        assert time.monotonic() < deadline, f"{path.name} did not come into being"
        time.sleep(0.01)


def requeued(folder: Path) -> list[str]:
    path = folder / "scontrol.arguments"
    return path.read_text().splitlines() if path.exists() else []


@pytest.mark.parametrize("script", sorted(SCRIPTS.parent.glob("*/*.sh")), ids=lambda path: path.name)
def test_script_is_bash_and_asks_for_its_argument(script: Path) -> None:
    subprocess.run(["bash", "-n", script], check=True)
    done = subprocess.run(["bash", script], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


def test_slurm_is_asked_for_a_signal_to_the_script_and_for_leave_to_requeue() -> None:
    options = re.findall(r"^#SBATCH (\S+)$", SWEEP.read_text(), re.MULTILINE)
    assert "--signal=B:USR1@120" in options
    assert "--requeue" in options
    assert "--open-mode=append" in options


def test_study_and_options_reach_rubhpc(slurm: dict[str, str], tmp_path: Path) -> None:
    job = start(["my study.toml", "--output", "x.zarr"], slurm | {"CODE": "0"}, tmp_path)
    job.communicate(timeout=60)
    assert (tmp_path / "step.arguments").read_text().split("rubhpc ")[1] == "my study.toml --output x.zarr\n"


@pytest.mark.parametrize("code", [0, 1, 2, 3, 75, 143])
def test_only_a_study_stopped_early_is_queued_again(code: int, slurm: dict[str, str], tmp_path: Path) -> None:
    job = start(["study.toml"], slurm | {"CODE": str(code)}, tmp_path)
    job.communicate(timeout=60)
    assert job.returncode == code
    assert requeued(tmp_path) == (["requeue 4711"] if code == 75 else [])


@pytest.mark.parametrize("sent", [signal.SIGUSR1, signal.SIGTERM], ids=["stopped", "cancelled"])
@pytest.mark.parametrize("launcher", ["srun", "mpirun -quiet", "rubhpc"])
def test_a_signal_reaches_the_step_whose_end_is_waited_for(
    launcher: str, sent: signal.Signals, slurm: dict[str, str], tmp_path: Path
) -> None:
    """A sweep, or a part of a study, is queued again unless it was cancelled."""
    arguments, script, given = ["my study.toml", "--quiet"], SWEEP, {"RUBHPC_LAUNCHER": launcher}
    if launcher == "rubhpc":
        (tmp_path / "bin" / "rubhpc").write_text(SRUN)
        (tmp_path / "bin" / "rubhpc").chmod(0o755)
        arguments, script = ["64", *arguments], SCRIPTS.parent / "cluster" / "parts.sh"
        given = {"SLURM_ARRAY_TASK_ID": "3"}
    job = start(arguments, slurm | given, tmp_path, script)
    wait_for(tmp_path / "step.running")
    job.send_signal(sent)
    job.communicate(timeout=60)
    if launcher == "rubhpc":
        assert (tmp_path / "step.arguments").read_text() == "my study.toml --quiet --part 3/64\n"
    else:
        assert (tmp_path / "step.signals").read_text() == f"{sent.name[3:]}\n"
    assert job.returncode == 75
    assert requeued(tmp_path) == (["requeue 4711"] if sent is signal.SIGUSR1 else [])


def test_requeueing_has_an_end(slurm: dict[str, str], tmp_path: Path) -> None:
    limits = {"CODE": "75", "SLURM_RESTART_COUNT": "3", "RUBHPC_MOST_RESTARTS": "3"}
    job = start(["study.toml"], slurm | limits, tmp_path)
    _, said = job.communicate(timeout=60)
    assert job.returncode == 75
    assert requeued(tmp_path) == []
    assert "not queued again" in said
