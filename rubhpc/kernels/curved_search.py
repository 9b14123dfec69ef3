"""Where gaps that are curved close, and where closed ones open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.contact_modes import ModeTables, bounded, dot, event_free_interval
from rubhpc.kernels.curved_contact import CurvedPairs, CurvedTables, CurvedWork, is_closed
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
def closed_crossing(closed: int, step: float, work: CurvedWork) -> int:
    """Set of the pairs whose force or, of those open, gap is negative at a node of a step (s)."""
    crossing = int(np.int64(0))
    for i in range(work.h.shape[1]):
        if is_closed(closed, i):
            first, middle, last = work.force[0, i], work.force[1, i], work.force[2, i]
            if min(middle, last) < 0.0 or lowest(first, middle, last) < 0.0 < first:
                crossing |= 1 << i
        elif min(work.gap[0, 1, i], work.gap[0, 2, i]) < -GAP_TOLERANCE:
            crossing |= 1 << i
    return crossing


@jit_lean_sum
def lowest(first: float, middle: float, last: float) -> float:
    """Least value of the parabola through the beginning, middle and end of a step, within it."""
    slope, bend = 4.0 * middle - 3.0 * first - last, 2.0 * (first - 2.0 * middle + last)
    if bend > 0.0 and 0.0 < -slope < 2.0 * bend:
        return first - 0.25 * slope * slope / bend
    return min(first, middle, last)
