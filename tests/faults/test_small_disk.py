"""A real file system that fills up, and one that is read-only: a mount that only the test sees.

Collected where the kernel lets a user make such mounts (`unshare --map-root-user --mount`).
"""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from running import environment, run, stored_bytes, write_study

from rubhpc.storage.verify import verify

if TYPE_CHECKING:
    from pathlib import Path

SCRIPT = """
set -u
mount -t tmpfs -o size=$1 none disk
"$2" -m rubhpc tiny.toml > full.out 2> full.err; echo $? > full.rc
"$2" -m rubhpc verify disk/tiny.zarr > verify.out 2>&1; echo $? > verify.rc
"$2" -m rubhpc status disk/tiny.zarr > status.out 2>&1
cp -r disk/tiny.zarr full.zarr
mount -o remount,ro disk
"$2" -m rubhpc tiny.toml > ro.out 2> ro.err; echo $? > ro.rc
"$2" -m rubhpc status disk/tiny.zarr > /dev/null 2>&1; echo $? > ro-status.rc
mount -o remount,rw,size=64m disk
"$2" -m rubhpc tiny.toml > again.out 2> again.err; echo $? > again.rc
cp -r disk/tiny.zarr tiny.zarr
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    assert run(write_study(folder, friction=FRICTION)).returncode == 0
    return folder / "tiny.zarr"


FRICTION = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]


@pytest.mark.parametrize(
    "size",
    [pytest.param("300k", marks=pytest.mark.long), "900k", pytest.param("1200k", marks=pytest.mark.long)],
)
def test_a_disk_that_fills_up_keeps_what_is_there_and_is_gone_on_with(tmp_path, whole, size):
    """At the smallest not even the store fits; then a few blocks do; then most of them."""
    (tmp_path / "disk").mkdir()
    write_study(tmp_path, friction=FRICTION, output="disk/tiny.zarr")
    subprocess.run(
        ["unshare", "--map-root-user", "--mount", "bash", "-c", SCRIPT, "bash", size, sys.executable],
        cwd=tmp_path,
        env=environment(),
        check=True,
        timeout=300,
        capture_output=True,
    )

    def reported(name: str) -> str:
        return (tmp_path / name).read_text().strip()

    assert reported("full.rc") == "3", reported("full.err")
    assert reported("full.err").startswith("rubhpc: disk/tiny.zarr: the disk is full; free some space")
    assert reported("full.err").count("\n") == 0
    n_before = 0
    if (tmp_path / "full.zarr" / ".rubhpc").exists():
        assert reported("verify.rc") == "0", reported("verify.out")  # earlier cases are intact
        n_before = int(reported("verify.out").split()[0])
        assert f"24 cases: {n_before} done" in reported("status.out")
        assert reported("ro-status.rc") == "0"
    assert reported("ro.rc") == "3"
    assert reported("ro.err").startswith(
        "rubhpc: disk/tiny.zarr: the file system is read-only; choose another"
    )
    assert reported("ro.err").count("\n") == 0
    assert reported("again.rc") == "0", reported("again.err")
    assert f"24 done; {24 - n_before} computed" in reported("again.out")
    assert not verify(tmp_path / "tiny.zarr")
    assert stored_bytes(tmp_path / "tiny.zarr") == stored_bytes(whole)
    print(f"\na disk of {size}: {n_before} of 24 cases were stored before it was full, none was lost")
