"""How `rubhpc plan` samples cases, cuts them, and what it predicts from them."""

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest

from rubhpc.running import plan, sampled_cases
from rubhpc.running.case_setup import MOST_BYTES, Preparations
from rubhpc.running.plan import make_plan
from rubhpc.running.plan_estimate import Timed, estimate
from rubhpc.running.sampled_cases import CaseTimer, Sample, Trail, memory, part_of, peak_memory, spread
from rubhpc.schema import FAILED
from rubhpc.storage.duration import span
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.study.cases import CaseGrid
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import read_study
from tests.support.running import write_study


def timed(steps, spent, **more):
    return Timed(**{"steps": steps, "spent": spent, "is_whole": True} | more)


def test_all_cases_timed_leave_no_error():
    cases = [timed(1.0, 3.0), timed(2.0, 1.0), timed(5.0, 0.5)]
    assert estimate(cases, 3, 8.0) == pytest.approx((4.5, 4.5, 4.5))


def test_times_proportional_to_steps_are_predicted_from_three():
    cases = [timed(steps, 2.0 * steps) for steps in (1.0, 2.0, 4.0)]
    assert estimate(cases, 40, 100.0).seconds == pytest.approx(200.0)
    assert estimate(cases, 40, 100.0) == pytest.approx((200.0, 200.0, 200.0), rel=0.22)  # of the machine


def test_range_holds_the_time_of_most_plans():
    """Cases whose times are spread as those of a ring: some take ten times as long as the middle one."""
    rng = np.random.default_rng(1)
    steps = rng.uniform(1.0, 3.0, 200)
    seconds = np.exp(rng.normal(0.0, 1.0, 200))
    held, middle = 0, []
    for _ in range(300):
        chosen = rng.choice(200, 12, replace=False)
        found = estimate([timed(steps[i], seconds[i]) for i in chosen], 200, steps.sum())
        held += found.least < seconds.sum() < found.most
        middle.append(found.seconds / seconds.sum())
    assert 0.85 < held / 300 < 0.97
    assert np.mean(middle) == pytest.approx(1.0, abs=0.05)


def test_one_case_of_many_gives_a_wide_range():
    found = estimate([timed(1.0, 2.0)], 10, 10.0)
    assert found.seconds == pytest.approx(20.0)
    assert found.seconds / found.least == pytest.approx(2.5)
    assert found.most / found.seconds == pytest.approx(2.5**1.3)


def test_a_cut_case_widens_the_range():
    """It holds the case whose rest takes least, and the one whose rest takes most."""
    cut = timed(1.0, 2.0, is_whole=False, share=0.1, rest=18.0, least=6.0, most=54.0)
    found = estimate([cut], 1, 1.0)
    assert found == pytest.approx((20.0, 8.0, 56.0))
    unknown = timed(1.0, 2.0, is_whole=False, share=0.0, most=math.inf)
    assert estimate([unknown], 1, 1.0).most == math.inf
    assert estimate([unknown, cut], 2, 2.0).most < math.inf
    assert all(math.isnan(value) for value in estimate([], 1, 1.0))


@pytest.mark.parametrize("shape", [(7,), (40, 4), (10, 10, 10)])
def test_sampled_cases_spread_over_all_axes(shape):
    found = list(spread(np.ones(shape, bool), 64))
    assert len(found) == len(set(found)) == min(64, math.prod(shape))
    for axis, n in enumerate(shape):
        seen = np.bincount([index[axis] for index in found], minlength=n)
        assert len(found) // n // 2 <= seen.min() <= seen.max() <= len(found) // n + 3


def test_only_missing_cases_are_sampled():
    missing = np.zeros((4, 30, 3), bool)
    missing[-1, ::5, 0] = True
    assert sorted(spread(missing, 64)) == [tuple(index) for index in np.argwhere(missing).tolist()]


def test_part_of_a_run_up_has_its_speeds():
    law = SpeedLaw(time=(0.0, 4.0, 10.0), speed=(50.0, 300.0, 100.0))
    part = part_of(law, 100, 116)
    assert part.n_revolution == 16
    assert part.speed[0] == pytest.approx(law.at_angle(2 * np.pi * np.array([100.0]))[1][0])


