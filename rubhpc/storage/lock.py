"""One run at a time on a store: a lock that names its holder and is reclaimed when the holder is dead.

The lock is a file that comes into being whole (a hard link of a finished one). Its holder touches it every
few seconds. Where the holder's process would be seen, a dead one gives it away; elsewhere, as on another host
or in another container of the same host name, a heartbeat that has stopped.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import socket
import threading
import time
import uuid
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Self
from zlib import crc32

from rubhpc.errors import StoreError
from rubhpc.storage.disk import read_record, remove

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import TracebackType

HEARTBEAT = 10.0  # s between touches of the lock
STALE_AFTER = (
    180.0  # s without a heartbeat, for holders that are not seen; network file systems cache for a minute
)
_LATEST = 4e9  # s since 1970: a later start is no time
ORPHAN_PATIENCE = 15.0  # s to wait for a holder whose launcher has ended: it is about to stop


class InUse(StoreError):  # noqa: N818 - it is a state, not an error
    """The store, or the part of a study, is in use by another process."""


@dataclass(frozen=True)
class Holder:
    """The process that holds a lock; `born` and `parent` identify it among others with its number.

    `part` is the part of the study that it computes, in run number `run`; "" and 0 of a whole run. `space` is
    where numbers of processes mean the same as to it, in addition to the host; "" where that is unknown.
    """

    host: str
    pid: int
    born: str
    parent: int
    since: float
    token: str
    part: str = ""
    run: int = 0
    space: str = ""

    def __str__(self) -> str:
        since = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(self.since))
        process = f"process {self.pid} on {self.host} since {since}"
        return f"part {self.part} ({process})" if self.part else process

    @classmethod
    def myself(cls, part: str = "", run: int = 0) -> Self:
        """Return the description of this process."""
        pid = os.getpid()
        state = process_state(pid)
        return cls(
            host=socket.gethostname(),
            pid=pid,
            born=state[2] if state else "",
            parent=os.getppid(),
            since=time.time(),
            token=uuid.uuid4().hex,
            part=part,
            run=run,
            space=process_space(),
        )

    @property
    def is_near(self) -> bool:
        """Whether its process would be seen from here."""
        return (self.host, self.space) == (socket.gethostname(), process_space())


@cache
def process_space() -> str:
    """Identify the numbers of processes that this one sees: of a container, of a machine since boot."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text()
        return f"{crc32((boot + os.readlink('/proc/self/ns/pid')).encode()):08x}"
    except OSError:
        return ""


