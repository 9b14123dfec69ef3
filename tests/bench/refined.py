"""How much of a refined map was computed, and how much of it is as in the full map.

    python tests/bench/refined.py REFINED.zarr FULL.zarr

The full map is the same study without `[refine]`, in another store.
"""

from __future__ import annotations

import sys

import numpy as np

import rubhpc
from rubhpc.schema import DONE, HAS_VALUES


def shares(refined: str, full: str) -> tuple[float, float, int]:
    """Return the share of the cases that were computed, that of regimes and periods alike, and the others."""
    part, whole = (rubhpc.open(path) for path in (refined, full))
    status = part["status"].values
    has_values = np.isin(status, HAS_VALUES) & np.isin(whole["status"].values, HAS_VALUES)
    alike = np.ones(int(has_values.sum()), dtype=bool)
    for name in ("regime", "period"):
        alike &= part[name].values[has_values] == whole[name].values[has_values]
    return float((status == DONE).mean()), float(alike.mean()), int((~alike).sum())


if __name__ == "__main__":
    computed, right, n_wrong = shares(*sys.argv[1:3])
    print(f"{computed:.1%} computed, {right:.2%} as in the full map ({n_wrong} are not)")
