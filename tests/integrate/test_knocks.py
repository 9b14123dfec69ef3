"""The least knock: the search against known edges, and a machine against every knock of a grid."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
from closed_form import simulate
from running import environment, write_knocks

from postproc.figures.resilience_curve import resilience
from rubhpc.errors import InputError
from rubhpc.knock_cases import LeastKnock, Progress, _Knocks
from rubhpc.knock_search import Direction, find_least
from rubhpc.knocks import least_knock
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study

RING = """
rig = "{rig}"
[grid]
speed_ratio = 1.22
clearance = "300 um"
friction = 0.0
[contact]
model = "mokhtar2017"
[record]
transient = "direct"
revolutions = 4
samples_per_revolution = 32
"""
ROOT = Path(__file__).parents[2]
ALL_ROUND = [Direction(2 * math.pi * i / 12, None) for i in range(12)]


def study_of(folder, speed="1.25", rest=""):
    return read_study(write_knocks(folder, speed, rest))


@pytest.mark.parametrize("least", [0.013, 0.4, 7.0])
def test_the_edge_and_the_worst_direction_are_found(least):
    def leads_to_rub(impulse, direction):
        return impulse > least * (1.5 + 0.5 * math.cos(direction.angle))

    found = find_least(leads_to_rub, ALL_ROUND, 0.01, 10.0, 0.001)
    assert found.direction.angle == pytest.approx(math.pi)
    assert found.impulse == pytest.approx(least, rel=0.001)
    assert found.harmless < least < found.impulse
    assert leads_to_rub(found.impulse, found.direction)


def test_no_edge_and_an_edge_below_the_first_impulse():
    none = find_least(lambda *_: False, ALL_ROUND, 0.1, 1.0, 0.01)
    assert math.isnan(none.impulse)
    assert none.harmless == 1.0
    assert none.direction is None
    below = find_least(lambda impulse, _: impulse > 0.003, ALL_ROUND, 0.1, 1.0, 0.01)
    assert below.impulse == pytest.approx(0.003, rel=0.01)


def test_a_range_that_ends_does_not_hide_the_next_edge():
    found = find_least(lambda impulse, _: 0.2 < impulse < 0.6 or impulse > 0.9, ALL_ROUND, 0.01, 5.0, 0.01)
    assert found.impulse == pytest.approx(0.2, rel=0.01)


def test_every_smaller_knock_of_a_grid_is_harmless(tmp_path):
    found = least_knock(study_of(tmp_path), angles=2, tolerance=0.05).squeeze()
    least, harmless = float(found.least_impulse), float(found.harmless_impulse)
    assert 0.95 * least < harmless < least

    def rubs(impulse, angle):
        record = simulate(
            "mokhtar2017",
            speed_ratio=1.25,
            clearance="300 um",
            friction=0.1,
            overrides={"stator.youngs_modulus": "30 GPa"},
            transient="auto",
            revolutions=16,
            samples_per_revolution=64,
            keep=(),
            initial={"from": "contact_free", "impulse": impulse, "impulse_angle": angle},
        )
        return bool(record.measures["contact_fraction"][0])

    assert rubs(least, float(found.worst_angle))
    grid = [(share * harmless, angle) for share in np.linspace(0.1, 1.0, 6) for angle in (0.0, math.pi)]
    assert not any(rubs(*at) for at in grid)


def test_a_knock_elsewhere_on_a_rotor_in_a_ring(tmp_path):
    """Eight stators, knocked beside the disc: the harmless knock dies out in the long run, the least not."""
    path = tmp_path / "ring.toml"
    path.write_text(RING.format(rig=ROOT / "jobs" / "branches" / "rigs" / "ring_of_springs.toml"))
    study = read_study(path)
    found = least_knock(study, angles=1, nodes=[4], tolerance=0.2).squeeze()
    least, harmless = float(found.least_impulse), float(found.harmless_impulse)
    assert 0.799 * least < harmless < least
    assert int(found.worst_node) == 4
    settled = replace(study, recording=replace(study.recording, transient=80))
    knock = _Knocks(settled, CaseGrid(settled).case((0, 0, 0)), (4,))
    rubs = [knock(impulse, Direction(0.0, 4)) for impulse in (harmless, least)]
    assert rubs == [False, True]


def test_a_machine_without_a_contact_free_motion_and_its_figure(tmp_path):
    found = least_knock(study_of(tmp_path, "[1.1, 1.25]"), angles=1, tolerance=0.2)
    assert found.has_contact_free_motion.values.ravel().tolist() == [False, True]
    assert np.isnan(found.least_impulse.values.ravel()[0])
    drawing = resilience(found)
    assert drawing.panels == (1, 1)  # one direction needs no panel
    assert "at speed_ratio=1.25, 0 degrees" in drawing.lines[0]
    assert drawing.save(tmp_path / "curve.png").exists()


def test_results_are_kept_and_a_torn_line_is_none(tmp_path):
    path = tmp_path / "progress"
    one, two = LeastKnock(least_impulse=0.1 + 1e-17, knocks=7, has_contact_free_motion=True), LeastKnock()
    Progress(path).enter("a", one)
    Progress(path).enter("b", two)
    with path.open("a") as file:
        file.write('{"key": "c", "least_imp')
    again = Progress(path)
    assert list(again.found) == ["a", "b"]
    assert repr(again.found["a"]) == repr(one)
    assert math.isnan(again.found["b"].least_impulse)
    again.enter("c", one)
    assert list(Progress(path).found) == ["a", "b", "c"]


def test_an_interrupted_search_goes_on(tmp_path):
    """Cases that are done are not computed again, and the result is that of one go."""
    study = study_of(tmp_path, "[1.0, 1.05, 1.1]", "")  # without contact-free motion: one knock each
    options = {"angles": 1, "tolerance": 0.2}
    done: list[int] = []

    def stop_after_one(n_done, _):
        done.append(n_done)
        if n_done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        least_knock(study, **options, progress=tmp_path / "kept", report=stop_after_one)
    done.clear()
    found = least_knock(study, **options, progress=tmp_path / "kept", report=lambda n, _: done.append(n))
    assert done == [1, 2, 3]
    assert found.identical(least_knock(study, **options))
    least_knock(
        study, angles=2, tolerance=0.2, progress=tmp_path / "kept", report=lambda n, _: done.append(n)
    )
    assert done[3:] == [0, 1, 2, 3]  # another search


def test_processes_change_nothing(tmp_path):
    study = study_of(tmp_path, "[1.05, 1.1]")
    alone = least_knock(study, angles=1)
    assert least_knock(study, angles=1, workers=2, progress=tmp_path / "kept").identical(alone)
    assert len(Progress(tmp_path / "kept").found) == 2


SEARCH = """
import sys
from pathlib import Path
from rubhpc.knocks import least_knock
from rubhpc.study.study import read_study

