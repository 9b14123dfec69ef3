"""A finished study to damage; what this machine does not offer is not collected."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from running import write_study

from rubhpc.running.driver import run as run_study

collect_ignore = []
try:
    made = subprocess.run(
        ["unshare", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "none", Path(__file__).parent],
        capture_output=True,
        check=False,
    )
    can_mount = made.returncode == 0
except FileNotFoundError:
    can_mount = False
if not can_mount:
    collect_ignore.append("test_small_disk.py")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a study that has run."""
    folder = tmp_path_factory.mktemp("finished")
    run_study(write_study(folder), quiet=True)
    return folder
