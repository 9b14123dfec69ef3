"""What it costs to prove regimes, over cases of the packaged map, each with and without in turn."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import rubhpc
from rubhpc.integrate import case as integration
from rubhpc.study.study import read_study

if TYPE_CHECKING:
    from rubhpc.integrate.record import Record

pytestmark = pytest.mark.bench

STUDY = Path(__file__).parents[2] / "jobs" / "map.toml"
FEWER = {"step = 0.05": "step = 0.25"}  # every fifth of the 1980 cases: all speeds and frictions
# Of a map's time. A ratio to the time without proofs would ask for more of them whenever anything else gets
# faster; what a user pays is this share of what he waits for.
BOUND = 0.25
ROUNDS = 3


def test_proofs_take_a_quarter_of_a_map_at_most(tmp_path, monkeypatch, capsys):
    """A study as a user runs it, writing included, whose cases are computed by turns with and without proofs.

    Of each the least processor time of three counts: with proofs once, the rest is taken off again.
    """
    text = STUDY.read_text()
    for old, new in FEWER.items():
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "study.toml").write_text(text)
    solver, integrate = integration.solver_of, integration._integrate
    proving: list[float] = []
    repeating: list[float] = []

    def timed(finds: bool, *case: Any) -> tuple[float, Record]:
        monkeypatch.setattr(integration, "solver_of", solver if finds else lambda *_: None)
        began = time.process_time()
        record = integrate(*case)
        return time.process_time() - began, record

    def by_turns(*case: Any) -> Record:
        began = time.process_time()
        plain, proved = zip(
            *[(timed(False, *case)[0], timed(True, *case)) for _ in range(ROUNDS)], strict=True
        )
        least = min(spent for spent, _ in proved)
        proving.append(least - min(plain))
        repeating.append(time.process_time() - began - least)
        return proved[-1][1]

    def seconds(name: str) -> float:
        study = read_study(tmp_path / "study.toml", tmp_path / f"{name}.zarr")
        began = time.process_time()
        rubhpc.run(study, quiet=True)
        return time.process_time() - began

    seconds("first")  # kernels are loaded
    monkeypatch.setattr(integration, "_integrate", by_turns)
    whole = seconds("by_turns") - sum(repeating)
    share = sum(proving) / whole
    with capsys.disabled():
        print(f"\n{len(proving)} cases: {whole:.2f} s, of which proofs {sum(proving):.2f} s, {share:.3f}")
    assert share < BOUND
