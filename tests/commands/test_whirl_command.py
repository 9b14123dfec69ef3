"""The command `whirl`: what it answers in words, as JSON and as a chart, for a rig and for a study."""

import json
import math
import re
import shlex
from functools import partial
from pathlib import Path

import pytest
from printing import printed

from rubhpc.commands.whirl import whirl
from rubhpc.errors import InputError

GUIDE = (Path(__file__).parents[2] / "docs" / "guide" / "dry_whirl.md").read_text(encoding="utf-8")
RIG = re.search(r"```toml\n(.*?)```", GUIDE, re.DOTALL)[1]  # type: ignore[index]
STUDY = """
rig = "pump.toml"
[grid]
speed = ["1000 rpm", "2000 rpm"]
clearance = ["0.2 mm", "0.3 mm"]
friction = 0.25
[contact]
normal = "updated"
law = "penalty"
stiffness = "1e7 N/m"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "pump.toml").write_text(RIG)
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


run = partial(printed, whirl)


def test_answer_gives_the_friction_up_to_a_speed_and_the_frequency_of_whirl(folder):
    document = json.loads(run("pump.toml", "--clearance", "0.2 mm", "--frequency", "200 Hz", "--json"))
    bore, other = document["bores"]
    assert (bore["stator"], bore["node"], other["node"]) == (1, 7, 6)
    assert set(document) == {
        "answer",
        "speed",
        "clearance",
        "most_frequency",
        "bores",
        "thresholds",
        "whirls",
    }
    assert document["most_frequency"] == pytest.approx(400 * math.pi)
    assert document["clearance"] == [2e-4]
    assert bore["least_friction"][0] == [None], "at standstill nothing whirls"
    least = min(row["friction"] for row in document["thresholds"] if row["stator"] == 1)
    assert least == pytest.approx(min(row[0] for row in bore["least_friction"][1:]))
    at = next(row for row in document["thresholds"] if row["friction"] == least)
    top = 30 / math.pi * document["speed"][-1]
    hertz = abs(at["frequency"]) / (2 * math.pi)
    begin, _, end = document["answer"][0].partition("; ")
    assert begin.startswith(f"Stator 1, node 7: no dry whirl below a friction of {least:.3g} up to ")
    speed, _, limit = begin.split(" up to ")[-1].partition(" rpm and ")
    assert float(speed) == pytest.approx(top, rel=1e-3)
    assert limit == "200 Hz"
    assert end.startswith(f"above it whip at {hertz:.3g} Hz")
    assert not document["whirls"]


def test_the_guide_shows_what_is_printed(folder):
    given = re.findall(r"rubhpc whirl (pump.toml .*)", GUIDE)
    shown = re.findall(r"```text\n(.*?)```", GUIDE, re.DOTALL)
    assert len(given) == len(shown) == 2
    assert run(*shlex.split(given[0].partition(" --figure")[0])).startswith(shown[0])
    certified = run(*shlex.split(given[1]))
    assert shown[1] in certified
    assert "confirmed: slower to none, faster to backward slipping" in certified


def test_a_study_gives_speeds_clearances_friction_and_law(folder):
    document = json.loads(run("study.toml", "--json"))
    assert document["speed"] == pytest.approx([1000 * math.pi / 30, 2000 * math.pi / 30])
    assert document["clearance"] == pytest.approx([2e-4, 3e-4])
    assert {row["friction"] for row in document["whirls"]} == {0.25}
    hard = json.loads(
        run("pump.toml", "--speed", "1000 rpm", "--clearance", "0.2 mm", "--friction", "0.25", "--json")
    )
    first = min(hard["whirls"], key=lambda row: abs(row["frequency"]))
    soft = next(row for row in document["whirls"] if row["frequency"] == pytest.approx(first["frequency"]))
    assert soft["normal_force"] > first["normal_force"], "the spring of the contact lets the orbit grow"
    assert " At 0.25: " in document["answer"][0]
    assert " At 0.3: " in run("study.toml", "--friction", "0.3", "--speed", "1500 rpm")


def test_table_lists_whirls_with_their_stability(folder):
    lines = run("pump.toml", "--speed", "1000 rpm", "--clearance", "0.2 mm", "--friction", "0.3").splitlines()
    head = next(i for i, line in enumerate(lines) if line.split()[:2] == ["stator", "rpm"])
    assert lines[head + 1].split()[:3] == ["1", "1000.0", "200.0"]
    assert all("stable" in line or "grows by" in line for line in lines[head + 1 :])
    begins = run("pump.toml", "--clearance", "0.2 mm").splitlines()
    assert any("needs" in line.split() for line in begins)


def test_chart_and_data_are_written(folder):
    given = ["pump.toml", "--clearance", "0.2 mm", "--friction", "0.2", "--speed", "900 rpm"]
    run(*given, "--figure", "whirl.png", "--data", "whirl.nc")
    assert (folder / "whirl.png").stat().st_size > 10_000
    assert (folder / "whirl.nc").stat().st_size > 1_000


def test_what_is_missing_is_asked_for(folder):
    with pytest.raises(InputError, match="--clearance: missing"):
        run("pump.toml")
    with pytest.raises(InputError, match="--range: conflicts with --speed"):
        run("pump.toml", "--clearance", "1e-4", "--speed", "1", "--range", "1", "2")
    with pytest.raises(InputError, match="--certify: no friction is given"):
        run("pump.toml", "--clearance", "1e-4", "--certify")
    with pytest.raises(InputError, match=r"rig mokhtar2017: has no bore"):
        run("mokhtar2017", "--clearance", "1e-4")
