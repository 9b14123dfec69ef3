"""Where gaps that are curved close, and where closed ones open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.contact_modes import ModeTables, bounded, dot, event_free_interval
from rubhpc.kernels.curved_contact import (
    N_NODE,
    NODES,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)
from rubhpc.kernels.curved_forces import fill_geometry, read_motion
from rubhpc.kernels.event_steps import GAP_TOLERANCE

Floats = NDArray[np.float64]


@jit_lean_sum
def curved_free_interval(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    mode: int,
    enough: float,
    z_re: Floats,
    z_im: Floats,
    work: CurvedWork,
) -> float:
    """Time, s, in which no gap closes, all being open; it need not be longer than `enough`.

    A gap along the stator's axis is the smaller one. Where it does not do, the gap is continued along its
    momentary normal, below which a convex function of the motion does not go.
    """
    free = event_free_interval(
        tables.switch_re, tables.switch_im, tables.rate_re, tables.rate_im, tables.bound, mode, z_re, z_im
    )
    if free >= enough:
        return free
    d = curved.bound.shape[2]
    read_motion(curved, mode, 0, z_re, z_im, work.motion)
    free = np.inf
    for i in range(pairs.radius.size):
        gap, _ = fill_geometry(pairs, i, d, work)
        rate, bound = 0.0, 0.0
        for j in range(d):
            rate += work.jacobian[i, j] * work.motion[1, i, j]
            bound += abs(work.jacobian[i, j]) * bounded(curved.bound[mode, i, j], z_re, z_im)
        if not gap > 0.0:
            free = 0.0
        elif bound > 0.0:
            free = min(free, (rate + np.sqrt(rate * rate + 2.0 * bound * gap)) / bound)
        elif rate < 0.0:
            free = min(free, -gap / rate)
    return free


@jit_lean_sum
def open_crossing(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    mode: int,
    z_re: Floats,
    z_im: Floats,
    work: CurvedWork,
) -> int:
    """Set of the pairs, all open, whose gap is negative."""
    crossing = int(np.int64(0))
    is_near = False
    for i in range(pairs.radius.size):
        gap = dot(tables.switch_re[mode, i], tables.switch_im[mode, i], z_re, z_im)
        is_near = is_near or gap < -GAP_TOLERANCE
    if not is_near:
        return crossing
    read_motion(curved, mode, 0, z_re, z_im, work.motion)
    for i in range(pairs.radius.size):
        gap, _ = fill_geometry(pairs, i, curved.bound.shape[2], work)
        if gap < -GAP_TOLERANCE:
            crossing |= 1 << i
    return crossing


@jit_lean_sum
def closed_crossing(closed: int, work: CurvedWork) -> int:
    """Set of the pairs whose force or, of those open, gap is negative at or between the nodes of a step."""
    crossing = int(np.int64(0))
    for i in range(work.h.shape[1]):
        least = np.inf
        for node in range(1, N_NODE):
            if is_closed(closed, i):
                least = min(least, work.force[node, i])
            else:
                least = min(least, work.gap[0, node, i] + GAP_TOLERANCE)
        if is_closed(closed, i) and work.force[0, i] > 0.0:
            for node in range(2):
                least = min(least, lowest(work.force[:, i], 2 * node))
        if least < 0.0:
            crossing |= 1 << i
    return crossing


@jit_lean_sum
def lowest(value: Floats, first: int) -> float:
    """Least value, between the first and the third, of the parabola through three values at nodes."""
    a, b = NODES[first + 1] - NODES[first], NODES[first + 2] - NODES[first]
    rise, whole = (value[first + 1] - value[first]) / a, (value[first + 2] - value[first]) / b
    bend = (whole - rise) / (b - a)
    slope = rise - a * bend
    if bend > 0.0 and 0.0 < -slope < 2.0 * b * bend:
        return float(value[first] - 0.25 * slope * slope / bend)
    return float(min(value[first], value[first + 2]))
