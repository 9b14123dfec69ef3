"""An identification on ranks: the same posterior for any number, and after a kill with another number."""

from __future__ import annotations

import time

import pytest
import rubbing_machine
import xarray as xr
from running import each_launcher, run, start


@pytest.mark.long
@each_launcher
def test_ranks_and_kills_change_nothing(tmp_path, launcher):
    files = rubbing_machine.write(tmp_path, rubbing_machine.rubbing(30, 0.05))
    options = ("--live", 12, "--draws", 50, "--output")
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert run("identify", *files, *options, whole).returncode == 0
    job = start("identify", *files, *options, killed, ranks=2, launcher=launcher)
    while job.poll() is None and len(list(killed.glob("cases/*"))) < 2:
        time.sleep(0.05)
    job.kill()
    job.communicate()
    time.sleep(1.0)
    assert not (killed / "posterior.nc").exists()
    done = run("identify", *files, *options, killed, ranks=3, launcher=launcher)
    assert done.returncode == 0, done.stderr
    trees = [xr.open_datatree(folder / "posterior.nc", engine="h5netcdf") for folder in (whole, killed)]
    assert trees[0]["posterior"].equals(trees[1]["posterior"])
    assert trees[0]["evidence"].equals(trees[1]["evidence"])
