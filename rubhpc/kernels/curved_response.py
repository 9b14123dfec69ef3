"""Loads of closed contacts with curved gaps over a step, and the response of the coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import add_rows, propagate
from rubhpc.kernels.curved_contact import (
    BEFORE,
    HEIGHT,
    HEIGHT_RATE,
    LAGRANGE,
    N_NODE,
    NODES,
    PAST,
    CurvedTables,
    CurvedWork,
    is_closed,
)

Floats = NDArray[np.float64]


@linked_sum
def lone_pair(mask: int, q: int) -> int:
    """The closed pair where there is a single pair; else -1."""
    return 0 if q == 1 and mask == 1 else -1


@linked_sum
def read_free(
    tables: CurvedTables, mode: int, level: int, z_re: Floats, z_im: Floats, work: CurvedWork
) -> None:
    """Read the single pair at the nodes of a step of 2^level ticks, under the first node's loads alone."""
    n_load, free = work.load.shape[2], work.free
    for r in range(free.size):
        free[r] = 0.0
    used = tables.used[mode]
    add_rows(tables.lone[mode, level, 0, :used], z_re[:used], free)
    add_rows(tables.lone[mode, level, 1, :used], z_im[:used], free)
    add_rows(tables.reach[mode, level, :n_load], work.loads[:n_load], free)


@linked_sum
def read_loaded(tables: CurvedTables, mode: int, level: int, work: CurvedWork) -> None:
    """Read the single pair at the nodes of a step of 2^level ticks under the loads at its nodes."""
    n_load, whole = work.load.shape[2], work.whole
    for r in range(whole.size):
        whole[r] = work.free[r]
    add_rows(tables.reach[mode, level, n_load:], work.loads[n_load:], whole)


@linked_sum
def take_motion(d: int, node: int, work: CurvedWork) -> None:
    """Fill the motion of the single pair at a node from its readings."""
    whole, motion, first = work.whole, work.motion, (node - 1) * (3 * d + 1)
    for j in range(d):
        motion[0, 0, j], motion[2, 0, j] = whole[first + j], whole[first + 2 * d + 1 + j]
    for j in range(d + 1):
        motion[1, 0, j] = whole[first + d + j]


@linked_sum
def respond(tables: CurvedTables, mode: int, mask: int, first: int, n_node: int, work: CurvedWork) -> None:
    """Rates of the coordinates under the loads at the nodes `first` to `n_node`, into `work.response`."""
    for node in range(first, n_node):
        re, im = work.response[node, 0], work.response[node, 1]
        for k in range(re.size):
            re[k], im[k] = 0.0, 0.0
        for i in range(work.load.shape[1]):
            if is_closed(mask, i):
                add_rows(tables.load_re[mode, i], work.load[node, i], re)
                add_rows(tables.load_im[mode, i], work.load[node, i], im)


@linked_sum
def add_responses(
    weight_re: Floats, weight_im: Floats, response: Floats, first: int, n_node: int, re: Floats, im: Floats
) -> None:
    """Add the responses to the loads at the nodes `first` to `n_node`, with their weights (5, m)."""
    for a in range(first, n_node):
        w_re, w_im, r_re, r_im = weight_re[a], weight_im[a], response[a, 0], response[a, 1]
        for k in range(re.size):
            re[k] += w_re[k] * r_re[k] - w_im[k] * r_im[k]
            im[k] += w_re[k] * r_im[k] + w_im[k] * r_re[k]


@linked_sum
def move_coordinates(
    tables: CurvedTables, mode: int, level: int, node: int, z: Floats, work: CurvedWork, target: Floats
) -> None:
    """Coordinates (2, m) at a node of a step of 2^level ticks from `z`, under the responses of `work`."""
    p_re, p_im = tables.node_re[mode, level, node - 1], tables.node_im[mode, level, node - 1]
    propagate(p_re, p_im, z[0], z[1], target[0], target[1])
    w_re, w_im = tables.weight_re[mode, level, node - 1], tables.weight_im[mode, level, node - 1]
    add_responses(w_re, w_im, work.response, 0, N_NODE, target[0], target[1])


@linked_sum
def leave_from(tables: CurvedTables, mode: int, mask: int, level: int, z: Floats, work: CurvedWork) -> None:
    """Fill `work.base` with the coordinates at the nodes under the loads at the beginning alone."""
    respond(tables, mode, mask, 0, 1, work)
    for node in range(1, N_NODE):
        base = work.base[node - 1]
        p_re, p_im = tables.node_re[mode, level, node - 1], tables.node_im[mode, level, node - 1]
        propagate(p_re, p_im, z[0], z[1], base[0], base[1])
        w_re, w_im = tables.weight_re[mode, level, node - 1], tables.weight_im[mode, level, node - 1]
        add_responses(w_re, w_im, work.response, 0, 1, base[0], base[1])


@linked_sum
def arrive(tables: CurvedTables, mode: int, level: int, node: int, work: CurvedWork, target: Floats) -> None:
    """Coordinates (2, m) at a node where `leave_from` left, under the responses of `work`."""
    base, re, im = work.base[node - 1], target[0], target[1]
    for k in range(re.size):
        re[k], im[k] = base[0, k], base[1, k]
    w_re, w_im = tables.weight_re[mode, level, node - 1], tables.weight_im[mode, level, node - 1]
    add_responses(w_re, w_im, work.response, 1, N_NODE, re, im)


@linked_sum
def predict_loads(mask: int, step: float, work: CurvedWork) -> None:
    """Loads at the nodes of a step (s) after the first, extrapolated from the step before."""
    q, n_load, ahead = work.load.shape[1], work.load.shape[2], work.ahead
    ratio, past = 0.0, 0.0
    if work.span[BEFORE] > 0.0:
        ratio, past = step / work.span[BEFORE], work.span[PAST] / work.span[BEFORE]
    for node in range(1, N_NODE):
        t = past + NODES[node] * ratio  # in units of that step
        for k in range(N_NODE):
            total = 0.0
            for power in range(N_NODE - 1, -1, -1):
                total = total * t + LAGRANGE[k, power]
            ahead[node - 1, k] = total
    for i in range(q):
        if is_closed(mask, i):
            for node in range(1, N_NODE):
                for a in range(n_load):
                    load = work.load[0, i, a]
                    if ratio > 0.0:
                        load = 0.0
                        for k in range(N_NODE):
                            load += ahead[node - 1, k] * work.before[k, i, a]
                    work.load[node, i, a] = load
                work.h[node, i], work.rate[node, i] = (
                    work.load[node, i, HEIGHT],
                    work.load[node, i, HEIGHT_RATE],
                )
