"""What a study costs beside its physics: a million cases are to be planned, run and reported with ease."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from running import environment

N_FEW, N_MANY = 20_000, 120_000
MILLION = 1_000_000


def took(n_case: int, folder: Path) -> dict[str, float]:
    script = Path(__file__).with_name("million.py")
    command = [sys.executable, str(script), str(n_case), str(folder)]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, check=True)
    reported: dict[str, float] = json.loads(done.stdout)
    assert reported["done"] == n_case
    return reported


@pytest.fixture(scope="module")
def times(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, float], dict[str, float]]:
    """What a small and a large study took: their difference is free of what each run costs once."""
    few, many = (took(n, tmp_path_factory.mktemp("many")) for n in (N_FEW, N_MANY))
    return few, many


# Microseconds a case are a timing: they are held on an idle machine, with `make bench`.
@pytest.mark.bench
@pytest.mark.parametrize(
    ("what", "most"), [("plan", 10.0), ("run", 50.0), ("plan_again", 10.0), ("status", 5.0)]
)
def test_a_million_cases_take(times, what, most):
    """Plan under 10 s, status under 5 s, and 50 us of a run's time a case."""
    few, many = times
    each = (many[what] - few[what]) / (N_MANY - N_FEW)
    assert few[what] * (what != "run") + each * MILLION < most


@pytest.mark.long
def test_a_million_cases_fit_in_a_gigabyte(times):
    few, many = times
    assert few["memory"] + (many["memory"] - few["memory"]) / (N_MANY - N_FEW) * MILLION < 1000


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_a_million_cases_in_earnest(tmp_path):
    """Nothing is extrapolated."""
    reported = took(MILLION, tmp_path)
    each = reported["run"] / MILLION * 1e6
    print(
        f"\na million cases: plan {reported['plan']:.1f} s, status {reported['status']:.1f} s, "
        f"plan when done {reported['plan_again']:.1f} s, {each:.0f} us a case beside its physics, "
        f"{reported['memory']:.0f} MB"
    )
    assert reported["plan"] < 10
    assert reported["plan_again"] < 10
    assert reported["status"] < 5
    assert each < 50
    assert reported["memory"] < 1000
