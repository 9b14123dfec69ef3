"""What the first case of a ring costs, and the next: contact modes solved, processor time, memory.

    python tests/bench/rings.py

Rings of stators of 12 GPa, which together are as stiff and as heavy whatever their number, each in a process
of its own on one core: friction 0.05, speed ratio 1.5, 40 and 64 revolutions. The second case has another
clearance.
"""

import gc
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "support"))
from closed_form import read_rig, simulate

from rubhpc.integrate.modal_setup import ModalSetup

COUNTS = (3, 8, 12, 16, 32)
FRICTION = 0.05


def show(count: int) -> None:
    """Print the row of a ring."""
    packaged = read_rig("mokhtar2017")
    shared = {"youngs_modulus": 12e9 / count, "density": 4600.0 / count}
    rig = replace(packaged, stator=(replace(packaged.stator[0], count=count, **shared),))
    case = {"speed_ratio": 1.5, "friction": FRICTION, "transient": 40, "revolutions": 64}
    simulate("mokhtar2017", clearance_ratio=0.8, **case)  # loads the kernels
    seconds = []
    for clearance in (0.8, 0.79):
        began = time.process_time()
        simulate(rig, clearance_ratio=clearance, **case)
        seconds.append(time.process_time() - began)
    setups = [found for found in gc.get_objects() if isinstance(found, ModalSetup)]
    n_mode = max(setup.n_solved(FRICTION) for setup in setups)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"| {count} | {n_mode} | {seconds[0]:.2g} s | {seconds[1]:.2g} s | {memory:.2g} GB |", flush=True)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        show(int(sys.argv[1]))
    for count in COUNTS if len(sys.argv) == 1 else ():
        subprocess.run([sys.executable, __file__, str(count)], check=True)
