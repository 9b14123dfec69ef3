"""How `rubhpc plan` samples cases, cuts them, and what it predicts from them."""

import math
import time
from dataclasses import replace
from itertools import groupby
from types import SimpleNamespace

import numpy as np
import pytest

from rubhpc.running import plan, sampled_cases
from rubhpc.running.case_setup import MOST_BYTES
from rubhpc.running.plan import make_plan
from rubhpc.running.sampled_cases import CaseTimer, Sample, Timed, Trail, in_spread_order, memory, part_of
from rubhpc.storage.duration import span
from rubhpc.study.cases import CaseGrid
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import read_study
from tests.support.running import write_study


def timed(steps, spent, **more):
    return Timed(steps=steps, spent=spent, **more)


def estimate(batches, n_case, steps):
    return Sample(batches=batches).estimate(n_case, steps)


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


def test_a_cut_case_widens_the_range():
    """It holds the case whose rest takes least, and the one whose rest takes most."""
    cut = timed(1.0, 2.0, share=0.1, rest=18.0, least=6.0, most=54.0)
    found = estimate([cut], 1, 1.0)
    assert found == pytest.approx((20.0, 8.0, 56.0))
    unknown = timed(1.0, 2.0, share=0.0, most=math.inf)
    assert estimate([unknown], 1, 1.0).most == math.inf
    assert estimate([unknown, cut], 2, 2.0).most < math.inf
    assert all(math.isnan(value) for value in estimate([], 1, 1.0))


@pytest.mark.parametrize("shape", [(7,), (40, 4), (10, 10, 10)])
def test_sampled_cases_spread_over_all_axes(shape):
    found = list(in_spread_order(np.ones(shape, bool)))[:64]
    assert len(found) == len(set(found)) == min(64, math.prod(shape))
    for axis, n in enumerate(shape):
        seen = np.bincount([index[axis] for index in found], minlength=n)
        assert len(found) // n // 2 <= seen.min() <= seen.max() <= len(found) // n + 3


def test_only_missing_cases_are_sampled():
    missing = np.zeros((4, 30, 3), bool)
    missing[-1, ::5, 0] = True
    assert sorted(in_spread_order(missing)) == [tuple(index) for index in np.argwhere(missing).tolist()]


def test_a_long_run_up_is_known_by_parts_of_it(tmp_path, monkeypatch):
    """Rub begins in the middle of a run-up: its first revolutions would say nothing."""
    physics = Physics(monkeypatch, lambda case: 10.0 * (case.speed_law.speed[0] > 150.0))
    run_up = "[run_up]\nstart = 100.0\nstop = 200.0\n"
    grid = '[grid]\n"run_up.time" = [10.0, 11.0]\nclearance = [1e-4, 2e-4]\nfriction = 0.1\n'
    (tmp_path / "up.toml").write_text(f'rig = "mokhtar2017"\n{run_up}{grid}')
    sample, _ = physics.plan(read_study(tmp_path / "up.toml"), 100.0)
    found = estimate(sample.batches, 4, 4.0)
    assert sample.cut
    assert found.least < 4 * 0.5 * 80.0 < found.most


class Physics:
    """Cases of so many seconds a revolution on a clock of their own, in place of integration."""

    def __init__(self, monkeypatch, seconds):
        self.now, self.ran, self.held = 1000.0, [], 0.0
        clock = SimpleNamespace(monotonic=lambda: self.now, process_time=lambda: self.now)
        monkeypatch.setattr(sampled_cases, "time", clock)
        monkeypatch.setattr(sampled_cases, "memory", lambda: self.held)
        monkeypatch.setattr(sampled_cases, "warm_up", lambda *_: None)
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
        timer = self.timer = CaseTimer(grid, self.now + seconds)
        began = self.now
        sample = time_all(timer, grid)
        return sample, self.now - began


def time_all(timer, grid):
    """Time cases of a grid of equal steps of which none is done."""
    return timer.time_cases(np.ones(grid.shape, bool), grid.n_case, lambda _: 1.0, lambda _: None)


@pytest.fixture
def study(tmp_path):
    speeds = [0.9 + 0.1 * i for i in range(40)]
    return read_study(write_study(tmp_path, speed_ratio=speeds))


@pytest.mark.parametrize(("seconds", "n_case"), [(1.0, 6), (0.01, 240)])
def test_few_cases_are_timed_where_they_agree(study, monkeypatch, seconds, n_case):
    sample, _ = Physics(monkeypatch, lambda case: seconds).plan(study)
    assert n_case <= sample.n_case < n_case + 8
    assert not sample.cut


def test_cases_of_a_batch_share_set_up_and_friction(study, monkeypatch):
    """Contact modes of a speed and a friction are solved once in a run."""
    physics = Physics(monkeypatch, lambda case: 0.1)
    physics.plan(study)
    pairs = [(speed, friction) for speed, _, friction in physics.ran]
    assert len(set(pairs)) > 10
    assert len(list(groupby(pairs))) == len(set(pairs))


def test_more_cases_are_timed_where_they_differ(study, monkeypatch):
    """A few cases rub and take most of the time."""
    sample, taken = Physics(monkeypatch, lambda case: 0.05 + (case.index[0] % 5 == 0)).plan(study)
    assert sample.n_case > 6
    assert taken <= 10.5


