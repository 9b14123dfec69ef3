"""The ranges of a study's axes, in words."""

from pathlib import Path

from rubhpc.study.axis_ranges import axis_ranges
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study

STUDY = """
rig = "mokhtar2017"
[grid]
speed_ratio = [1.0, 2.0]
clearance = ["84 um", "10 m"]
friction = 0.3
"contact.normal" = ["fixed", "updated"]
"""


def test_speeds_are_in_rpm_and_clearances_are_lengths(tmp_path: Path):
    (tmp_path / "a.toml").write_text(STUDY)
    speed, *rest = axis_ranges(CaseGrid(read_study(tmp_path / "a.toml")))
    assert rest == ["clearance 84 um to 10 m", "friction 0.3", "contact.normal fixed, updated"]
    assert speed.startswith("speed_ratio 1 to 2: 1893.")
    assert speed.endswith(" rpm")


def test_clearance_ratios_are_also_lengths(tmp_path: Path):
    text = STUDY.replace('clearance = ["84 um", "10 m"]', "clearance_ratio = 0.5")
    (tmp_path / "a.toml").write_text(text.replace("[1.0, 2.0]", "2.0"))
    _, clearance, *_ = axis_ranges(CaseGrid(read_study(tmp_path / "a.toml")))
    assert clearance.startswith("clearance_ratio 0.5: ")
    assert clearance.endswith(" um")
