"""Loads of closed contacts with curved gaps over a step, and what the coordinates make of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_lean_sum
from rubhpc.kernels.curved_contact import (
    BEFORE,
    HEIGHT,
    HEIGHT_RATE,
    LOAD_ACROSS,
    LOAD_ALONG,
    LOAD_BENDING,
    N_NODE,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)

Floats = NDArray[np.float64]


@jit_inline_sum
def lone_pair(mask: int, q: int) -> int:
    """The closed pair, where it is the only pair; else -1."""
    return 0 if q == 1 and mask == 1 else -1


@jit_lean_sum
def read_free(
    tables: CurvedTables, mode: int, p_re: Floats, p_im: Floats, z_re: Floats, z_im: Floats, free: Floats
) -> None:
    """What is read (3 d + 1,) of the only pair after a step with the powers `p` (m,), without loads."""
    for r in range(free.size):
        re, im = tables.read_re[mode, 0, r], tables.read_im[mode, 0, r]
        total = 0.0
        for k in range(z_re.size):
            total += re[k] * (p_re[k] * z_re[k] - p_im[k] * z_im[k])
            total -= im[k] * (p_re[k] * z_im[k] + p_im[k] * z_re[k])
        free[r] = total


@jit_lean_sum
def read_loaded(tables: CurvedTables, mode: int, level: int, node: int, work: CurvedWork) -> None:
    """Fill the motion of the only pair at a node of a step of 2^level ticks, under the loads at its nodes."""
    d, n_load = tables.bound.shape[2], work.load.shape[2]
    free, motion = work.free[node - 1], work.motion
    for r in range(free.size):
        total = free[r]
        for a in range(N_NODE):
            row = tables.reach[mode, level, node - 1, a, r]
            for j in range(n_load):
                total += row[j] * work.load[a, 0, j]
        if r < d:
            motion[0, 0, r] = total
        elif r <= 2 * d:
            motion[1, 0, r - d] = total
        else:
            motion[2, 0, r - 2 * d - 1] = total


@jit_lean_sum
def respond(tables: CurvedTables, mode: int, mask: int, node: int, work: CurvedWork) -> None:
    """Rates of the coordinates under the loads at a node, into `work.response`."""
    re, im = work.response[node, 0], work.response[node, 1]
    for k in range(re.size):
        re[k], im[k] = 0.0, 0.0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for a in range(work.load.shape[2]):
                load = work.load[node, i, a]
                row_re, row_im = tables.load_re[mode, i, a], tables.load_im[mode, i, a]
                for k in range(re.size):
                    re[k] += row_re[k] * load
                    im[k] += row_im[k] * load


@jit_lean_sum
def add_responses(
    tables: CurvedTables, mode: int, level: int, node: int, response: Floats, re: Floats, im: Floats
) -> None:
    """Add the responses at a node of a step of 2^level ticks to the loads at the three nodes."""
    for a in range(N_NODE):
        w_re = tables.weight_re[mode, level, node - 1, a]
        w_im = tables.weight_im[mode, level, node - 1, a]
        r_re, r_im = response[a, 0], response[a, 1]
        for k in range(re.size):
            re[k] += w_re[k] * r_re[k] - w_im[k] * r_im[k]
            im[k] += w_re[k] * r_im[k] + w_im[k] * r_re[k]


@jit_lean_sum
def predict_loads(mask: int, step: float, work: CurvedWork) -> None:
    """Loads in the middle and at the end of a step (s): those of the step before, gone on as it went."""
    q, n_load = work.load.shape[1], work.load.shape[2]
    ratio = step / work.span[BEFORE] if work.span[BEFORE] > 0.0 else 0.0
    for node in range(1, N_NODE):
        t = 1.0 + 0.5 * node * ratio  # in units of the step before
        for i in range(q):
            if is_closed(mask, i):
                for a in range(n_load):
                    first, middle, last = work.before[0, i, a], work.before[1, i, a], work.before[2, i, a]
                    bend = 2.0 * (first - 2.0 * middle + last)
                    slope = last - first + bend  # at its end
                    load = work.load[0, i, a]
                    if ratio > 0.0:
                        load += (t - 1.0) * (slope + (t - 1.0) * bend)
                    work.load[node, i, a] = load
                work.h[node, i], work.rate[node, i] = (
                    work.load[node, i, HEIGHT],
                    work.load[node, i, HEIGHT_RATE],
                )


@jit_inline_sum
def load_change(pairs: CurvedPairs, mask: int, node: int, before: Floats, work: CurvedWork) -> float:
    """By how much the loads at a node differ from those `before` (q, 4 + b), as a force, N."""
    largest = 0.0
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            force = pairs.stiffness[i] * abs(work.load[node, i, HEIGHT] - before[i, HEIGHT])
            force += abs(work.load[node, i, LOAD_ALONG] - before[i, LOAD_ALONG])
            force += abs(work.load[node, i, LOAD_ACROSS] - before[i, LOAD_ACROSS])
            for a in range(LOAD_BENDING, work.load.shape[2]):
                force += pairs.leverage[i, a - LOAD_BENDING] * abs(work.load[node, i, a] - before[i, a])
            largest = max(largest, force)
    return largest
