"""What `rubhpc plan` predicts of a case that is run part by part."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from rubhpc.integrate.following import count_followed, n_followed
from rubhpc.running import followed_case, forecast, pilot_cases
from rubhpc.running.followed_case import FollowedCase
from rubhpc.running.forecast import Forecast
from rubhpc.running.modes_to_come import ModesToCome
from rubhpc.study.study import Recording

RECORDING = Recording(transient=60, revolutions=32, samples_per_revolution=16)
WHIP, CALM = 0.25, 0.01  # s a revolution


class Machine:
    """A motion that begins to whip at a revolution, with a tangent; runs take the time that it says."""

    def __init__(self, begins, n_behind=80, modes=0):
        self.begins, self.n_behind, self.modes, self.ran = begins, n_behind, modes, []
        self.taken = 0.0

    def run_case(self, setup, *, recording, initial, **_):
        first = initial.n if initial else 0
        n = first + recording.longest_transient + recording.revolutions
        last = n + (self.n_behind if recording.revolutions >= 16 else 0)
        calm = max(0, min(last, self.begins) - first)
        self.taken = calm * CALM + (last - first - calm) * WHIP
        if last > self.begins and self.modes:  # they are solved once
            self.taken, self.modes, self.solved = self.taken + 0.01 * self.modes, 0, self.modes
        count_followed(last - n)
        self.ran.append((first, last))
        return SimpleNamespace(final=SimpleNamespace(n=n))

    def timed(self, run, most):
        before = n_followed()
        record = run(None)
        if self.taken > most:
            count_followed(before - n_followed() + self.cut_behind)
            return most, None
        return self.taken, record

    cut_behind = solved = 0


def followed(monkeypatch, machine, limit, n_stator=16):
    monkeypatch.setattr(followed_case, "run_case", machine.run_case)
    monkeypatch.setattr(forecast, "march_of", lambda *_: SimpleNamespace(has_closed_form=True))
    setup = SimpleNamespace(model=SimpleNamespace(stators=[None] * n_stator), scheme=None)
    case = SimpleNamespace(clearance=1e-4, friction=0.1, initial=None)
    found = FollowedCase(setup, case, RECORDING, machine)
    found.follow(1e5, 80, limit)
    return found


def test_a_case_is_run_to_its_end_where_there_is_time(monkeypatch):
    """Its transient goes on from part to part; the record and what is behind it are run at once."""
    machine = Machine(begins=1000)
    found = followed(monkeypatch, machine, limit=9.0)
    assert found.is_whole
    assert found.n_behind == 80
    assert found.seconds == pytest.approx((60 + 32 + 80) * CALM)
    assert machine.ran == [(0, 4), (0, 4), (4, 8), (8, 16), (16, 32), (32, 60), (60, 172)]


def test_a_whip_that_begins_late_is_met(monkeypatch):
    """What a case does at first says nothing: its transient is passed, and what is left costs as its end."""
    found = followed(monkeypatch, Machine(begins=40), limit=2.0)
    assert not found.is_whole
    forecast = found.forecast()
    assert found.seconds == pytest.approx(40 * CALM + 20 * WHIP)
    assert forecast.whole(80) == pytest.approx(found.seconds + (32 + 80) * WHIP)
    assert forecast.whole(272) - forecast.whole(80) == pytest.approx((272 - 80) * WHIP)
    found.finish(math.inf)
    assert found.is_whole
    assert found.forecast().whole(272) == found.seconds == pytest.approx(forecast.whole(80))


def test_contact_modes_that_only_a_look_ahead_meets_are_counted(monkeypatch):
    """A whip begins behind the parts that were run; its modes cost more than all before."""
    machine = Machine(begins=10, modes=300)
    monkeypatch.setattr(followed_case, "n_solved", lambda *_: machine.solved)
    found = followed(monkeypatch, machine, limit=0.1)
    passed = found.seconds
    forecast = found.forecast()
    assert (found.is_whole, found.is_irregular) == (False, True)
    assert found.seconds == pytest.approx(passed + 300 * 0.01)
    assert forecast.seconds > passed + 300 * 0.01


def test_a_case_that_is_dear_from_the_beginning_is_left_soon(monkeypatch):
    found = followed(monkeypatch, Machine(begins=0), limit=1.0)
    assert found.seconds == pytest.approx(4 * WHIP)
    assert found.forecast().whole(80) == pytest.approx((60 + 32 + 80) * WHIP)


@pytest.mark.parametrize(
    ("cut_behind", "usual", "length"), [(30, 144, 144), (100, 144, 240), (300, 144, 1008)]
)
def test_a_tangent_that_was_cut_off_is_carried_to_its_next_length(monkeypatch, cut_behind, usual, length):
    machine = Machine(begins=60, n_behind=1040)
    machine.cut_behind = cut_behind
    found = followed(monkeypatch, machine, limit=10.0)
    assert not found.is_whole  # it has taken 15 s of 268
    pace = 15.0 / (32 + cut_behind)
    assert found.forecast().whole(usual) == pytest.approx(60 * CALM + (32 + length) * pace)


def test_each_doubling_of_an_irregular_motion_meets_a_share_of_the_last():
    """With those of its tangent."""
    forecast = Forecast(20.0, 0.1, modes=3.0, fading=1.0, before=60, n_left=32)
    assert forecast.whole(80) == pytest.approx(20.0 + 8.0 + 3.0 * math.log2((60 + 32 + 80) / 60))
    assert forecast.whole(4 * 60 - 60 - 32) == pytest.approx(20.0 + 14.8 + 2 * 3.0)
    fading = forecast._replace(fading=0.5)
    assert fading.whole(4 * 60 - 60 - 32) == pytest.approx(20.0 + 14.8 + 3.0 * (0.5 + 0.25))
    assert Forecast(20.0, 0.1, least=40.0).whole(80) == 40.0


@pytest.mark.parametrize(
    ("new", "n_new", "fading", "to_come"),
    [
        ([200], 200, 1.0, 400),  # the first contacts: nothing before
        ([200, 100, 100, 100], 100, 1.0, 200),  # a whip
        ([200, 100, 80, 76], 76, 0.95, 76 * (0.95 + 0.95**2)),
        ([200, 100, 10, 0], 0, 0.9, 0),  # it has settled
        ([200, 100, 10, 50], 50, 1.0, 100),
        ([20, 10, 300], 300, 0.5, 300 * (0.5 + 0.25)),  # a whip begins
    ],
)
def test_modes_to_come_are_those_of_the_last_doublings(new, n_new, fading, to_come):
    met = ModesToCome()
    for k, n in enumerate(new):
        met.enter(2 ** (k + 1), n)
    assert met.n_new == pytest.approx(n_new)
    assert met.fading == pytest.approx(fading)
    assert met.to_come(3 * met.revolutions) == pytest.approx(to_come)
    assert met.is_growing == (n_new > 0)


def test_a_part_that_is_run_again_is_no_doubling():
    """A look ahead met its modes before; the last part of a transient may be shorter than all before."""
    met, looked = ModesToCome(), ModesToCome()
    for revolutions, n in ((2, 200), (4, 100), (8, 100)):
        met.enter(revolutions, n)
    for revolutions, n in ((2, 200), (4, 90), (4, 10), (8, 100), (8, 0)):
        looked.enter(revolutions, n)
    assert (looked.n_new, looked.fading) == (met.n_new, met.fading)
    met.enter(8 * 2**0.25, 25)
    assert met.n_new == pytest.approx(100)


def test_a_case_goes_on_part_by_part(monkeypatch):
    """As long as all before, then with the rest; what has been run is not run again."""
    machine = Machine(begins=0)
    found = followed(monkeypatch, machine, limit=1.0)
    assert machine.ran == [(0, 4), (0, 4)]
    seconds = []
    while not found.is_whole:
        assert found.go_on(math.inf)
        seconds.append(found.seconds)
    assert machine.ran[2:] == [(4, 8), (8, 16), (16, 32), (32, 60), (60, 172)]
    assert seconds == pytest.approx([WHIP * n for n in (8, 16, 32, 60, 172)])
    assert not followed(monkeypatch, Machine(begins=0), limit=1.0).go_on(0.5)  # 1 s is cut off


def test_length_of_a_tangent_is_that_of_the_cases_that_ran_whole():
    """Each counts by its time; what is usual as much as the longest of them."""
    found = pilot_cases.Pilots(SimpleNamespace(study=None))
    found._usual = 176
    assert found.n_behind == 176
    for seconds, n in ((2.0, 80), (6.0, 272)):
        found._take_in(SimpleNamespace(is_whole=True, seconds=seconds, n_behind=n, record=None))
    assert found.n_behind == pytest.approx((2 * 80 + 6 * 272 + 6 * 176) / (2 + 6 + 6))


@pytest.mark.parametrize(
    ("revolutions", "has_closed_form", "lengths", "usual"),
    [
        (32, True, (32, 240, 1008), 188),
        (16, True, (48, 256, 1024), 204),
        (128, True, (0, 144, 912), 108),
        (32, False, (64, 272, 1040), 64),
        (15, True, (), 0),
    ],
)
def test_a_tangent_goes_on_from_the_spans_of_the_record(
    revolutions, has_closed_form, lengths, usual, monkeypatch
):
    monkeypatch.setattr(forecast, "march_of", lambda *_: SimpleNamespace(has_closed_form=has_closed_form))
    recording = replace(RECORDING, revolutions=revolutions)
    setup = SimpleNamespace(scheme=None)
    assert forecast.lengths_behind(setup, recording) == lengths
    assert forecast.usual_behind(setup, recording) == usual
