"""Entering a contact mode with curved gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.case_progress import NONE, Clock, Progress, shaft_turn
from rubhpc.kernels.contact_modes import DYING, FORCED_LEVEL, ModeTables, Reduced, enter, enter_rest
from rubhpc.kernels.curved_contact import (
    ALONG,
    BEFORE,
    KEPT,
    LARGEST,
    PAST,
    PATIENCE,
    SLOPED,
    SOLVED,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)
from rubhpc.kernels.curved_forces import evaluate, find_gaps
from rubhpc.kernels.mode_change import GAP_TOLERANCE, product

Floats = NDArray[np.float64]


@linked_sum
def enter_curved(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    reduced: Reduced,
    clock: Clock,
    found: int,
    progress: Progress,
    z: Floats,
    motion: Floats,
    work: CurvedWork,
) -> bool:
    """Enter contact mode `found` with the reduced motion (2 n,); False where no forces are found."""
    q, n = reduced.gap_jacobian.shape
    closed = int(tables.mask[found])
    for i in range(q):
        work.h[0, i], work.rate[0, i] = 0.0, 0.0
        if is_closed(closed, i):
            work.h[0, i] = -pairs.clearance[i] - product(pairs.row[i, ALONG], motion[:n])
            work.rate[0, i] = -product(pairs.row[i, ALONG], motion[n:])
    for i in range(q):
        if is_closed(closed, i):
            for k in range(n):
                motion[k] += curved.shift[found, i, k] * work.h[0, i]
                motion[n + k] += curved.shift[found, i, k] * work.rate[0, i]
    enter_keeping(tables, reduced, clock, found, progress.tick, z, motion, work)
    progress.mode, progress.wanted, progress.entered = found, NONE, progress.tick
    progress.resolved_level, progress.halving_level, progress.is_after_event = FORCED_LEVEL, NONE, 1
    progress.contact_age = NONE
    work.span[BEFORE], work.span[PAST], work.span[LARGEST], work.span[PATIENCE] = 0.0, 0.0, 0.0, 0.0
    work.span[SOLVED], work.span[SLOPED] = 1.0 * NONE, 0.0
    work.is_solved[:] = False
    if closed == 0:
        return True
    if not evaluate(pairs, curved, reduced.rim_speed, found, closed, 0, z[0], z[1], work):
        return False
    find_gaps(pairs, curved, found, closed, 0, z[0], z[1], work)
    return True


@linked_sum
def enter_keeping(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    found: int,
    tick: int,
    z: Floats,
    motion: Floats,
    work: CurvedWork,
) -> None:
    """Enter contact mode `found` with a reduced motion (2 n,); fast modes may go on as they were."""
    cosine, sine = shaft_turn(clock, tick)
    slowest, before, pace = work.span[KEPT], work.transient, tables.pace[found]
    work.span[KEPT] = 0.0
    for k in range(z.shape[1]):
        before[0, k], before[1, k] = z[0, k], z[1, k]
    enter(tables, found, reduced.clearance, cosine, sine, motion, z)
    if reduced.overlap > GAP_TOLERANCE:
        enter_rest(
            tables.motion_re[found],
            tables.motion_im[found],
            tables.enter_re[found],
            tables.enter_im[found],
            motion,
            z,
        )
    for k in range(tables.n_eigenmode[found]):
        if slowest > 0.0 and (pace[k] > slowest or pace[k] == DYING):
            z[0, k], z[1, k] = before[0, k], before[1, k]
