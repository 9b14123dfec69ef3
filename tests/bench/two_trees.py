"""Processor time of the same rubbing cases in two source trees, by turns.

    python tests/bench/two_trees.py OLD NEW

Each tree is a checkout; its kernels are compiled before it is timed. The cases are those of the packaged rig
at 30 GPa with steady sliding: six speeds, three clearances.
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

def compute():
    began = time.process_time()
    for speed in (0.7, 0.9, 1.4, 2.1, 3.2, 4.0):
        for clearance in (0.6, 0.75, 0.9):
            rubhpc.simulate(
                rig, speed_ratio=speed, clearance_ratio=clearance, friction=0.3,
                transient=120, revolutions=64, samples_per_revolution=128,
            )
    return time.process_time() - began

compute()
print(min(compute(), compute()))
"""


def seconds(tree: Path) -> float:
    """Processor time of all cases in a process of its own, the better of two after one to warm up."""
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    environment = {**os.environ, **threads, "PYTHONPATH": str(tree)}
    printed = subprocess.run(
        [sys.executable, "-c", TIMED], env=environment, cwd=tree, capture_output=True, text=True, check=True
    )
    return float(printed.stdout.split()[-1])


if __name__ == "__main__":
    trees = [Path(name).resolve() for name in sys.argv[1:3]]
    times = [[seconds(tree) for tree in trees] for _ in range(N_TURN)]
    for old, new in times:
        print(f"{old:.3f} s  {new:.3f} s  {new / old:.3f}")
    print(f"ratio, median of {N_TURN}: {statistics.median(new / old for old, new in times):.3f}")
