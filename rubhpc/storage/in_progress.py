"""The in-progress record of each rank, from which a case that kills its rank is identified.

While a rank computes it keeps a small file: the current case, followed by what a fatal signal or an overrun
writes as evidence. A rank that ends normally removes its file, so each file that remains stands for a death.
"""

from __future__ import annotations

import faulthandler
import os
import re
import socket
import uuid
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rubhpc.storage.disk import read_regular, remove

if TYPE_CHECKING:
    from types import TracebackType

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.storage.manifest import Manifest

_RECORD = 64  # bytes of the current case; the evidence follows
_MOST = 2**20  # bytes with its evidence, at most
_OVERRUN = "over its time limit"


class InProgress:
    """The record of the case that a rank computes, as a context."""

    def __init__(self, directory: Path, run: int, writer: str) -> None:
        directory.mkdir(exist_ok=True)
        # A run that leaves no journal gives its number to the next, but not its record.
        self._path = directory / f"run{run:06d}-{writer}-{uuid.uuid4().hex[:12]}"
        self._handle = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        os.write(self._handle, b" " * (_RECORD - 1) + b"\n")
        os.write(self._handle, f"{socket.gethostname()} {oom_kills()}\n".encode())
        self._has_tracer = not faulthandler.is_enabled()
        if self._has_tracer:
            faulthandler.enable(self._handle)

    def take(self, flat: int, name: str) -> None:
        """Note the case that is computed from now on; it survives this process, and takes 1 us."""
        os.pwrite(self._handle, f"{flat} {name}".ljust(_RECORD - 1).encode(), 0)

    def note_overrun(self, seconds: float) -> None:
        """Record as evidence that the current case does not end; from any thread."""
        os.write(self._handle, f"{_OVERRUN} of {seconds:g} s, in a single step of it\n".encode())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._has_tracer:
            faulthandler.disable()
        os.close(self._handle)
        self._path.unlink(missing_ok=True)


@dataclass(frozen=True)
class RankDeaths:
    """Cases that were being computed when ranks died.

    Attributes
    ----------
    failed : dict
        Flat index -> why the case is not to be tried again: it did not return within its time limit.
    suspect : dict
        Flat index -> deaths, of cases that are to be computed last, each by itself: after a fatal signal, for
        lack of memory, or in two runs; one kill without a cause may have been that of all processes.
    """

    failed: dict[int, str]
    suspect: dict[int, int]


def read_deaths(
    directory: Path,
    manifest: Manifest,
    is_missing: NDArray[np.bool_],
    share: NDArray[np.bool_] | None = None,
) -> RankDeaths:
    """Missing cases that were being computed when ranks died; records of other cases are removed.

    With a `share` of the cases, (n_case,), records of no case or of others are left alone: their ranks may
    be at work.
    """
    deaths: Counter[int] = Counter()
    crashed: set[int] = set()
    failed: dict[int, str] = {}
    for record in sorted(directory.glob("run*")) if directory.is_dir() else ():
        found = _read(record)
        if not _is_among(found, share):
            continue
        if found is None or not _is_open(*found[:2], manifest, is_missing):
            remove(record)  # it died before its first case, or that has been computed since
            continue
        flat, _, evidence = found
        deaths[flat] += 1
        if evidence.startswith(_OVERRUN):
            failed[flat] = evidence
        elif evidence:
            crashed.add(flat)
    suspect = {flat: n for flat, n in deaths.items() if flat not in failed and (n > 1 or flat in crashed)}
    return RankDeaths(failed, suspect)


def forget(directory: Path, is_judged: NDArray[np.bool_], share: NDArray[np.bool_] | None = None) -> None:
    """Remove the records of cases that have an outcome, (n_case,), and of those that are of no case.

    With a `share`, only of its cases.
    """
    for record in directory.glob("run*"):
        found = _read(record)
        if not _is_among(found, share):
            continue
        if found is None or found[0] >= len(is_judged) or is_judged[found[0]]:
            remove(record)


def _is_among(found: tuple[int, str, str] | None, share: NDArray[np.bool_] | None) -> bool:
    return share is None or (found is not None and found[0] < len(share) and bool(share[found[0]]))


def _is_open(flat: int, name: str, manifest: Manifest, is_missing: NDArray[np.bool_]) -> bool:
    return flat < len(is_missing) and bool(is_missing[flat]) and manifest.case_id(flat) == name


def _read(record: Path) -> tuple[int, str, str] | None:
    """Flat index and id of the recorded case, and the evidence of its death; None without a case."""
    try:
        data = read_regular(record, _MOST)
    except OSError:
        return None
    found = re.fullmatch(r"(\d+) ([0-9a-f]{32})", data[:_RECORD].decode(errors="replace").strip())
    if found is None:
        return None
    where, _, evidence = data[_RECORD:].decode(errors="replace").partition("\n")
    return int(found[1]), found[2], _cause(evidence) or _out_of_memory(where)


def _cause(evidence: str) -> str:
    line = evidence.partition("\n")[0]
    return line.removeprefix("Fatal Python error: ").lower() if line.startswith("Fatal") else line


def _out_of_memory(where: str) -> str:
    host, _, n_kill = where.partition(" ")
    is_here = host == socket.gethostname() and n_kill.isdigit()
    return "killed, because the machine ran out of memory" if is_here and oom_kills() > int(n_kill) else ""


def oom_kills() -> int:
    """Processes this machine has killed for lack of memory since it started; 0 where that is unknown."""
    try:
        lines = Path("/proc/vmstat").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("oom_kill ")), 0)
