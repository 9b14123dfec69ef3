"""The least knock on ranks: the same bytes for any number, and after a kill with another number."""

from __future__ import annotations

import time

import pytest
from running import each_launcher, run, start, write_knocks

from rubhpc.knock_cases import LeastKnock, Progress, search_of
from rubhpc.knocks import least_knock
from rubhpc.running.knocks_on_ranks import least_knock_on
from rubhpc.running.pool import Pool
from rubhpc.study.study import read_study

RUBBING = "[1.0, 1.05, 1.1]"  # without contact-free motion: one knock each
HOW = {"angles": 1, "nodes": (), "most": None, "tolerance": 0.2}


def test_a_rank_goes_on_from_what_others_have_left(tmp_path):
    study = read_study(write_knocks(tmp_path, RUBBING))
    search, shown = search_of(study, **HOW), []
    first, second = (search.key(index) for index in search.left({})[:2])
    Progress(tmp_path / "kept").enter(first, LeastKnock())
    Progress(tmp_path / "kept", rank=3).enter(second, LeastKnock(knocks=7))
    found = least_knock_on(
        Pool(), lambda: study, **HOW, progress=tmp_path / "kept", report=lambda *n: shown.append(n)
    )
    assert shown == [(2, 3), (3, 3)]
    assert found.knocks.values.ravel().tolist()[:2] == [0, 7]
    again = Progress(tmp_path / "kept")
    assert len(again.found) == 3
    again.forget()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith("kept")]


def test_ranks_find_what_one_process_finds(tmp_path):
    study = read_study(write_knocks(tmp_path, RUBBING))
    found = least_knock_on(Pool(), lambda: study, **HOW, progress=tmp_path / "kept", report=lambda *_: None)
    assert found.identical(least_knock(study, **HOW))


@pytest.mark.long
@each_launcher
def test_ranks_and_kills_change_no_byte(tmp_path, launcher):
    study = write_knocks(tmp_path, "{ start = 1.0, stop = 1.3, num = 6 }")
    whole, killed = tmp_path / "whole.csv", tmp_path / "killed.csv"
    options = ("--angles", 2, "--figure")
    assert run("knock", study, *options, tmp_path / "w.png", "--data", whole).returncode == 0
    arguments = ("knock", study, *options, tmp_path / "k.png", "--data", killed)
    job = start(*arguments, ranks=2, launcher=launcher)
    while job.poll() is None and len(Progress(tmp_path / ".k.progress").found) < 2:
        time.sleep(0.05)
    job.kill()
    job.communicate()
    time.sleep(1.0)
    assert Progress(tmp_path / ".k.progress").found
    done = run(*arguments, ranks=3, launcher=launcher)
    assert done.returncode == 0, done.stderr
    assert killed.read_bytes() == whole.read_bytes()
    assert not list(tmp_path.glob(".k.progress*"))
