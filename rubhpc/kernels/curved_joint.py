"""The loads of several pairs over a step, by a Newton method in h, its rate and the force of each.

As `curved_newton` for a single pair. The loads x at the nodes after the first depend on themselves through h,
its rate and the force N of each closed pair: three states per pair and node. The effect of a change of x on
the directions of the forces is left to the next sweep. With Q the derivatives of the states by the loads, P
the loads by a unit of each state, and r = g(x) - x the residual, the next trial is
`x + r + P (I - Q P)^-1 Q r`. Q is not stored: it is the product of the derivatives by the coordinates and of
the weights of the step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import add_rows, dot
from rubhpc.kernels.curved_contact import (
    HEIGHT,
    HEIGHT_RATE,
    LOAD_ALONG,
    N_NODE,
    CurvedTables,
    CurvedWork,
    is_closed,
)
from rubhpc.kernels.curved_loads import LOADS, MISSED, MOVE
from rubhpc.kernels.curved_newton import (
    N_STATE,
    STATE_FORCE,
    STATE_H,
    STATE_RATE,
    factorise,
    solve,
)

Floats = NDArray[np.float64]


@linked_sum
def find_joint_system(tables: CurvedTables, mode: int, level: int, mask: int, work: CurvedWork) -> bool:
    """Fill `work.systems` with the factors of I - Q P of a step of 2^level ticks; False if it is singular."""
    q, middle, system, n = work.h.shape[1], work.middle, work.systems[level], 0
    for i in range(q):
        n += N_STATE if is_closed(mask, i) else 0
    for at in range(N_NODE - 1):
        for node in range(N_NODE - 1):
            w_re, w_im = (
                tables.weight_re[mode, level, at, node + 1],
                tables.weight_im[mode, level, at, node + 1],
            )
            for state in range(n):
                re, im = work.follow[at, state, 0], work.follow[at, state, 1]
                for k in range(w_re.size):
                    middle[0, k] = re[k] * w_re[k] - im[k] * w_im[k]
                    middle[1, k] = re[k] * w_im[k] + im[k] * w_re[k]
                row, first, c = system[n * at + state], n * node, 0
                for i in range(q):
                    if is_closed(mask, i):
                        load_re, load_im = tables.load_re[mode, i], tables.load_im[mode, i]
                        push = work.push[node, c]
                        row[first + STATE_H] = -dot(load_re[HEIGHT], load_im[HEIGHT], middle[0], middle[1])
                        row[first + STATE_RATE] = -dot(
                            load_re[HEIGHT_RATE], load_im[HEIGHT_RATE], middle[0], middle[1]
                        )
                        row[first + STATE_FORCE] = -dot(push[0], push[1], middle[0], middle[1])
                        first += N_STATE
                        c += 1
    size = n * (N_NODE - 1)
    for i in range(size):
        system[i, i] += 1.0
    return factorise(system, work.orders[level, :size])


@linked_sum
def move_jointly(tables: CurvedTables, mode: int, level: int, mask: int, work: CurvedWork) -> None:
    """Correct the loads by their residual and by its effect through the states."""
    q, n_load, point, state = work.h.shape[1], work.load.shape[2], work.point, work.unknown
    response, middle = work.response, work.middle
    p = 0
    for i in range(q):
        p += 1 if is_closed(mask, i) else 0
    n_node = N_NODE - 1
    for node in range(n_node):
        re, im, c = response[node + 1, 0], response[node + 1, 1], 0
        for k in range(re.size):
            re[k], im[k] = 0.0, 0.0
        for i in range(q):
            if is_closed(mask, i):
                first = (n_node * c + node) * n_load
                add_rows(tables.load_re[mode, i], point[MISSED, first : first + n_load], re)
                add_rows(tables.load_im[mode, i], point[MISSED, first : first + n_load], im)
                c += 1
    n = N_STATE * p
    for at in range(n_node):
        middle[:] = 0.0
        for node in range(n_node):
            w_re, w_im = (
                tables.weight_re[mode, level, at, node + 1],
                tables.weight_im[mode, level, at, node + 1],
            )
            re, im = response[node + 1, 0], response[node + 1, 1]
            for k in range(re.size):
                middle[0, k] += w_re[k] * re[k] - w_im[k] * im[k]
                middle[1, k] += w_re[k] * im[k] + w_im[k] * re[k]
        for one in range(n):
            state[n * at + one] = dot(work.follow[at, one, 0], work.follow[at, one, 1], middle[0], middle[1])
    solve(work.systems[level], work.orders[level, : n * n_node], state[: n * n_node])
    for c in range(p):
        for node in range(n_node):
            first, own = (n_node * c + node) * n_load, n * node + N_STATE * c
            for a in range(n_load):
                point[MOVE, first + a] = point[MISSED, first + a]
            point[MOVE, first + HEIGHT] += state[own + STATE_H]
            point[MOVE, first + HEIGHT_RATE] += state[own + STATE_RATE]
            for a in range(LOAD_ALONG, n_load):
                point[MOVE, first + a] += work.levers[node, c, a - LOAD_ALONG] * state[own + STATE_FORCE]
    for j in range(p * n_node * n_load):
        point[LOADS, j] += point[MOVE, j]


@linked_sum
def take_joint_states(mask: int, work: CurvedWork) -> None:
    """Copy h, its rate and the forces of the closed pairs at the nodes from the last correction."""
    q, p, c = work.h.shape[1], 0, 0
    for i in range(q):
        p += 1 if is_closed(mask, i) else 0
    for i in range(q):
        if is_closed(mask, i):
            for node in range(1, N_NODE):
                work.h[node, i] = work.load[node, i, HEIGHT]
                work.rate[node, i] = work.load[node, i, HEIGHT_RATE]
                work.force[node, i] += work.unknown[N_STATE * (p * (node - 1) + c) + STATE_FORCE]
            c += 1