def test_a_long_run_up_is_known_by_parts_of_it(tmp_path, monkeypatch):
    """Rub begins in the middle of a run-up: its first revolutions would say nothing."""
    physics = Physics(monkeypatch, lambda case: 10.0 * (case.speed_law.speed[0] > 150.0))
    run_up = "[run_up]\nstart = 100.0\nstop = 200.0\n"
    grid = '[grid]\n"run_up.time" = [10.0, 11.0]\nclearance = [1e-4, 2e-4]\nfriction = 0.1\n'
    (tmp_path / "up.toml").write_text(f'rig = "mokhtar2017"\n{run_up}{grid}')
    sample, _ = physics.plan(read_study(tmp_path / "up.toml"), 100.0)
    found = estimate(sample.cases, 4, 4.0)
    assert [case.is_whole for case in sample.cases].count(True) < 4
    assert found.least < 4 * 0.5 * 80.0 < found.most


class Physics:
    """Cases of so many seconds a revolution on a clock of their own, in place of integration."""

    def __init__(self, monkeypatch, seconds):
        self.now, self.ran, self.held = 1000.0, [], 0.0
        clock = SimpleNamespace(monotonic=lambda: self.now, process_time=lambda: self.now)
        monkeypatch.setattr(sampled_cases, "time", clock)
        monkeypatch.setattr(sampled_cases, "memory", lambda: self.held)
        monkeypatch.setattr(CaseTimer, "_load_kernels", lambda *_: None)
        monkeypatch.setattr(sampled_cases, "record_of", self._run)
        self._seconds = seconds

    def _run(self, grid, case, setups, state, check, note):
        self.ran.append(case.index)
        n = 100
        for k in range(n):
            note(k / n)
            check()
            self.now += self._seconds(case) / n
        return SimpleNamespace()

    def plan(self, study, seconds=10.0):
        grid = CaseGrid(study)
        timer = CaseTimer(grid, self.now + seconds)
        began = self.now
        sample = timer.time_cases(np.ones(grid.shape, bool), lambda _: 1.0, lambda _: None)
        return sample, self.now - began


@pytest.fixture
def study(tmp_path):
    speeds = [0.9 + 0.1 * i for i in range(40)]
    return read_study(write_study(tmp_path, speed_ratio=speeds))


@pytest.mark.parametrize(("seconds", "n_case"), [(1.0, 6), (0.01, 200)])
def test_few_cases_are_timed_where_they_agree(study, monkeypatch, seconds, n_case):
    sample, _ = Physics(monkeypatch, lambda case: seconds).plan(study)
    assert len(sample.cases) == n_case
    assert all(case.is_whole for case in sample.cases)


def test_more_cases_are_timed_where_they_differ(study, monkeypatch):
    """A few cases rub and take most of the time."""
    sample, taken = Physics(monkeypatch, lambda case: 0.05 + (case.index[0] % 5 == 0)).plan(study)
    assert len(sample.cases) > 6
    assert taken <= 10.5


def test_long_cases_are_cut_and_extrapolated(study, monkeypatch):
    """Their time is known by how far they came, and the plan ends when it should."""
    sample, taken = Physics(monkeypatch, lambda case: 600.0).plan(study)
    assert taken < 10.0 + 6.0 + 1.0  # a check is 6 s apart here
    assert not any(case.is_whole for case in sample.cases)
    found = estimate(sample.cases, 240, 240.0)
    assert found.least < 240 * 600.0 < found.most
    assert found.seconds == pytest.approx(240 * 600.0, rel=0.5)


def test_a_case_is_cut_for_its_memory(study, monkeypatch):
    physics = Physics(monkeypatch, lambda case: 1.0)
    physics.held = 2 * sampled_cases.MOST_BYTES
    sample, taken = physics.plan(study)
    assert sample.was_full
    assert taken < 0.1


def test_a_set_up_without_checks_is_cut(study, monkeypatch):
    """An alarm ends what does not ask whether there is time."""

    def hang(*_: object) -> None:
        time.sleep(60.0)

    monkeypatch.setattr(sampled_cases.KeptSetups, "of", hang)
    monkeypatch.setattr(CaseTimer, "_load_kernels", lambda *_: None)
    grid, began = CaseGrid(study), time.monotonic()
    timer = CaseTimer(grid, began + 2.0)  # s, time enough to begin a case on a loaded machine
    sample = timer.time_cases(np.ones(grid.shape, bool), lambda _: 1.0, lambda _: None)
    assert time.monotonic() - began < 10.0
    assert [case.share for case in sample.cases] == [0.0]