def process_state(pid: int) -> tuple[str, int, str] | None:
    """State letter, parent and birth (ticks after boot) of a process on this host; None: no such process."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        # Without /proc only existence can be checked.
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return None
        except PermissionError:
            pass
        return None if Path("/proc/self/stat").exists() else ("R", 0, "")
    fields = text.rpartition(")")[2].split()  # the name before it may hold blanks
    return fields[0], int(fields[1]), fields[19]


def read_holder(path: Path) -> Holder | None:
    """Holder of the lock at `path`; None where it is free."""
    holder = read_record(path, Holder)
    if holder is None or not 0 < holder.pid < 2**31 or not 0 <= holder.since < _LATEST:
        return None
    return holder


def heartbeat_age(path: Path) -> float:
    """Seconds since the last heartbeat, by the file system's own clock, for hosts' clocks differ."""
    probe = path.with_name(f"{path.name}.{uuid.uuid4().hex}.probe")
    try:
        probe.touch()
        return probe.stat().st_mtime - path.stat().st_mtime
    finally:
        probe.unlink(missing_ok=True)


def is_alive(holder: Holder, path: Path) -> bool:
    """Whether the holder of the lock at `path` still runs, as far as can be seen from here."""
    if not holder.is_near:
        return heartbeat_age(path) < STALE_AFTER
    state = process_state(holder.pid)
    return state is not None and state[0] not in "ZX" and state[2] == holder.born


def _is_orphan(holder: Holder) -> bool:
    """Whether the holder, if it is seen, has lost the launcher that started it."""
    state = process_state(holder.pid) if holder.is_near else None
    return state is not None and state[1] != holder.parent


class Lock:
    """Exclusive use of a store, or of a part of a study, as a context.

    Parameters
    ----------
    on_loss : callable
        Called if another run has taken it over.
    heir_of : str
        A holder with this token is a lost rank of this very run: its lock passes on at once.
    part, run : str, int
        Of the holder.
    what : str
        What is locked, for messages; by default the store.
    is_over : callable, optional
        Wait for a holder that is a part, as long as this is not true.
    find_rival : callable
        Who prevents exclusive use though the lock is free.

    Raises
    ------
    InUse
        On entering, when another process has it.
    """

    def __init__(
        self,
        path: Path,
        on_loss: Callable[[], None] = lambda: None,
        heir_of: str = "",
        *,
        part: str = "",
        run: int = 0,
        what: str = "",
        is_over: Callable[[], object] | None = None,
        find_rival: Callable[[], Holder | None] = lambda: None,
    ) -> None:
        self.path = path
        self._on_loss = on_loss
        self._heir_of = heir_of
        self._what = what or str(path.parent.parent)
        self._is_over = is_over
        self._find_rival = find_rival
        self._me = Holder.myself(part, run)
        self._ended = threading.Event()
        self._heart = threading.Thread(target=self._beat, name="lock heartbeat", daemon=True)

    def __enter__(self) -> Self:
        deadline = time.monotonic() + ORPHAN_PATIENCE
        while not self._try():
            holder = read_holder(self.path)
            if holder is None:  # it has just ended
                continue
            is_brief = holder.part and self._is_over is not None and not self._is_over()
            if not is_brief and (not _is_orphan(holder) or time.monotonic() > deadline):
                raise self._in_use(holder)
            time.sleep(0.1)
        if rival := self._find_rival():
            self._unlink()
            raise self._in_use(rival)
        self._heart.start()
        return self

    def _in_use(self, holder: Holder) -> InUse:
        return InUse(f"{self._what}: in use by {holder}; wait for it or stop it")

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def release(self) -> None:
        """Give it up, if that has not been done."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._heart.join()
        self._unlink()

    def _unlink(self) -> None:
        if self._is_mine():
            with suppress(
                OSError
            ):  # on a disk gone read-only the lock stays, and is stale once this process ends
                self.path.unlink()

    @property
    def token(self) -> str:
        """Identifies this lock."""
        return self._me.token

    def _is_mine(self) -> bool:
        holder = read_holder(self.path)
        return holder is not None and holder.token == self._me.token

    def _try(self) -> bool:
        """Take the lock if it is free or stale."""
        ready = self.path.with_name(f"{self.path.name}.{self._me.token}")
        with _guard(self.path):
            holder = read_holder(self.path)
            if holder is not None and holder.token != self._heir_of and is_alive(holder, self.path):
                return False
            try:
                ready.write_text(json.dumps(asdict(self._me)))
                remove(self.path)
                _link(ready, self.path)
            except FileExistsError:  # taken between the look and the link
                return False
            finally:
                ready.unlink(missing_ok=True)
        return True

    def _beat(self) -> None:
        while not self._ended.wait(HEARTBEAT):
            if not self._is_mine():
                self._on_loss()
                return
            with suppress(OSError):  # a full disk still takes a touch; anything else shows at the next write
                os.utime(self.path)


def _link(ready: Path, path: Path) -> None:
    """Have `path` come into being with the content of `ready`, or raise FileExistsError."""
    try:
        os.link(ready, path)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links
        with path.open("x") as file:
            file.write(ready.read_text())


@contextmanager
def _guard(path: Path) -> Iterator[None]:
    """Keep two runs on one host from reclaiming the same stale lock at once, where the file system can."""
    guard = path.with_name(f"{path.name}.guard")
    if guard.exists() and not guard.is_file():  # opening a pipe waits for its other end
        remove(guard)
    with guard.open("w") as file:
        with suppress(OSError):  # no flock on this file system
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def draft_of(path: Path) -> Path:
    """Where this process builds the store at a path, which has no link in it."""
    return path.with_name(f".{path.name}.{socket.gethostname()}.{process_space()}.{os.getpid()}.draft")


def remove_drafts(path: Path, *, is_made: bool = False) -> None:
    """Remove drafts of this store that killed processes left that would be seen; once it is made, all.

    A process that still writes one of those finds the store when it cannot rename its draft.
    """
    path = Path(os.path.realpath(path))
    prefix, host = f".{path.name}.", socket.gethostname()
    for name in os.listdir(path.parent):  # no pattern: a store's name may hold anything
        if name.startswith(f"{prefix}{host}.") and name.endswith(".draft"):
            space, _, pid = name[len(f"{prefix}{host}.") : -len(".draft")].rpartition(".")
            is_near = space in ("", process_space())
            state = process_state(int(pid)) if pid.isdigit() else None
            if pid.isdigit() and (is_made or (is_near and (state is None or state[0] in "ZX"))):
                shutil.rmtree(path.parent / name, ignore_errors=True)
