"""What it costs to prove regimes, over cases of the packaged map, with and without in turn."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

import rubhpc
from rubhpc.integrate import case as integration
from rubhpc.study.study import read_study

pytestmark = pytest.mark.bench

STUDY = Path(__file__).parents[2] / "jobs" / "map.toml"
FEWER = {"step = 0.05": "step = 0.25", "[0.1, 0.3, 0.5]": "[0.3]"}  # 55 x 3 of the 1980 cases: all speeds
ROUNDS, BOUND = 3, 1.25


def test_proofs_cost_a_quarter_of_a_map_at_most(tmp_path, monkeypatch, capsys):
    """Runs as a user starts them, set-up and writing included; of each the least processor time of three."""
    text = STUDY.read_text()
    for old, new in FEWER.items():
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "study.toml").write_text(text)
    solver = integration.solver_of

    def seconds(name: str, finds: bool) -> float:
        monkeypatch.setattr(integration, "solver_of", solver if finds else lambda *_: None)
        study = read_study(tmp_path / "study.toml", tmp_path / f"{name}.zarr")
        began = time.process_time()
        rubhpc.run(study, quiet=True)
        return time.process_time() - began

    seconds("first", finds=True)  # kernels are loaded
    times = [(seconds(f"with_{k}", finds=True), seconds(f"without_{k}", finds=False)) for k in range(ROUNDS)]
    proved, plain = map(min, zip(*times, strict=True))
    with capsys.disabled():
        print(f"\n165 cases: {proved:.2f} s with proofs, {plain:.2f} s without, ratio {proved / plain:.3f}")
        print(", ".join(f"{a:.2f} / {b:.2f}" for a, b in times))
    assert proved < BOUND * plain
