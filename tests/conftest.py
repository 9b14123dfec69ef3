"""One thread for linear algebra, as the commands have it: two would wait for each other on small matrices."""

import os

for library in ("OMP", "OPENBLAS", "MKL", "BLIS"):
    os.environ[f"{library}_NUM_THREADS"] = "1"
