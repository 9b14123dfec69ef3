"""The loads of a step, found by a secant method: Broyden's, with a matrix for each length of steps.

The loads x at the nodes after the first answer to themselves: the motion under them has the loads g(x). What
stiff modes make of a load without delay does not fall with the step, so that sweeps `x = g(x)` converge no
better in short steps. Here `x + H (g(x) - x)` is tried, H learnt from what the loads did before, in this and
earlier contacts (C. G. Broyden, Math. Comput. 19 (1965) 577-593).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_lean_sum
from rubhpc.kernels.curved_contact import (
    HEIGHT,
    HEIGHT_RATE,
    LOAD_ACROSS,
    LOAD_ALONG,
    LOAD_BENDING,
    N_NODE,
    PAIRS,
    CurvedPairs,
    CurvedWork,
    is_closed,
)

Floats = NDArray[np.float64]

# Rows of `CurvedWork.point`: loads, their image, what they were predicted to be, by how much they are missed,
# by how much they are moved, by how much they were missed before; forces (N) that units of them stand for.
LOADS, IMAGE, GUESS, MISSED, MOVE, SAID, FORCES = range(7)
LEAST_SHARE = 0.1  # of a move's square; below it, what was learnt of the move is noise


@jit_inline_sum
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


@jit_inline_sum
def give_loads(mask: int, work: CurvedWork) -> None:
    """Set the loads of the closed pairs to `LOADS`."""
    n = 0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for node in range(1, N_NODE):
                for a in range(work.load.shape[2]):
                    work.load[node, i, a] = work.point[LOADS, n]
                    n += 1


@jit_inline_sum
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


@jit_inline_sum
def take_secant(mask: int, level: int, n: int, work: CurvedWork) -> None:
    """See that there is an H for steps of 2^level ticks: that of a length next to it, or the unit matrix."""
    secant, is_learnt = work.secant, work.is_learnt
    if work.span[PAIRS] != mask:
        work.span[PAIRS] = mask
        forget(0, work)
    if is_learnt[level] or n > secant.shape[1]:
        return
    source = level
    if level > 0 and is_learnt[level - 1]:
        source = level - 1
    elif level + 1 < is_learnt.size and is_learnt[level + 1]:
        source = level + 1
    for j in range(n):
        for k in range(n):
            secant[level, j, k] = secant[source, j, k]
            if source == level:
                secant[level, j, k] = 1.0 if j == k else 0.0
    is_learnt[level] = True


@jit_inline_sum
def forget(level: int, work: CurvedWork) -> None:
    """Forget the H of steps of 2^level ticks, and of longer ones."""
    for one in range(level, work.is_learnt.size):
        work.is_learnt[one] = False


@jit_inline_sum
def move_loads(level: int, n: int, work: CurvedWork) -> None:
    """Move the loads by H times what they are missed by."""
    point, secant = work.point, work.secant[level]
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


@jit_inline_sum
def learn(level: int, n: int, work: CurvedWork) -> None:
    """Have H say that the last move was due to the change of what the loads are missed by, `SAID` before it.

    Of all such matrices the nearest is taken, loads measured by the forces that they stand for.
    """
    point, secant = work.point, work.secant[level]
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
