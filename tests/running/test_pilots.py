"""How many cases `rubhpc plan` times."""

from types import SimpleNamespace

import numpy as np
import pytest

from rubhpc.running import pilot_cases, pilots
from rubhpc.running.shorter_cases import parts
from rubhpc.study.drive_law import DriveLaw
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import Recording


@pytest.mark.parametrize(
    ("costs", "n_pilot"),
    [
        ([1.0] * 64, 6),  # they agree
        ([0.1] * 15 + [9.0] + [0.125] * 48, 29),  # a rub among free motions: 12 s are spent
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
    ("n_case", "left"), [(6, pilots._LEAST - 6 * 0.5), (180, 0.2 * 180 * 3.6 / 6 - 3.0), (10**5, 20.0)]
)
def test_dearest_case_is_run_whole(monkeypatch, n_case, left):
    """What a shortened one comes to is not known from its beginning: it is run whole, and then the others.

    All takes ten seconds at most, or a fifth of the time foreseen; another that is left takes what these say.
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
        (16, 0.5, (75, 150), (150 * (56 + 80) / 6 - 75, 80 / 56)),  # each part meets as many
        (16, 0.5, (75, 106), (106 * ((56 + 80) / 6) ** np.log2(106 / 75) - 75, 80 / 56)),
        (16, 1.5, (75, 106, 130), (130 * ((56 + 80) / 12) ** (np.log2(130 / 75) / 2) - 75, 80 / 56)),
        (16, 1.5, (75, 106, 107), (32.0, 0.0)),
        (
            16,
            99.0,
            (75, 95, 120, 150, 190),
            (190 * ((56 + 80) / 48) ** (np.log2(190 / 75) / 4) - 75, 80 / 56),
        ),
        (16, 0.5, (200, 202), (2.0, 0.0)),  # it comes back to what it has met
        (8, 0.5, (75, 150), (150 * 48 / 6 - 75, 0.0)),  # too short for its tangent to be carried on
    ],
    ids=["irregular", "less and less", "followed on", "at last regular", "nearly whole", "regular", "short"],
)
def test_contact_modes_of_an_irregular_motion_grow_by_a_power(revolutions, limit, met, expected, monkeypatch):
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
