"""Processor time of the same rubbing cases in two source trees, by turns.

    python tests/bench/two_trees.py OLD NEW

Each tree is a checkout; its kernels are compiled before it is timed. The cases are those of the packaged rig
at 30 GPa with steady sliding: four speeds, three clearances. Timed are whole cases, and what one more
revolution of the transient and of the record costs them, which is the kernel's loop.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
from pathlib import Path

N_TURN = 5
TIMED = """
import time
try:
    from rubhpc.rig.reading import read_rig, with_keys
except ImportError:  # of a tree before it had rooms
    from rubhpc.rig import read_rig, with_keys
import rubhpc
rig = with_keys(read_rig("mokhtar2017"), {"stator.youngs_modulus": 30e9})

def compute(transient, revolutions):
    began = time.process_time()
    for speed in (0.7, 0.9, 1.4, 2.1):
        for clearance in (0.6, 0.75, 0.9):
            rubhpc.simulate(
                rig, speed_ratio=speed, clearance_ratio=clearance, friction=0.3,
                transient=transient, revolutions=revolutions, samples_per_revolution=128,
            )
    return (time.process_time() - began) / 12

compute(120, 64)
turns = (120, 64), (3120, 64), (120, 448)
whole, longer, recorded = [min(compute(*given), compute(*given)) for given in turns]
print(whole, (longer - whole) / 3000, (recorded - whole) / 384)
"""


def seconds(tree: Path) -> list[float]:
    """Processor time of a case, of a transient revolution and of a recorded one, in a process of its own."""
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    environment = {**os.environ, **threads, "PYTHONPATH": str(tree)}
    printed = subprocess.run(
        [sys.executable, "-c", TIMED], env=environment, cwd=tree, capture_output=True, text=True, check=True
    )
    return [float(word) for word in printed.stdout.split()]


if __name__ == "__main__":
    trees = [Path(name).resolve() for name in sys.argv[1:3]]
    times = [[seconds(tree) for tree in trees] for _ in range(N_TURN)]
    for i, (what, unit) in enumerate(
        (("a case, ms", 1e3), ("transient, us a turn", 1e6), ("record, us a turn", 1e6))
    ):
        pairs = [(old[i], new[i]) for old, new in times]
        ratio = sorted(new / old for old, new in pairs)
        old, new = (unit * statistics.median(column) for column in zip(*pairs, strict=True))
        print(
            f"{what:22}{old:8.2f}{new:8.2f}",
            f"ratio {ratio[N_TURN // 2]:.2f} ({ratio[0]:.2f} to {ratio[-1]:.2f})",
        )
