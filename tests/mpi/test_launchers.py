"""Who has started the program: nobody, the mpirun that MPI knows, or that of another MPI: refused."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from running import command, environment, run, write_study

from rubhpc.running.launch import launch


@pytest.mark.parametrize(
    "variables",
    [
        {"PMI_RANK": "0", "PMI_SIZE": "4"},
        {"OMPI_COMM_WORLD_RANK": "0", "OMPI_COMM_WORLD_SIZE": "4"},
        {"SLURM_PROCID": "0", "SLURM_STEP_NUM_TASKS": "4"},
    ],
    ids=["another MPICH", "Open MPI", "srun without PMI"],
)
def test_the_wrong_launcher_is_refused(tmp_path, variables):
    """What the ranks of another vendor's mpirun see: four were started, and MPI connects one."""
    done = run(write_study(tmp_path), **variables)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("rubhpc: the launcher started 4 processes, but MPI (")
    assert "connects 1; use the mpirun of that MPI" in line
    assert not (tmp_path / "tiny.zarr").exists()


def test_other_ranks_of_the_wrong_launcher_are_silent(tmp_path):
    done = run(write_study(tmp_path), OMPI_COMM_WORLD_RANK="3", OMPI_COMM_WORLD_SIZE="4")
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "")


def test_a_launcher_without_mpi4py_names_the_fix(tmp_path):
    (tmp_path / "mpi4py.py").write_text("raise ImportError('none here')")
    path = f"{tmp_path}{os.pathsep}{environment()['PYTHONPATH']}"
    done = run(write_study(tmp_path), PMI_RANK="0", PMI_SIZE="2", PYTHONPATH=path)
    assert done.returncode == 2
    assert "pip install 'rubhpc[mpi]'" in done.stderr
    assert done.stderr.count("\n") == 1


def test_mpi_is_loaded_under_a_launcher_only(tmp_path):
    (tmp_path / "mpi4py.py").write_text("raise ImportError('none here')")
    path = f"{tmp_path}{os.pathsep}{environment()['PYTHONPATH']}"
    assert run(write_study(tmp_path), PYTHONPATH=path).returncode == 0


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({}, (0, 1)),
        ({"PMI_RANK": "2", "PMI_SIZE": "3", "SLURM_PROCID": "0", "SLURM_STEP_NUM_TASKS": "1"}, (2, 3)),
        ({"SLURM_NTASKS": "8", "SLURM_PROCID": "0"}, (0, 1)),  # a batch script that starts no step
        ({"SLURM_STEP_NUM_TASKS": "8", "SLURM_PROCID": "5"}, (5, 8)),
        ({"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "1"}, (1, 2)),
    ],
)
def test_launchers_are_distinguished(monkeypatch, variables, expected):
    for name in list(os.environ):
        if name.startswith(("PMI", "OMPI_", "SLURM_")):
            monkeypatch.delenv(name)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert launch()[:2] == expected


def test_the_tests_start_the_launcher_that_comes_with_the_program():
    assert Path(command(ranks=1)[0]).parent == Path(sys.executable).parent