def trail_of(study, monkeypatch, rows):
    """A trail of a case whose times, revolutions and contact modes are known."""
    case = CaseGrid(study).case((0, 0, 0))
    monkeypatch.setattr(sampled_cases, "n_followed", lambda: 0)
    made = Trail(study, case)
    made.rows = rows
    monkeypatch.setattr(made, "enter", lambda: None)
    return made


def test_the_rest_takes_as_long_as_the_last_half(tmp_path, monkeypatch):
    """The revolutions before the first contact are the cheapest."""
    study = read_study(write_study(tmp_path, transient=60, revolutions=4))
    rows = [(0.0, 0.0, 0), (0.1, 8.0, 0), (1.7, 16.0, 0)]
    found = trail_of(study, monkeypatch, rows).timed(1.0, is_whole=False)
    assert (found.spent, found.share) == (1.7, 0.25)
    assert found.rest == pytest.approx(48 * 0.2)
    assert found.least < found.rest < found.most


def test_contact_modes_grow_with_the_logarithm_of_the_revolutions(tmp_path, monkeypatch):
    """The last doubling met 20, and two more are to come; a revolution takes 0.1 s, a mode 0.05 s."""
    study = read_study(write_study(tmp_path, transient=60, revolutions=4))
    rows = [(0.1 * r + 0.05 * m, float(r), m) for r, m in ((0, 0), (2, 10), (4, 30), (8, 40), (16, 60))]
    found = trail_of(study, monkeypatch, rows).timed(1.0, is_whole=False)
    assert found.rest == pytest.approx(48 * 0.1 + 2 * 20 * 0.05)
    assert found.modes == pytest.approx(0.05 * 100 / (found.spent + found.rest))


def test_plan_says_what_was_cut_and_what_takes_most(tmp_path, monkeypatch):
    cut = {"is_whole": False, "rest": 900.0, "least": 300.0, "most": 2700.0, "transient": 0.9}
    cases = [timed(1.0, 100.0, share=share, **cut) for share in (0.1, 0.2)]
    monkeypatch.setattr(CaseTimer, "time_cases", lambda *_: Sample(cases=cases))
    text = make_plan(read_study(write_study(tmp_path, transient=90))).text()
    assert (
        "timed       2 cases; 2 cut for time at 10 % to 20 % of it, the rest extrapolated; they are few"
        in text
    )
    assert "mostly      the transient, 90 revolutions (90 % of the time)" in text


def test_memory_holds_other_set_ups_of_a_ring(monkeypatch):
    """Contact modes of the longest case and of other set-ups and frictions, up to a bound."""
    monkeypatch.setattr(plan, "peak_memory", lambda: 1e6)

    def found(*modes):
        cases = [timed(1.0, 1.0, n_byte=n_byte) for n_byte in modes]
        return plan._memory(Sample(cases=cases, memory=3e8), Preparations(2, 6)) - 3e8

    assert found(1e6, 3e6) == pytest.approx(plan._ROOM * (3e6 + 5 * 2e6))
    assert found(1e9) == pytest.approx(plan._ROOM * (1e9 + MOST_BYTES))


def test_memory_is_that_of_this_process():
    held = np.ones(20_000_000)
    assert held.nbytes < memory() <= 1.01 * peak_memory() < 1e12


@pytest.mark.parametrize(
    ("least", "most", "text"),
    [(30.0, 52.0, "30 to 52 s"), (720.0, 1800.0, "12 to 30 min"), (45.0, 200.0, "0.8 to 3.3 min")],
)
def test_span_of_time_has_one_unit(least, most, text):
    assert span(least, most) == text


def test_a_block_is_timed_with_its_folders(tmp_path, monkeypatch):
    """Files of a small store lie in folders of their own, which take longer to make than the files."""
    grid = CaseGrid(read_study(write_study(tmp_path)))
    manifest = manifest_of(grid)
    written, flushed = [], []
    record = SimpleNamespace(status=FAILED)

    def write_whole(path, data, *, is_synced):
        written.append(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)

    monkeypatch.setattr(sampled_cases, "write_whole", write_whole)
    monkeypatch.setattr(sampled_cases, "flush_to_disk", flushed.append)
    assert sampled_cases.time_block(manifest, record) > 0.0
    assert written == flushed
    assert len({path.parent for path in written}) == len(written)  # each in a new one
