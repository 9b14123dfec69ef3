"""Rank and size that a launcher such as mpirun gave this process, from the environment, without MPI."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, NoReturn

if TYPE_CHECKING:
    from collections.abc import Iterator

# Rank and number of ranks. Slurm's own count comes last: inside `mpirun` it counts the launcher's daemons.
_VARIABLES = (
    ("PMI_RANK", "PMI_SIZE"),
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
    ("SLURM_PROCID", "SLURM_STEP_NUM_TASKS"),
)


class Launch(NamedTuple):
    """The place a launcher gave this process."""

    rank: int
    size: int
    is_open_mpi: bool = False  # its own launcher, which no other library can be started by
    has_lost: bool = False  # other processes, since it began


_PARENT = os.getppid()
_moved: list[Launch] = []
_watching: list[bool] = []
FIRST_SPEAKS = 1.0  # s, for which the other ranks let the first report: a launcher ends all with one
_LOOK = 0.5  # s between looks at whether the launcher still lives
_FEW = 32
_PR_SET_PDEATHSIG = 1  # from Linux's prctl.h
_ORPHANED = 75  # exit code of a rank whose launcher has ended: run the same command again


def launch() -> Launch:
    """Place of this process from the environment, or since `move_to`; rank 0 of 1 without a launcher."""
    if _moved:
        return _moved[-1]
    for rank, size in _VARIABLES:
        if os.environ.get(rank, "").isdigit() and os.environ.get(size, "").isdigit():
            return Launch(int(os.environ[rank]), int(os.environ[size]), rank.startswith("OMPI_"))
    return Launch(0, 1)


def move_to(rank: int, size: int, *, has_lost: bool = False) -> None:
    """Make `launch` return this place from now on; where ranks were lost, another may be the first."""
    _moved.append(launch()._replace(rank=rank, size=size, has_lost=has_lost))


def leave(code: int | None) -> NoReturn:
    """Exit with a code; after ranks were lost without MPI's own end, in which Open MPI may wait for them."""
    if launch().has_lost:
        sys.stdout.flush()
        sys.stderr.flush()
        if launch().rank > 0:
            time.sleep(FIRST_SPEAKS)
        os._exit(code or 0)
    sys.exit(code)


@contextmanager
def killed_with_launcher() -> Iterator[None]:
    """Around the start of Open MPI: it holds the interpreter, for 8 s if its launcher has ended.

    The kernel then kills this process with its parent. That is no way for longer: "parent" is the thread that
    forked, and Open MPI forks in passing threads where it starts more than `_FEW` ranks on a machine.
    """
    count = os.environ.get("OMPI_COMM_WORLD_LOCAL_SIZE", "")
    if sys.platform != "linux" or not count.isdigit() or int(count) > _FEW:
        yield
        return
    import ctypes  # not for --help

    libc = ctypes.CDLL(None)
    libc.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != _PARENT:
        os._exit(_ORPHANED)
    try:
        yield
    finally:
        libc.prctl(_PR_SET_PDEATHSIG, 0, 0, 0, 0)


def _end_with_hydra() -> None:
    """Have the kernel kill this process with the proxy of MPICH's launcher, whatever call it is in.

    MPI waits for ranks that have ended, and holds the interpreter meanwhile. The proxy forks in its only
    thread, so that the kernel's "parent" is the proxy, for as long as this process lives.
    """
    try:
        name = Path(f"/proc/{_PARENT}/comm").read_bytes()
    except OSError:
        return
    if sys.platform == "linux" and name.startswith(b"hydra"):
        import ctypes  # not for --help

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)


def _is_orphan_from_birth() -> bool:
    """Whether the launcher died before this module was loaded: init is the parent, and is no launcher."""
    if _PARENT != 1:
        return False
    try:
        name = Path("/proc/1/cmdline").read_bytes()
    except OSError:
        return False
    return not any(part in name for part in (b"mpi", b"prte", b"orte", b"hydra", b"slurm"))


def end_with_launcher() -> None:
    """End this process soon after its launcher has died, however deep in imports, a kernel or MPI it is.

    The launcher is the parent that this process had when this module was loaded: it may have died since.
    """
    by_mpirun = any(rank in os.environ for rank, _ in _VARIABLES[:2])  # be it for one rank
    if _watching or not (by_mpirun or launch().size > 1):
        return
    _watching.append(True)
    _end_with_hydra()

    def watch() -> None:
        while os.getppid() == _PARENT and not _is_orphan_from_birth():
            time.sleep(_LOOK)
        os._exit(_ORPHANED)

    threading.Thread(target=watch, name="launcher watch", daemon=True).start()
