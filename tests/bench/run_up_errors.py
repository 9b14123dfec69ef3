"""What run-ups of the overhung pump of the tests err by, over two revolutions from rest (guide, performance).

    python tests/bench/run_up_errors.py

Accelerations at nodes by several numbers of pieces a revolution, against stepping of all degrees.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS / "integrate" / "changing_speed"), str(TESTS / "support")]

import test_run_up_machines as machines  # noqa: E402
from overhung_pump import pump  # noqa: E402

from rubhpc import run_up  # noqa: E402

SETTINGS = {"by default": {}} | {
    f"{n} pieces, accuracy {accuracy:g}": {"pieces_per_revolution": n, "accuracy": accuracy}
    for n, accuracy in ((1, 1e-3), (4, 1e-3), (16, 1e-3), (16, 1e-5))
}


def main() -> None:
    """Print a line for each setting."""
    rig = replace(pump(), stator=machines.TIPS)
    expected, _ = machines.stepped(rig)
    for name, setting in SETTINGS.items():
        found = run_up(
            rig,
            **machines.LAW,
            **machines.CONTACT,
            **setting,
            law="penalty",
            initial={"from": "rest"},
            samples_per_revolution=machines.PER_REVOLUTION,
            probes=machines.PROBES,
        )
        off = []
        for probe, signal in zip(machines.PROBES, expected, strict=True):
            window = np.hanning(signal.size)
            full, own = np.fft.rfft((signal, found[f"probe_{probe.name}"].values) * window)[:, :22]
            off.append(f"{probe.name} {np.linalg.norm(own - full) / np.linalg.norm(full):.2%}")
        print(f"{name}: {', '.join(off)}")


if __name__ == "__main__":
    main()
