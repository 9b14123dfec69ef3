"""A step of closed contacts with curved gaps, by collocation with an estimate of its error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.contact_modes import ModeTables, propagate
from rubhpc.kernels.curved_contact import (
    BEFORE,
    LARGEST,
    N_NODE,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)
from rubhpc.kernels.curved_forces import evaluate, find_forces
from rubhpc.kernels.curved_response import (
    add_responses,
    load_change,
    lone_pair,
    predict_loads,
    read_free,
    read_loaded,
    respond,
)

Floats = NDArray[np.float64]

MOST_SWEEPS = 5  # over the nodes
# A parabola through the loads errs by less than this share of what the one before has missed them by, as it
# went on: |t (t - 1/2) (t - 1)| is at most 0.048 within a step, 3 a step further.
INTERPOLATED = 0.016
SETTLED = 0.01  # share of the loads' tolerance to which the iteration goes
EASY = 0.05  # share of the tolerance below which the next step may be twice as long
LEAST_TRAVEL = 0.01  # of the clearance: errors are relative to a force that moves the tip so far, or more


@jit_lean_sum
def take_step(
    pairs: CurvedPairs,
    curved: CurvedTables,
    tables: ModeTables,
    rim_speed: Floats,
    mode: int,
    level: int,
    step: float,
    tolerance: float,
    z: Floats,
    z_next: Floats,
    work: CurvedWork,
) -> tuple[bool, bool]:
    """Take a step of 2^level ticks (s) from coordinates `z` to `z_next`, by collocation.

    `work` holds forces and loads at the beginning, and is left with those in the middle and at the end.

    Parameters
    ----------
    tolerance : float
        Of the loads, relative to the largest force of the contact.

    Returns
    -------
    bool
        Whether the loads are found, and a parabola follows them. A step of one tick has no error to speak of.
    bool
        Whether the next step may be twice as long.
    """
    mask = int(tables.mask[mode])
    scale = work.span[LARGEST]
    for i in range(pairs.radius.size):
        if is_closed(mask, i):
            scale = max(scale, work.force[0, i], pairs.stiffness[i] * LEAST_TRAVEL * pairs.clearance[i])
    allowed = tolerance * scale
    predict_loads(mask, step, work)
    is_lone = lone_pair(mask, pairs.radius.size) == 0
    p_re, p_im = tables.power_re[mode, level], tables.power_im[mode, level]
    half_re, half_im = curved.half_re[mode], curved.half_im[mode]
    if level > 0:
        half_re, half_im = tables.power_re[mode, level - 1], tables.power_im[mode, level - 1]
    if is_lone:
        read_free(curved, mode, half_re, half_im, z[0], z[1], work.free[0])
        read_free(curved, mode, p_re, p_im, z[0], z[1], work.free[1])
    else:
        for node in range(N_NODE):
            respond(curved, mode, mask, node, work)
    missed, moved = 0.0, np.inf
    for sweep in range(MOST_SWEEPS):
        moved = 0.0
        for node in range(1, N_NODE):
            for i in range(work.load.shape[1]):
                for a in range(work.load.shape[2]):
                    work.last[i, a] = work.load[node, i, a]
            if is_lone:
                read_loaded(curved, mode, level, node, work)
                is_found = find_forces(pairs, curved, rim_speed, mode, mask, node, work)
            else:
                re, im = (work.middle[0], work.middle[1]) if node == 1 else (z_next[0], z_next[1])
                if node == 1:
                    propagate(half_re, half_im, z[0], z[1], re, im)
                else:
                    propagate(p_re, p_im, z[0], z[1], re, im)
                add_responses(curved, mode, level, node, work.response, re, im)
                is_found = evaluate(pairs, curved, rim_speed, mode, mask, node, re, im, work)
                respond(curved, mode, mask, node, work)
            if not is_found:
                return False, False
            moved = max(moved, load_change(pairs, mask, node, work.last, work))
        if sweep == 0:
            missed = INTERPOLATED * moved
            if missed > 2.0 * allowed and level > 0:
                return False, False
        if moved <= SETTLED * allowed:
            break
    if is_lone:
        for node in range(N_NODE):
            respond(curved, mode, mask, node, work)
        propagate(half_re, half_im, z[0], z[1], work.middle[0], work.middle[1])
        add_responses(curved, mode, level, 1, work.response, work.middle[0], work.middle[1])
        propagate(p_re, p_im, z[0], z[1], z_next[0], z_next[1])
        add_responses(curved, mode, level, 2, work.response, z_next[0], z_next[1])
    is_followed = level == 0 or (moved <= 4.0 * SETTLED * allowed and missed <= allowed)
    return is_followed, missed <= EASY * allowed


@jit_lean_sum
def go_on(mask: int, step: float, work: CurvedWork) -> None:
    """Make the end of a step (s) the beginning of the next."""
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for node in range(N_NODE):
                for a in range(work.load.shape[2]):
                    work.before[node, i, a] = work.load[node, i, a]
                work.span[LARGEST] = max(work.span[LARGEST], work.force[node, i])
            for a in range(work.load.shape[2]):
                work.load[0, i, a] = work.load[2, i, a]
        work.h[0, i], work.rate[0, i] = work.h[2, i], work.rate[2, i]
        work.force[0, i], work.slip[0, i] = work.force[2, i], work.slip[2, i]
        work.gap[0, 0, i], work.gap[1, 0, i] = work.gap[0, 2, i], work.gap[1, 2, i]
    work.span[BEFORE] = step
