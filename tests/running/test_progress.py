from __future__ import annotations

import io
from types import SimpleNamespace

import pytest

from rubhpc.running import progress
from rubhpc.running.pool import Totals
from rubhpc.running.progress import Progress, one_line
from rubhpc.storage.duration import duration


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.2, "0 s"),
        (59, "59 s"),
        (185, "3:05 min"),
        (3599.6, "1:00 h"),
        (7260, "2:01 h"),
        (3 * 86400, "3.0 d"),
    ],
)
def test_durations_are_for_people(seconds, text):
    assert duration(seconds) == text


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    now = SimpleNamespace(time=100.0)
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: now.time))
    return now


def test_lines_come_now_and_then_with_the_time_left_by_predicted_steps(clock, capsys):
    """Half the cases are done, but three quarters of the steps: a third of the time so far is left."""
    with Progress(20, 1000, n_done=10, quiet=False, has_bar=True) as shown:
        clock.time += 5
        shown.update(Totals(done=1, cost=10))
        clock.time += 25
        shown.update(Totals(done=3, failed=1, diverged=1, cost=750))
        clock.time += 1
        shown.update(Totals(done=4, failed=1, diverged=1, cost=800))
    assert capsys.readouterr().out.splitlines() == [
        "10/20 cases are stored; computing the rest",
        "15/20 cases; 0.167 a second, 10 s left, 1 failed, 1 diverged",
    ]


def test_a_case_that_takes_long_says_where_it_is(clock, capsys):
    with Progress(1, 1, n_done=0, quiet=False, has_bar=False) as shown:
        shown.say("207 motions of branches found, now at clearance 0.0001")
        clock.time += 20
        shown.update(Totals())
        shown.say("")
        clock.time += 400
        shown.update(Totals(done=1, cost=1))
    assert capsys.readouterr().out.splitlines()[1:] == [
        "0/1 cases; 207 motions of branches found, now at clearance 0.0001",
        "1/1 cases; 0.00238 a second, 0 s left",
    ]


def test_short_cases_do_not_say_where_they_are(clock, capsys):
    with Progress(9, 9, n_done=0, quiet=False, has_bar=False) as shown:
        for n in range(9):
            shown.say("a case at revolution 3 of its record")
            clock.time += 2
            shown.update(Totals(done=n, cost=n))
            shown.say("")
    assert "revolution" not in capsys.readouterr().out


def test_a_refined_map_of_more_cases_than_predicted_does_not_say_that_it_ends(clock, capsys):
    with Progress(20, 100, n_done=0, quiet=False, has_bar=False) as shown:
        shown.expect(10)
        for done in (9, 12):
            clock.time += 10
            shown.update(Totals(done=done, cost=5 * done))
    assert capsys.readouterr().out.splitlines()[1:] == [
        "9/10 cases; 0.9 a second, 1 s left",
        "12 cases, 10 expected; 0.6 a second",
    ]


def test_lines_grow_rarer(clock, capsys):
    with Progress(10**6, 10**6, n_done=0, quiet=False, has_bar=False) as shown:
        for _ in range(3600):
            clock.time += 1
            shown.update(Totals(done=1, cost=1))
    assert 10 < capsys.readouterr().out.count("\n") < 60


@pytest.mark.parametrize(("n_done", "quiet"), [(0, True), (20, False)])
def test_nothing_is_said_where_there_is_nothing_to_say(clock, capsys, n_done, quiet):
    with Progress(20, 1000, n_done=n_done, quiet=quiet, has_bar=True) as shown:
        clock.time += 100
        shown.update(Totals(done=1, cost=10))
    assert capsys.readouterr().out == ""


def test_a_terminal_gets_a_bar(clock, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr("sys.stdout", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with Progress(20, 1000, n_done=0, quiet=False, has_bar=True) as shown:
        clock.time += 10
        shown.update(Totals(done=5, cost=500))
    assert "5/20 cases" in terminal.getvalue()
    assert "10 s left" in terminal.getvalue()


@pytest.mark.parametrize("is_terminal", [True, False])
def test_what_a_plan_does_is_one_line_of_a_terminal_and_nothing_elsewhere(
    is_terminal: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: is_terminal)
    monkeypatch.setenv("COLUMNS", "12")
    with one_line() as say:
        say("timing cases: 3")
        say("more")
    shown = capsys.readouterr()
    assert shown.out == ""
    clear = "\r\x1b[K"
    assert shown.err == (f"{clear}timing case{clear}more{clear}" if is_terminal else "")
