from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import pytest

from rubhpc.errors import StoreError
from rubhpc.storage import lock as lock_module
from rubhpc.storage.lock import STALE_AFTER, Holder, Lock, is_alive, read_holder

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "store.zarr" / ".rubhpc").mkdir(parents=True)
    return tmp_path / "store.zarr" / ".rubhpc" / "lock"


@pytest.fixture
def dead_pid() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def leave(path: Path, **changes: object) -> None:
    """Leave a lock as a run would that differs from this process in some ways."""
    path.write_text(json.dumps(asdict(replace(Holder.myself(), **changes))))


def test_a_second_run_is_refused_by_the_name_of_the_first_and_leaves_its_lock_alone(path):
    with Lock(path):
        before = path.read_bytes()
        with pytest.raises(StoreError, match=f"process {os.getpid()} on {socket.gethostname()}"):
            Lock(path).__enter__()
        assert path.read_bytes() == before
    assert not path.exists()


def test_the_lock_of_a_dead_process_is_taken_over(path, dead_pid):
    leave(path, pid=dead_pid)
    with Lock(path):
        assert read_holder(path).pid == os.getpid()


def test_a_number_that_went_to_another_process_is_no_holder(path):
    leave(path, born="1")
    assert not is_alive(read_holder(path), path)
    with Lock(path):
        pass


def test_a_zombie_holds_nothing(path):
    process = subprocess.Popen([sys.executable, "-c", ""])
    time.sleep(0.3)  # it ends, but nobody waits for it
    born = (lock_module.process_state(process.pid) or ("", 0, ""))[2]
    leave(path, pid=process.pid, born=born)
    assert not is_alive(read_holder(path), path)
    process.wait()


@pytest.mark.parametrize("place", [{"host": "elsewhere"}, {"space": "of another container"}], ids=str)
def test_another_host_or_container_is_believed_while_its_heart_beats(path, dead_pid, place):
    leave(path, pid=dead_pid, **place)
    host = place.get("host", socket.gethostname())
    with pytest.raises(StoreError, match=f"process {dead_pid} on {host}"):
        Lock(path).__enter__()
    old = time.time() - STALE_AFTER - 5
    os.utime(path, (old, old))
    with Lock(path):
        found = read_holder(path)
        assert (found.host, found.pid) == (socket.gethostname(), os.getpid())


@pytest.mark.parametrize("text", ["", "{", "[]", '{"host": "x"}'])
def test_a_lock_that_says_nothing_holds_nothing(path, text):
    path.write_text(text)
    with Lock(path):
        assert read_holder(path).pid == os.getpid()


def test_the_heart_beats(path, monkeypatch):
    monkeypatch.setattr(lock_module, "HEARTBEAT", 0.05)
    with Lock(path):
        os.utime(path, (0, 0))
        deadline = time.monotonic() + 5
        while path.stat().st_mtime == 0 and time.monotonic() < deadline:
            time.sleep(0.02)
        assert path.stat().st_mtime > time.time() - 60


def test_a_run_whose_lock_was_taken_is_reported_and_leaves_the_other_alone(path, monkeypatch):
    monkeypatch.setattr(lock_module, "HEARTBEAT", 0.05)
    reported: list[bool] = []
    with Lock(path, lambda: reported.append(True)):
        leave(path, token="another")
        deadline = time.monotonic() + 5
        while not reported and time.monotonic() < deadline:
            time.sleep(0.02)
    assert reported == [True]
    assert read_holder(path).token == "another"


def test_a_file_system_without_links_will_do(path, monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(lock_module.os, "link", refuse)
    with Lock(path), pytest.raises(StoreError, match="in use"):
        Lock(path).__enter__()


def test_an_orphan_is_waited_for(path):
    """The holder lives but has lost its launcher: it is about to stop, and the next run need not fail."""
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(0.7)"])
    born = lock_module.process_state(process.pid)[2]
    leave(path, pid=process.pid, born=born, parent=1)
    began = time.monotonic()
    with Lock(path):
        assert time.monotonic() - began > 0.3
    process.wait()


def test_an_heir_takes_the_lock_of_a_lost_rank_at_once(path):
    """On another machine nothing but its heartbeat could show that the holder is dead."""
    leave(path, host="elsewhere", token="of the first rank")
    with pytest.raises(StoreError, match="on elsewhere"):
        Lock(path, heir_of="of another run").__enter__()
    with Lock(path, heir_of="of the first rank") as lock:
        assert read_holder(path).token == lock.token
