"""Child processes: modules that lie in the current folder are none of theirs."""

from __future__ import annotations

import os
import subprocess

import pytest
from running import command, environment, write_knocks, write_study

from rubhpc import children


@pytest.mark.parametrize("known", ["", "/first:/second"])
def test_the_current_folder_is_not_searched(monkeypatch, known):
    monkeypatch.setenv("PYTHONPATH", known)
    given = children.environment(LANG="C")
    assert given["PYTHONPATH"].split(os.pathsep)[1:] == known.split(os.pathsep)[: len(known)]
    assert (given[children.SAFE_PATH], given["LANG"]) == ("1", "C")
    assert "-P" in children.command("module")


@pytest.mark.parametrize(
    "name", ["run on workers", "run on ranks", "knock", pytest.param("reduce", marks=pytest.mark.long)]
)
def test_what_is_planted_there_is_not_imported(tmp_path, name):
    for module in ("numpy", "random", "socket", "zarr", "numba", "mpi4py"):
        (tmp_path / f"{module}.py").write_text(f"open('planted {module}', 'w')\nraise SystemExit(3)\n")
    study = write_study(tmp_path, clearance_ratio=[0.7], friction=[0.1])
    asked = {
        "run on workers": command(study, "--workers", 2),
        "run on ranks": command(study, ranks=2),
        "knock": command("knock", write_knocks(tmp_path, "[1.0, 1.05]"), "--angles", 1, "--workers", 2),
        "reduce": command("reduce", study.with_suffix(".zarr"), "--on", "processes", "--workers", 1),
    }
    for step in (["run on workers"] if name == "reduce" else []) + [name]:
        done = subprocess.run(
            asked[step], env=environment(), cwd=tmp_path, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stderr
    assert not [*tmp_path.glob("planted*")]
