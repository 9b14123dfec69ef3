"""What ROSS 3 computes for the rotor of ross_3.1.0_tables.py as its speed rises; run where ROSS 3 is.

From rest, under the unbalance of that rotor, from 150 to 330 rad/s in 0.4 s, by Newmark's method, two steps.
The change of spin momentum is given as `G` times the acceleration, for a torque along the undeformed axis: a
disc's own `Kdt` has one entry, of the other sign than its `G`.
Written: displacements in both directions at two nodes, 2500 samples a second.
"""

import re
import sys
import warnings
from pathlib import Path

import numpy as np

warnings.filterwarnings("ignore")
source = (Path(__file__).parent / "ross_3.1.0_tables.py").read_text()
exec(re.split(r"\nspeeds = ", source)[0])  # the rotor
unbalance = ([4, 12], [0.002, 0.0005], [0.3, 1.9])  # node, kg m, rad
start, stop, time, rate = 150.0, 330.0, 0.4, 2500
nodes = [4, 7]
kept = {}
for n_sub in (5, 10):
    n = round(time * rate) * n_sub
    t = np.linspace(0.0, time, n + 1)
    speed = start + (stop - start) * t / time
    force = rotor.unbalance_force_over_time(*unbalance, speed, t)  # noqa: F821
    given = {"method": "newmark", "Ksdt": rotor.G()}  # noqa: F821
    answer = rotor.run_time_response(speed, force.T, t, **given)  # noqa: F821
    rows = [6 * node + direction for node in nodes for direction in (0, 1)]
    kept[f"response_{n_sub}"] = np.asarray(answer.yout)[::n_sub, rows].T
    print(n_sub, np.abs(kept[f"response_{n_sub}"]).max(axis=1))
np.savez_compressed(sys.argv[1], start=start, stop=stop, time=time, rate=rate, nodes=nodes, **kept)
