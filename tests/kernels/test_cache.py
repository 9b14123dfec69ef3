"""Kernels of an installation that cannot be written, by a user without a home that can."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
import tempfile

import pytest
from running import ROOT, environment

from rubhpc.kernels import _cache

LOAD = """
import rubhpc.kernels.laws
from rubhpc.kernels._cache import cache_folder
from rubhpc.integrate.compilation import compilation
print(cache_folder())
for name in ("one", "other"):
    compilation.announce_set_of(name)
"""


@pytest.fixture
def temporary(monkeypatch, tmp_path):
    """The folder of temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_kernels_go_to_a_private_folder_that_is_named_once(tmp_path):
    """Folders that are files cannot be written by root either."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "rubhpc", tmp_path / "rubhpc", ignore=ignored)
    (tmp_path / "rubhpc" / "kernels" / "__pycache__").touch()
    places = {"HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null", "NUMBA_CACHE_DIR": "/dev/null/kernels"}
    done = subprocess.run(
        [sys.executable, "-c", LOAD],
        env=environment(PYTHONPATH=str(tmp_path), TMPDIR=str(tmp_path), **places),
        capture_output=True,
        text=True,
        timeout=60,
    )
    folder = tmp_path / f"rubhpc-{os.getuid()}"
    assert (done.returncode, done.stdout.strip()) == (0, str(folder)), done.stderr
    assert done.stderr.count(str(folder)) == done.stderr.count("NUMBA_CACHE_DIR") == 1
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_folder_that_others_can_write_is_not_used(temporary):
    own = _cache._private_folder()
    assert own == temporary / f"rubhpc-{os.getuid()}" == _cache._private_folder()
    own.chmod(0o777)
    assert _cache._private_folder() != own
    own.rmdir()
    own.symlink_to(ROOT)
    assert _cache._private_folder() != own


def test_what_is_compiled_beside_the_sources_is_used(monkeypatch, tmp_path):
    beside, cache = tmp_path / "beside", tmp_path / "cache"
    for name in ("one-1", "two-2"):
        (beside / name).mkdir(parents=True)
        for file in ("kernel.nbi", "kernel.1.nbc", "kernel.nbi.lock"):
            (beside / name / file).write_text(name)
    (cache / "two-2").mkdir(parents=True)
    monkeypatch.setattr(_cache, "_BESIDE", beside)
    _cache._link_installed(cache)
    _cache._link_installed(beside)
    linked = {str(path.relative_to(cache)): path.read_text() for path in cache.rglob("*.*")}
    assert linked == {"one-1/kernel.nbi": "one-1", "one-1/kernel.1.nbc": "one-1"}
