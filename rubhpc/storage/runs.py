"""The machine of each run of a study: one small file a run, next to its journals."""

from __future__ import annotations

import json
import os
import platform
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from rubhpc.storage.disk import read_record, write_whole
from rubhpc.storage.journal import journals, next_run
from rubhpc.storage.manifest import PRIVATE
from rubhpc.version import __version__


@dataclass(frozen=True, kw_only=True)
class Run:
    """A run: where it was, and when its first and its latest case were under way.

    Attributes
    ----------
    n_core : int
        Cores of the first rank's machine.
    began, wrote : float
        Seconds since 1970: when it began, and when it last put a case down.
    part : str
        Of the study, as "3/64"; "" of a run of all of it.
    """

    number: int
    host: str
    system: str
    processor: str
    n_core: int
    n_rank: int
    version: str
    began: float
    wrote: float = 0.0
    part: str = ""


def free_number(store: Path) -> int:
    """Number of a run that no other has, not even one that has left no journal yet."""
    folder = store / PRIVATE
    recorded = [run.number for path in (folder / "runs").glob("run*.json") if (run := read_record(path, Run))]
    return max(next_run(folder / "journal"), *(number + 1 for number in recorded), 1)


def record_run(store: Path, number: int, n_rank: int, part: str = "") -> None:
    """Put down where a run takes place, as it begins."""
    run = Run(
        number=number,
        host=platform.node(),
        system=f"{platform.system()} {platform.release()}",
        processor=_processor(),
        n_core=os.cpu_count() or 1,
        n_rank=n_rank,
        version=__version__,
        began=time.time(),
        part=part,
    )
    folder = store / PRIVATE / "runs"
    folder.mkdir(exist_ok=True)
    write_whole(folder / f"run{number:06d}.json", json.dumps(asdict(run)).encode())


def end_run(store: Path, number: int) -> None:
    """Put down when a run wrote its last case: in a copy of the store, journals have the time of the copy."""
    path = store / PRIVATE / "runs" / f"run{number:06d}.json"
    run, wrote = read_record(path, Run), _last_written(store).get(number)
    if run is not None and wrote is not None:
        write_whole(path, json.dumps(asdict(run) | {"wrote": wrote}).encode())


def read_runs(store: Path) -> list[Run]:
    """Return the runs that put a case down, in their order; damaged files are skipped."""
    written = _last_written(store)
    recorded = [read_record(path, Run) for path in sorted((store / PRIVATE / "runs").glob("run*.json"))]
    return [
        replace(run, wrote=run.wrote or written[run.number])  # 0 while it goes on, or if it was killed
        for run in recorded
        if run is not None and run.number in written
    ]


def _last_written(store: Path) -> dict[int, float]:
    """When the journals of each run were last written, seconds since 1970."""
    written: dict[int, float] = {}
    for path in journals(store / PRIVATE / "journal"):
        number = int(path.name[3:9])
        written[number] = max(written.get(number, 0.0), path.stat().st_mtime)
    return written


def _processor() -> str:
    """Name of the processor; of an unknown one, its kind."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