def test_long_cases_are_cut_and_extrapolated(study, monkeypatch):
    """Their time is known by how far they came, and the plan ends when it should."""
    sample, taken = Physics(monkeypatch, lambda case: 600.0).plan(study)
    assert taken < 10.0 + 6.0 + 1.0  # a check is 6 s apart here
    assert len(sample.cut) == sample.n_case
    found = estimate(sample.batches, 240, 240.0)
    assert found.least < 240 * 600.0 < found.most
    assert found.seconds == pytest.approx(240 * 600.0, rel=0.5)


def test_a_case_is_cut_for_its_memory(study, monkeypatch):
    physics = Physics(monkeypatch, lambda case: setattr(physics, "held", held) or 1.0)
    physics.held, held = 0.0, 2 * sampled_cases.MOST_MEMORY
    sample, taken = physics.plan(study)
    assert sample.was_full
    assert taken < 0.1


def test_a_script_that_holds_much_has_a_plan(study, monkeypatch):
    physics = Physics(monkeypatch, lambda case: 0.1)
    physics.held = 3 * sampled_cases.MOST_MEMORY
    sample, _ = physics.plan(study)
    assert sample.n_case > 1
    assert not sample.was_full


def test_a_set_up_without_checks_is_cut(study, monkeypatch):
    """An alarm ends what does not ask whether there is time."""

    def hang(*_: object) -> None:
        time.sleep(60.0)

    monkeypatch.setattr(sampled_cases.KeptSetups, "of", hang)
    monkeypatch.setattr(sampled_cases, "warm_up", lambda *_: None)
    grid, began = CaseGrid(study), time.monotonic()
    timer = CaseTimer(grid, began + 2.0)  # s, time enough to begin a case on a loaded machine
    sample = time_all(timer, grid)
    assert time.monotonic() - began < 10.0
    assert sample.cut == [0.0]


@pytest.mark.parametrize(("revolutions", "share"), [(4, 0.25), (64, 0.8 * 0.25)])
def test_the_rest_takes_as_long_for_its_share(tmp_path, monkeypatch, revolutions, share):
    """A fifth of a case with a long record follows a motion that has no period."""
    study = read_study(write_study(tmp_path, revolutions=revolutions))
    clock = SimpleNamespace(process_time=lambda: 0.0)
    monkeypatch.setattr(sampled_cases, "time", clock)
    trail = Trail(study)
    trail.begin()
    trail.noted += [0.1, 0.25, 0.01]  # of another motion that is followed
    clock.process_time = lambda: 2.0
    found = trail.timed(1.0, is_whole=False)
    assert (found.spent, found.share) == (2.0, share)
    assert found.whole == pytest.approx(2.0 / share)
    assert 1.5 * found.least < found.rest < found.most / 1.5
    trail.noted.clear()
    assert trail.timed(1.0, is_whole=False).most == math.inf


def test_plan_says_what_was_cut_and_what_takes_most(tmp_path, monkeypatch):
    cut = {"rest": 900.0, "least": 300.0, "most": 2700.0}
    batches = [timed(1.0, 100.0, share=share, **cut) for share in (0.1, 0.2)]
    monkeypatch.setattr(CaseTimer, "time_cases", lambda *_: Sample(batches=batches, cut=[0.1, 0.2]))
    text = make_plan(read_study(write_study(tmp_path, transient=90))).text()
    assert (
        "timed       2 cases; 2 cut for time at 10 % to 20 % of it, the rest extrapolated; they differ"
        in text
    )
    assert "mostly      the transient, 90 revolutions (98 % of the time)" in text


def test_half_of_the_stators_is_timed(study, monkeypatch):
    physics = Physics(monkeypatch, lambda case: 10.0 * len(case.rig.stator) ** 2)
    physics.plan(replace(study, rig=replace(study.rig, stator=8 * study.rig.stator)))
    assert physics.timer.time_half(30.0) == pytest.approx(0.25, rel=0.1)


def test_memory_holds_other_set_ups_of_a_ring(tmp_path, monkeypatch):
    """Contact modes of the longest case and of other set-ups and frictions, up to a bound."""
    monkeypatch.setattr(plan, "memory", lambda _: 1e6)
    study = read_study(write_study(tmp_path))
    ring = replace(study, rig=replace(study.rig, stator=2 * study.rig.stator))

    def found(study, *modes):
        batches = [timed(1.0, 1.0, n_byte=n_byte) for n_byte in modes]
        return plan._memory(study, Sample(batches=batches, memory=3e8), 100) - 3e8

    assert found(study, 1e6, 3e6) == pytest.approx(3e6)
    assert found(ring, 1e6, 3e6) == pytest.approx(3e6 + 11 * 2e6)  # four set-ups of three frictions
    assert found(ring, 1e9) == pytest.approx(1e9 + MOST_BYTES)


@pytest.mark.parametrize(
    ("least", "most", "text"),
    [(30.0, 52.0, "30 to 52 s"), (720.0, 1800.0, "12 to 30 min"), (45.0, 200.0, "0.8 to 3.3 min")],
)
def test_span_of_time_has_one_unit(least, most, text):
    assert span(least, most) == text


def test_part_of_a_run_up_has_its_speeds():
    law = SpeedLaw(time=(0.0, 4.0, 10.0), speed=(50.0, 300.0, 100.0))
    part = part_of(law, 100, 116)
    assert part.n_revolution == 16
    assert part.speed[0] == pytest.approx(law.at_angle(2 * np.pi * np.array([100.0]))[1][0])


def test_memory_is_that_of_this_process():
    held = np.ones(20_000_000)
    assert held.nbytes < memory() <= 1.01 * memory("VmHWM:") < 1e12
