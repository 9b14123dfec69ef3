"""Studies small enough to run in a second, and how tests start the program on them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
STUDY = """
title = "tiny"
rig = "mokhtar2017"
output = "{output}"
[grid]
speed_ratio = {speed_ratio}
clearance_ratio = [0.7, 0.85]
friction = [0.1, 0.3, 0.5]
[integrator]
{integrator}
[record]
transient = {transient}
revolutions = {revolutions}
samples_per_revolution = 32
keep = {keep}
[run]
block = {block}
{run}
"""


def write_study(folder: Path, name: str = "tiny.toml", **changes: object) -> Path:
    """Write a study file with some keys changed; unless told, 12 cases in blocks of 2, of some 10 ms each."""
    told = {
        "output": folder / "tiny.zarr",
        "speed_ratio": [0.9, 2.0],
        "transient": 1,
        "revolutions": 2,
        "keep": '["waveform", "spectrum", "section"]',
        "block": 2,
        "integrator": 'method = "modal"',
        "run": "",
    }
    path = folder / name
    path.write_text(STUDY.format(**(told | changes)))
    return path


def write_slow_study(folder: Path, name: str = "tiny.toml", **changes: object) -> Path:
    """Write a study that can be stopped on its way: 15 ms a case and revolution."""
    integrator = 'method = "central-difference"\nstep = "2 us"'
    return write_study(folder, name, **({"integrator": integrator, "transient": 8} | changes))


def command(*arguments: object, ranks: int = 0, script: Path | None = None) -> list[str]:
    """Return the command line of the program, under mpirun where `ranks` is not 0."""
    start = [str(Path(sys.executable).with_name("mpirun")), "-n", str(ranks)] if ranks else []
    program = [str(script)] if script else ["-m", "rubhpc"]
    return [*start, sys.executable, *program, *map(str, arguments)]


def environment(**changes: str) -> dict[str, str]:
    """Return an environment in which this source tree is found and no launcher has left its mark."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "OMPI_", "SLURM_"))}
    return kept | {"PYTHONPATH": str(ROOT)} | changes


def run(
    *arguments: object, ranks: int = 0, script: Path | None = None, timeout: float = 120, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run the program to its end."""
    return subprocess.run(
        command(*arguments, ranks=ranks, script=script),
        env=environment(**variables),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def start(
    *arguments: object, ranks: int = 0, script: Path | None = None, **variables: str
) -> subprocess.Popen[str]:
    """Start the program and return at once."""
    return subprocess.Popen(
        command(*arguments, ranks=ranks, script=script),
        env=environment(**variables),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def stored_bytes(store: Path) -> dict[str, bytes]:
    """Return every file of a store that readers see, but for the wall time, which no two runs share."""
    return {
        str(path.relative_to(store)): path.read_bytes()
        for path in store.rglob("*")
        if path.is_file() and not {".rubhpc", "wall_time"} & set(path.relative_to(store).parts)
    }


def journalled_cases(store: Path) -> int:
    """Return how many case lines the journals of a store hold."""
    files = (store / ".rubhpc" / "journal").glob("*rank*.journal")
    return sum(max(len(path.read_bytes().splitlines()) - 1, 0) for path in files)
