"""How many cases `rubhpc plan` times, and which of them it finishes."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rubhpc.running import block_time, pilot_cases, pilots, plan
from rubhpc.running.kept_setups import MOST_BYTES
from rubhpc.running.memory import peak_memory
from rubhpc.running.pilot_estimate import Sample
from rubhpc.running.plan import Plan
from rubhpc.running.timed_run_ups import parts
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.study.cases import CaseGrid
from rubhpc.study.drive_law import DriveLaw
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import read_study
from tests.support.running import write_study


class NothingYet:
    """Pilots before any case was timed."""

    loading = compiling = 0.0
    was_cut, arrays, alike, shortened = False, {}, {}, {}
    irregular, modes, memory = frozenset(), {}, 0.0

    def __init__(self, grid):
        pass


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

    class Pilots(NothingYet):
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


class Shortened:
    """Cases that were left after some seconds: what parts of them take, and what is predicted in between."""

    loading = compiling = 0.0
    was_cut, arrays, alike = False, {}, {}
    irregular, modes, memory = frozenset(), {}, 0.0

    def __init__(self, parts, forecasts, now):
        self.parts, self.forecasts, self.now = parts, forecasts, now
        self.shortened, self.ended, self.asked = dict(forecasts), set(), []
        self._at = dict.fromkeys(forecasts, 0)

    def spent(self, index):
        return sum(self.parts[index][: self._at[index] + 1])

    def predicted(self, index):
        return self.forecasts[index][self._at[index]]

    def first(self, index):
        return self.parts[index][0], self.forecasts[index][0] - self.parts[index][0]

    def left(self, index):
        return self.predicted(index) - self.spent(index)

    def seconds_of_next(self, index):
        return self.parts[index][self._at[index] + 1]

    def go_on(self, index, limit):
        self.asked.append((index[0], limit))
        self._at[index] += 1
        taken = self.parts[index][self._at[index]]
        self.now[0] += taken
        if self._at[index] == len(self.parts[index]) - 1:
            self.ended.add(index)
        return taken <= limit


def gone_on(monkeypatch, parts, forecasts, seconds):
    """Which cases go on, with what limits, and the sample after that."""
    now = [0.0]
    found = Shortened(parts, forecasts, now)
    monkeypatch.setattr(pilots, "time", SimpleNamespace(process_time=lambda: now[0]))
    sample = Sample(len(parts), 1e3 * len(parts))
    for index in parts:
        sample.add(1e3, 1 / len(parts), found.predicted(index), is_whole=False, spent=found.spent(index))
    pilots._finish(found, list(parts), sample, seconds)
    return found, sample


def test_the_case_of_which_most_is_to_come_goes_on(monkeypatch):
    """What it comes to is not known from its beginning; then it may be another one."""
    parts = {(0,): [1.0, 1.0, 1.0], (1,): [1.0, 2.0, 4.0], (2,): [0.5, 0.5, 0.25]}
    forecasts = {(0,): [9.0, 3.5, 3.0], (1,): [5.0, 8.0, 7.0], (2,): [1.0, 1.25, 1.25]}
    found, sample = gone_on(monkeypatch, parts, forecasts, 100.0)
    assert [k for k, _ in found.asked] == [0, 1, 1, 0, 2, 2]
    assert sample.seconds == [3.0, 7.0, 1.25]
    assert sample.is_whole == [True] * 3
    assert sample.checked == [(8.0, 2.0), (4.0, 6.0), (0.5, 0.75)]


def test_no_part_begins_that_has_no_room(monkeypatch):
    """It may take all that is left; others that are shorter go on."""
    parts = {(0,): [1.0, 2.0, 7.0], (1,): [1.0, 2.5, 1.0]}
    forecasts = {(0,): [9.0, 10.0, 10.0], (1,): [3.5, 4.5, 4.5]}
    found, sample = gone_on(monkeypatch, parts, forecasts, 5.0)
    assert found.asked == [(0, 5.0), (1, 3.0)]
    assert sample.seconds == [10.0, 4.5]
    assert sample.spent == [3.0, 3.5]
    assert sample.is_whole == [False, False]
    assert sample.known == 6.5


def test_all_cases_of_a_small_study_are_begun(monkeypatch):
    """A whip among ten cases takes half of the time of a study, and nobody knows which it is."""
    asked = []

    class Pilots(NothingYet):
        def pace(self, index, steps, limit):
            asked.append(limit)
            return pilots.Pace(0.6 / steps, 0.0, 0.0, 0.0)

    monkeypatch.setattr(pilots, "Pilots", Pilots)
    monkeypatch.setattr(pilots, "_picked", lambda *_: (((i,), 1e3, 0.1) for i in range(10)))
    monkeypatch.setattr(pilots, "time", SimpleNamespace(process_time=lambda: 0.6 * len(asked)))
    monkeypatch.setattr(pilots, "share_of", lambda *_: np.ones(10))
    grid = SimpleNamespace(study=SimpleNamespace(branch=None))
    timing = pilots.time_pilots(grid, None, [SimpleNamespace(cost=1e4)], np.ones(10, dtype=bool))
    assert (timing.n_pilot, timing.spread) == (10, 0.0)
    assert asked[0] == pilots._LEAST / 10  # each may take its share of what is left
    assert asked[5] == (pilots._LEAST - 5 * 0.6) / 5


def test_cases_of_a_ring_are_timed_in_pairs(monkeypatch):
    """The one that was run for the contact modes that both share counts as well, and is not run again."""
    asked = []

    class Pilots:
        loading = compiling = 0.0
        was_cut, arrays, shortened = False, {}, {}
        irregular, modes, memory = frozenset(), {}, 0.0

        def __init__(self, grid):
            self.alike = {(0,): (1,), (2,): (3,)}

        def pace(self, index, steps, limit):
            asked.append(index)
            return pilots.Pace((1.0 + index[0]) / steps, 0.0, 0.0, 0.0)

    monkeypatch.setattr(pilots, "Pilots", Pilots)
    monkeypatch.setattr(pilots, "_picked", lambda *_: (((i,), 1e3, 1 / 4) for i in range(4)))
    monkeypatch.setattr(pilots, "share_of", lambda *_: np.ones(4))
    grid = SimpleNamespace(study=SimpleNamespace(branch=None))
    timing = pilots.time_pilots(grid, None, [SimpleNamespace(cost=4e3)], np.ones(4, dtype=bool))
    assert asked == [(0,), (1,), (2,), (3,)]
    assert (timing.n_pilot, timing.spread) == (4, 0.0)
    assert timing.pace.step * 4e3 == pytest.approx(1 + 2 + 3 + 4)


@pytest.mark.parametrize(("n_pilot", "share"), [(3, "two plans in three"), (4, "eight to nine plans in ten")])
def test_plan_of_few_cases_claims_less(n_pilot, share):
    timing = pilots.Timing(pace=pilots.Pace(1.0, 0.0, 0.0, 0.0), n_pilot=n_pilot, spread=0.3)
    found = Plan(
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
    assert f"cases; they {they}: such a range contains the time in {share}" in found.text()


def test_a_block_is_timed_with_its_folders(tmp_path, monkeypatch):
    """Files of a small store lie in folders of their own, which take longer to make than the files."""
    grid = CaseGrid(read_study(write_study(tmp_path)))
    manifest = manifest_of(grid)
    written, flushed = [], []

    def write_whole(path, data, *, is_synced):
        written.append(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)

    monkeypatch.setattr(block_time, "write_whole", write_whole)
    monkeypatch.setattr(block_time, "flush_to_disk", flushed.append)
    assert block_time.time_block(manifest, {}) > 0.0
    assert written == flushed
    assert len({path.parent for path in written}) == len(written)  # each in a new one


def test_memory_holds_other_set_ups_of_a_ring(tmp_path, monkeypatch):
    """Contact modes of the longest case and of other set-ups and frictions, up to a bound."""
    study = read_study(write_study(tmp_path))  # two speeds, three frictions

    def memory(*modes):
        pace = pilots.Pace(1.0, 0.0, 0.0, 0.0)
        found = pilots.Timing(pace=pace, n_pilot=2, modes=modes, memory=3e8)
        monkeypatch.setattr(plan, "time_pilots", lambda *_: found)
        return plan.make_plan(study).memory

    none = memory(0.0)
    assert none == pytest.approx(3e8, rel=1e-3)
    assert memory(1e6, 3e6) - none == pytest.approx(plan._ROOM * (3e6 + 5 * 2e6))
    assert memory(1e9) - none == pytest.approx(plan._ROOM * (1e9 + MOST_BYTES))


def test_peak_memory_is_that_of_this_process():
    held = np.ones(20_000_000)
    assert held.nbytes < peak_memory() < 1e12


def test_shortened_cases_of_a_ring_are_kept_while_memory_lasts(monkeypatch):
    """The longest in any case, those that share its set-up, and others whose contact modes find room."""
    study = SimpleNamespace(recording=None)
    found = pilot_cases.Pilots(SimpleNamespace(study=study))
    sizes = {"a": 3 * MOST_BYTES // 4, "b": MOST_BYTES // 2, "c": MOST_BYTES // 8, "large": 4 * MOST_BYTES}
    cases = [("large", 9.0), ("a", 8.0), ("a", 5.0), ("b", 4.0), ("c", 1.0)]

    def kept(cases):
        setups = {name: SimpleNamespace(name=name) for name in sizes}
        found._kept = {(k,): SimpleNamespace(setup=setups[name]) for k, (name, _) in enumerate(cases)}
        monkeypatch.setattr(found, "predicted", lambda index: cases[index[0]][1])
        return [found._kept[index].setup.name for index in found._affordable()]

    monkeypatch.setattr(pilot_cases, "free_memory", lambda: 0.0)
    monkeypatch.setattr(pilot_cases, "bytes_of_modes", lambda setup: sizes[setup.name])
    assert kept(cases) == ["large"]
    assert kept(cases[1:]) == ["a", "a", "c"]
    monkeypatch.setattr(pilot_cases, "free_memory", lambda: 2 * MOST_BYTES / pilot_cases._OF_FREE)
    assert kept(cases[1:]) == ["a", "a", "b", "c"]
    assert pilot_cases._MOST_KEPT >= 2 * MOST_BYTES
