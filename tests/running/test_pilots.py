"""How many cases `rubhpc plan` times."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rubhpc.running import pilot_cases, pilots
from rubhpc.running.plan import Plan
from rubhpc.running.shorter_cases import parts
from rubhpc.study.drive_law import DriveLaw
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import Recording


@pytest.mark.parametrize(
    ("costs", "n_pilot"),
    [
        ([1.0] * 64, 6),  # they agree
        ([0.1] * 15 + [9.0] + [0.125] * 48, 53),  # a rub among free motions: 15 s are spent
        ([0.01] * 64, 64),
    ],
    ids=["equal", "one differs", "short"],
)
def test_more_cases_are_timed_where_they_differ(costs, n_pilot, monkeypatch):
    now = [0.0]

    class Pilots:
        loading = compiling = 0.0
        was_cut, arrays, shortened = False, {}, frozenset()
        irregular = frozenset()

        def __init__(self, grid):
            pass

        def pace(self, index, steps, limit):
            now[0] += costs[index[0]]
            return pilots.Pace(costs[index[0]] / steps, 0.0, 0.0, 0.0)

    monkeypatch.setattr(pilots, "Pilots", Pilots)
    monkeypatch.setattr(pilots, "_picked", lambda *_: (((i,), 1e3, 1e-3) for i in range(64)))
    monkeypatch.setattr(pilots, "time", SimpleNamespace(process_time=lambda: now[0]))
    grid = SimpleNamespace(study=SimpleNamespace(branch=None))
    monkeypatch.setattr(pilots, "share_of", lambda *_: np.ones(1000))
    block = SimpleNamespace(cost=1e6)
    timing = pilots.time_pilots(grid, None, [block], np.ones(1000, dtype=bool))
    assert timing.n_pilot == n_pilot
    assert timing.pace.step == pytest.approx(np.mean(costs[:n_pilot]) / 1e3)


def test_parts_of_a_run_up_spread_over_its_speeds():
    """Its cost is that of the pieces it is cut into, which depend on the speed."""
    law = SpeedLaw(time=(0.0, 4.0, 10.0), speed=(50.0, 300.0, 100.0))
    found = parts(law, 64)
    assert [part.n_revolution for part in found] == [16] * 4
    speeds = [part.speed[0] for part in found]
    turns = [round((k + 0.5) / 4 * (law.n_revolution - 16)) for k in range(4)]
    assert speeds == pytest.approx(law.at_angle(2 * np.pi * np.array(turns))[1])
    assert max(len(part.speed) for part in found) == 3  # the bend lies in one of them
    assert parts(law, law.n_revolution) == [law]


def test_part_of_a_drive_is_its_beginning():
    law = DriveLaw(torque=(1.0,), start=100.0, n_revolution=400, lowest=1.0)
    assert [part.n_revolution for part in parts(law, 64)] == [64]


@pytest.mark.parametrize(
    ("n_case", "left"), [(6, pilots._LEAST - 6 * 0.5), (180, 0.25 * 180 * 3.6 / 6 - 3.0), (10**5, 30.0)]
)
def test_dearest_case_is_run_whole(monkeypatch, n_case, left):
    """What a shortened one comes to is not known from its beginning: it is run whole, and then the others.

    All takes 15 s at most, or a quarter of the time foreseen; another that is left takes what these say.
    """
    now, asked = [0.0], []

    class Pilots:
        loading = compiling = 0.0
        was_cut, arrays, shortened = False, {}, {(0,), (1,), (2,)}
        irregular = frozenset()

        def __init__(self, grid):
            pass

        def pace(self, index, steps, limit):
            now[0] += 0.5
            return pilots.Pace(([3.0, 0.2] + 4 * [0.1])[index[0]] / steps, 0.0, 0.0, 0.0)

        def whole(self, index, steps, guessed, limit):
            asked.append((index, limit))
            now[0] += limit - 0.15  # no time is left for the third
            return guessed._replace(step=3.0 * guessed.step)

    monkeypatch.setattr(pilots, "Pilots", Pilots)
    monkeypatch.setattr(pilots, "_picked", lambda *_: (((i,), 1e3, 1 / n_case) for i in range(6)))
    monkeypatch.setattr(pilots, "time", SimpleNamespace(process_time=lambda: now[0]))
    grid = SimpleNamespace(study=SimpleNamespace(branch=None))
    monkeypatch.setattr(pilots, "share_of", lambda *_: np.ones(n_case))
    monkeypatch.setattr(pilots, "time_block", lambda *_: 0.0)
    block = SimpleNamespace(cost=n_case * 1e3)
    timing = pilots.time_pilots(grid, None, [block], np.ones(n_case, dtype=bool))
    assert [index for index, _ in asked] == [(0,), (2,)]  # 0.2 s are more than is left
    assert asked[0][1] == pytest.approx(left)
    known = 3 * 3.0 + 3 * 0.1 + 3 * 0.1
    other = 0.2 * (known - 0.3 + 3.1 / 2) / (3.1 + 3.1 / 2)  # ratio of the two, and one of 1
    assert timing.pace.step * 6e3 == pytest.approx(known + other)


@pytest.mark.parametrize(
    ("revolutions", "limit", "met", "expected"),
    [
        (16, 0.5, (75, 150), (75 + 75 * (1 - 6 / (56 + 64)), 64 / 56)),  # each part meets as many
        (16, 0.5, (75, 106), (31 + 31 * (1 - 6 / (56 + 64)), 64 / 56)),
        (16, 1.5, (75, 106, 130), (55 + 24 * (1 - 12 / (56 + 64)), 64 / 56)),
        (16, 1.5, (75, 106, 107), (32.0, 0.0)),
        (16, 99.0, (75, 95, 120, 150, 190), (115 + 40 * (1 - 48 / (56 + 64)), 64 / 56)),
        (16, 0.5, (200, 202), (2.0, 0.0)),  # it comes back to what it has met
        (8, 0.5, (75, 150), (75 + 75 * (1 - 6 / 48), 0.0)),  # too short for its tangent to be carried on
        (64, 0.5, (75, 150), (75 + 75 * (1 - 6 / (104 + 16)), 16 / 104)),  # 12 of 16 spans are in the record
    ],
    ids=[
        "irregular",
        "less and less",
        "followed on",
        "at last regular",
        "nearly whole",
        "regular",
        "short",
        "long",
    ],
)
def test_each_doubling_of_an_irregular_motion_meets_half_as_many_new_modes(
    revolutions, limit, met, expected, monkeypatch
):
    """With those of its tangent; three revolutions were run, then as many again, and again, a second each."""
    recording = Recording(transient=40, revolutions=revolutions, samples_per_revolution=16)
    found = pilot_cases.Pilots(SimpleNamespace(study=SimpleNamespace(recording=recording)))
    found._final = SimpleNamespace()
    counts = iter(met)
    monkeypatch.setattr(pilot_cases, "_n_solved", lambda *_: next(counts))
    ran = []

    def run(_case, _setup, part, initial):
        ran.append((part.longest_transient, initial))
        return 1.0

    monkeypatch.setattr(found, "_run", run)
    share = 3 / (40 + revolutions)
    assert found._to_come(SimpleNamespace(index=(3,)), None, share, limit) == pytest.approx(expected)
    assert found.irregular == ({(3,)} if met[-1] > 1.01 * met[-2] else set())
    parts = [share * 2**k for k in range(len(met) - 1)]
    assert ran == [(round(40 * part), found._final) for part in parts]


def ring_pilots(monkeypatch, times, other=None):
    """Pilots of a ring whose beginning took 2 s for 40 modes; 20 more are met by the rest, if it is run."""
    found = pilot_cases.Pilots(SimpleNamespace(study=SimpleNamespace(recording=None)))
    solved, left = [40], iter(times)
    monkeypatch.setattr(pilot_cases, "_is_ring", lambda _: True)
    monkeypatch.setattr(pilot_cases, "_n_solved", lambda *_: solved[0])
    monkeypatch.setattr(found, "_runs", lambda *_: (2.0, [(0.05, 0.03)]))
    monkeypatch.setattr(found, "_alike", lambda _: other)

    def to_come(*_):
        solved[0] = 60
        return 20.0, 0.0

    def run(case, setup, recording, most):
        taken = next(left)
        if taken > most:
            raise pilot_cases._Enough
        return taken

    monkeypatch.setattr(found, "_to_come", to_come)
    monkeypatch.setattr(found, "_run", run)
    return found._modes_and_rest(SimpleNamespace(index=(0,)), None, 1e4, 2.0)


def test_a_whole_case_takes_what_its_modes_took_before(monkeypatch):
    """It is run with those solved that its parts met, at 2 s for 40 of them."""
    modes, whole, is_whole = ring_pilots(monkeypatch, [1.5])
    assert (modes, whole, is_whole) == (0.0, pytest.approx(60 * 2.0 / 40 + 1.5), True)


def test_a_whole_case_that_is_cut_off_takes_at_least_as_long(monkeypatch):
    modes, whole, is_whole = ring_pilots(monkeypatch, [100.0])
    assert (modes, whole, is_whole) == (0.0, pytest.approx(60 * 2.0 / 40 + 3.0 * 2.0), False)


def test_what_a_case_took_is_not_forgotten_where_another_is_cut_off(monkeypatch):
    """The other is taken to last as long as it did."""
    modes, whole, is_whole = ring_pilots(monkeypatch, [1.5, 100.0], SimpleNamespace(index=(1,)))
    assert (modes, whole, is_whole) == (0.0, pytest.approx(0.5 * (4.5 + 6.0)), False)


@pytest.mark.parametrize(("n_pilot", "share"), [(3, "two plans in three"), (4, "eight to nine plans in ten")])
def test_plan_of_few_cases_claims_less(n_pilot, share):
    timing = pilots.Timing(pace=pilots.Pace(1.0, 0.0, 0.0, 0.0), n_pilot=n_pilot, spread=0.3)
    plan = Plan(
        title="",
        store=Path("x.zarr"),
        shape={"speed": 9},
        counts=(9, 0, 0, 0, 0),
        n_sequence=9,
        n_block=9,
        n_per_block=1,
        n_file=1,
        n_file_running=1,
        n_byte=1,
        steps=9,
        core_hours=1.0,
        timing=timing,
    )
    they = "are few and differ" if n_pilot == 3 else "differ"
    assert f"cases; they {they}: such a range holds the time of {share}" in plan.text()
