"""The loads of the closed pairs at the nodes of a step after the first, as one vector."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.curved_contact import (
    HEIGHT,
    HEIGHT_RATE,
    LOAD_ACROSS,
    LOAD_ALONG,
    LOAD_BENDING,
    N_NODE,
    CurvedPairs,
    CurvedWork,
    is_closed,
)

Floats = NDArray[np.float64]

# Rows of `CurvedWork.point`: loads, their image g(x), predicted loads, residual, correction, and the force
# (N) equivalent to a unit of each.
LOADS, IMAGE, GUESS, MISSED, MOVE, FORCES = range(6)


@linked_sum
def take_loads(mask: int, work: CurvedWork, target: Floats) -> int:
    """Fill `target` with the loads of the closed pairs at the nodes after the first; returns their number."""
    n = 0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for node in range(1, N_NODE):
                for a in range(work.load.shape[2]):
                    target[n] = work.load[node, i, a]
                    n += 1
    return n


@linked_sum
def give_loads(mask: int, work: CurvedWork) -> None:
    """Set the loads of the closed pairs to `LOADS`."""
    n = 0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for node in range(1, N_NODE):
                for a in range(work.load.shape[2]):
                    work.load[node, i, a] = work.point[LOADS, n]
                    n += 1


@linked_sum
def weigh_loads(pairs: CurvedPairs, mask: int, step: float, work: CurvedWork) -> None:
    """Fill `FORCES` for a step (s)."""
    forces, n_load, n = work.point[FORCES], work.load.shape[2], 0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for _ in range(1, N_NODE):
                forces[n + HEIGHT], forces[n + HEIGHT_RATE] = pairs.stiffness[i], pairs.stiffness[i] * step
                forces[n + LOAD_ALONG], forces[n + LOAD_ACROSS] = 1.0, 1.0
                for a in range(LOAD_BENDING, n_load):
                    forces[n + a] = pairs.leverage[i, a - LOAD_BENDING]
                n += n_load


@linked_sum
def size_of(change: Floats, n: int, n_load: int, forces: Floats) -> float:
    """Largest change of n loads at a node as a force, N, without the rates of h."""
    largest = 0.0
    for first in range(0, n, n_load):
        force = 0.0
        for a in range(n_load):
            force += forces[first + a] * abs(change[first + a])
        force -= forces[first + HEIGHT_RATE] * abs(change[first + HEIGHT_RATE])
        largest = max(largest, force) if np.isfinite(force) else np.inf
    return largest
