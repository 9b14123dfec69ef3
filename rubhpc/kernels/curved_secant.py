"""The loads of a step, found by a secant method: Broyden's, whose matrix goes on from step to step.

The loads x at the nodes after the first answer to themselves: the motion under them has the loads g(x). What
stiff modes make of a load without delay does not fall with the step, so that sweeps `x = g(x)` converge no
better in short steps. Here `x + H (g(x) - x)` is tried, H learnt from what the loads did before
(C. G. Broyden, Math. Comput. 19 (1965) 577-593).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.curved_contact import (
    HEIGHT,
    HEIGHT_RATE,
    LEARNT,
    LOAD_ACROSS,
    LOAD_ALONG,
    LOAD_BENDING,
    N_NODE,
    CurvedPairs,
    CurvedWork,
    is_closed,
)

Floats = NDArray[np.float64]

# Rows of `CurvedWork.point`: loads, their image, what they were predicted to be, by how much they are missed,
# by how much they are moved, by how much they were missed before; forces (N) that units of them stand for.
LOADS, IMAGE, GUESS, MISSED, MOVE, SAID, FORCES = range(7)
LEAST_SHARE = 0.1  # of a move's square; below it, what was learnt of the move is noise


@jit_lean_sum
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


@jit_lean_sum
def give_loads(mask: int, work: CurvedWork) -> None:
    """Set the loads of the closed pairs to `LOADS`."""
    n = 0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for node in range(1, N_NODE):
                for a in range(work.load.shape[2]):
                    work.load[node, i, a] = work.point[LOADS, n]
                    n += 1


@jit_lean_sum
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


@jit_lean_sum
def size_of(change: Floats, n: int, n_load: int, forces: Floats) -> float:
    """Largest change of n loads at a node, as a force, N; that of the rates of h is not counted."""
    largest = 0.0
    for first in range(0, n, n_load):
        force = 0.0
        for a in range(n_load):
            force += forces[first + a] * abs(change[first + a])
        force -= forces[first + HEIGHT_RATE] * abs(change[first + HEIGHT_RATE])
        largest = max(largest, force) if np.isfinite(force) else np.inf
    return largest


@jit_lean_sum
def forget(n: int, work: CurvedWork) -> None:
    """Begin with sweeps: H is the unit matrix."""
    secant = work.secant
    if n <= secant.shape[1]:
        for part in range(2):
            for j in range(n):
                for k in range(n):
                    secant[part, j, k] = 1.0 if j == k else 0.0
    work.span[LEARNT] = 1.0


@jit_lean_sum
def keep_or_forget(n: int, is_settled: bool, work: CurvedWork) -> None:
    """Keep H where the loads were found; else go back to the one kept before, and at last to sweeps."""
    secant = work.secant
    if n <= secant.shape[1]:
        source, target = (0, 1) if is_settled else (1, 0)
        for j in range(n):
            for k in range(n):
                secant[target, j, k] = secant[source, j, k]
    if is_settled:
        work.span[LEARNT] = 1.0
    else:
        work.span[LEARNT] = 2.0 if work.span[LEARNT] == 1.0 else 0.0


@jit_lean_sum
def move_loads(n: int, work: CurvedWork) -> None:
    """Move the loads by H times what they are missed by."""
    point, secant = work.point, work.secant[0]
    for j in range(n):
        total = point[MISSED, j]
        if n <= secant.shape[0]:
            row = secant[j]
            total = 0.0
            for k in range(n):
                total += row[k] * point[MISSED, k]
        point[MOVE, j] = total
    for j in range(n):
        point[LOADS, j] += point[MOVE, j]


@jit_lean_sum
def learn(n: int, work: CurvedWork) -> None:
    """Have H say that the last move was due to the change of what the loads are missed by, `SAID` before it.

    Of all such matrices the nearest is taken, loads measured by the forces that they stand for.
    """
    point, secant = work.point, work.secant[0]
    if n > secant.shape[0]:
        return
    change, weighed = point[SAID], point[IMAGE]
    for j in range(n):
        change[j] -= point[MISSED, j]
    for j in range(n):
        row = secant[j]
        total = 0.0
        for k in range(n):
            total += row[k] * change[k]
        weighed[j] = total
    square, along = 0.0, 0.0
    for j in range(n):
        one = point[FORCES, j] * point[FORCES, j] * point[MOVE, j]
        square += one * point[MOVE, j]
        along += one * weighed[j]
        change[j] = one
    if not abs(along) > LEAST_SHARE * square:
        return
    for j in range(n):
        weighed[j] = (point[MOVE, j] - weighed[j]) / along
    move = point[MOVE]  # of which nothing more is needed
    for k in range(n):
        move[k] = 0.0
    for j in range(n):
        row, share = secant[j], change[j]
        for k in range(n):
            move[k] += share * row[k]
    for j in range(n):
        row, share = secant[j], weighed[j]
        for k in range(n):
            row[k] += share * move[k]