study = read_study(Path(sys.argv[1]))
least_knock(study, angles=1, workers=2, report=lambda n, _: print(n, flush=True))
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_processes_end_with_the_first(tmp_path, number):
    study = write_knocks(tmp_path, "{ start = 1.05, stop = 1.25, num = 30 }")
    (tmp_path / "search.py").write_text(SEARCH)
    asked = [sys.executable, str(tmp_path / "search.py"), str(study)]
    with subprocess.Popen(
        asked, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        while int(process.stdout.readline()) < 1:
            pass
        others = psutil.Process(process.pid).children()
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    assert others
    assert not psutil.wait_procs(others, timeout=20)[1]
    assert (process.returncode, err) == (-number, "")


def test_what_cannot_be_is_refused(tmp_path):
    study = study_of(tmp_path, rest='"initial.impulse" = [0.0, 0.1]')
    with pytest.raises(InputError, match="the knock itself is searched for"):
        least_knock(study)
    followed = study_of(tmp_path, "{ start = 1.2, stop = 1.3 }", '[branch]\nalong = "speed_ratio"')
    with pytest.raises(InputError, match=r"\[branch\]: knocks are searched for at a constant speed"):
        least_knock(followed)
    with pytest.raises(InputError, match="99 does not move sideways"):
        least_knock(study_of(tmp_path), nodes=[99])
    with pytest.raises(InputError, match="workers: 0 is out of range"):
        least_knock(study_of(tmp_path), workers=0)
    with pytest.raises(InputError, match="give numbers above 0"):
        least_knock(study_of(tmp_path), angles=0)
