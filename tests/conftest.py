"""Puts this directory on the path: tests of every kind share `running` and `reference`.

Linear algebra has one thread, as under the commands: two would wait for each other on small matrices.
"""

import os

for library in ("OMP", "OPENBLAS", "MKL", "BLIS"):
    os.environ[f"{library}_NUM_THREADS"] = "1"
