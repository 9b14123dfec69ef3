"""Search for the closing and opening of curved gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import ModeTables, bounded, dot, event_free_interval
from rubhpc.kernels.curved_contact import (
    ALL,
    LAGRANGE,
    N_NODE,
    NODES,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)
from rubhpc.kernels.curved_forces import fill_geometry, read_motion
from rubhpc.kernels.mode_change import GAP_TOLERANCE

Floats = NDArray[np.float64]

N_LOOK = 32  # intervals of a step that are searched for the first root
N_BISECTION = 24  # bisections that locate it to less than a tick of the longest step
N_NEWTON = 4  # iterations for a root beyond the step's end


@linked_sum
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
    """Time, s, in which no gap closes while all are open; it need not be longer than `enough`.

    The gap along the stator's axis is a lower bound. Where it is too small, the linearisation along the
    current normal is used: a convex function of the motion stays above it.
    """
    free = event_free_interval(
        tables.switch_re, tables.switch_im, tables.rate_re, tables.rate_im, tables.bound, mode, z_re, z_im
    )
    if free >= enough:
        return free
    d = curved.bound.shape[2]
    read_motion(curved, mode, 0, ALL, z_re, z_im, work.motion)
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


@linked_sum
def open_crossing(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    mode: int,
    overlap: float,
    z_re: Floats,
    z_im: Floats,
    work: CurvedWork,
) -> int:
    """Set of the pairs whose gap is negative, while all are open.

    A pair that parts is none of them up to an `overlap` (m): modes that follow the speed leave one as they
    are entered.
    """
    crossing = int(np.int64(0))
    is_near = False
    for i in range(pairs.radius.size):
        gap = dot(tables.switch_re[mode, i], tables.switch_im[mode, i], z_re, z_im)
        is_near = is_near or gap < -GAP_TOLERANCE
    if not is_near:
        return crossing
    read_motion(curved, mode, 0, ALL, z_re, z_im, work.motion)
    for i in range(pairs.radius.size):
        d = curved.bound.shape[2]
        gap, _ = fill_geometry(pairs, i, d, work)
        rate = 0.0
        for j in range(d):
            rate += work.jacobian[i, j] * work.motion[1, i, j]
        if has_closed(gap, rate, overlap):
            crossing |= 1 << i
    return crossing


@linked_sum
def has_closed(gap: float, rate: float, overlap: float) -> bool:
    """Whether an open gap (m) with its rate (m/s) has closed, but for an `overlap` (m) as it parts."""
    return gap < -GAP_TOLERANCE and (rate < 0.0 or gap < -overlap)


@linked_sum
def closed_crossing(closed: int, overlap: float, work: CurvedWork) -> int:
    """Set of the pairs whose force (closed) or gap (open) is negative at or between the nodes of a step.

    `overlap` (m) as in `open_crossing`.
    """
    crossing = int(np.int64(0))
    for i in range(work.h.shape[1]):
        least = np.inf
        for node in range(1, N_NODE):
            if is_closed(closed, i):
                least = min(least, work.force[node, i])
            elif has_closed(work.gap[0, node, i], work.gap[1, node, i], overlap):
                least = -1.0
        if is_closed(closed, i) and work.force[0, i] > 0.0:
            for node in range(2):
                least = min(least, lowest(work.force[:, i], 2 * node))
        if least < 0.0:
            crossing |= 1 << i
    return crossing


@linked_sum
def first_crossing(closed: int, crossing: int, work: CurvedWork) -> float:
    """Fraction of a step at which the first of the pairs `crossing` reaches zero, by polynomials."""
    first = 1.0
    for i in range(work.h.shape[1]):
        if is_closed(crossing, i):
            fill_course(closed, i, work)
            first = min(first, first_root(work.course))
    return first


@linked_sum
def next_crossing(closed: int, work: CurvedWork) -> float:
    """Distance of the first zero of a force beyond the end of a step, over its length; infinite if none."""
    nearest = np.inf
    for i in range(work.h.shape[1]):
        if is_closed(closed, i):
            fill_course(closed, i, work)
            nearest = min(nearest, next_root(work.course) - 1.0)
    return nearest


@linked_sum
def fill_course(closed: int, i: int, work: CurvedWork) -> None:
    """Fill `work.course` with the force of pair i, or its gap if open, by powers of the step's fraction."""
    course = work.course
    for power in range(N_NODE):
        course[power] = 0.0
    for node in range(N_NODE):
        value = work.force[node, i] if is_closed(closed, i) else work.gap[0, node, i] + GAP_TOLERANCE
        for power in range(N_NODE):
            course[power] += value * LAGRANGE[node, power]


@linked_sum
def value_at(course: Floats, share: float) -> float:
    """Value of a polynomial by powers."""
    total = 0.0
    for power in range(course.size - 1, -1, -1):
        total = total * share + course[power]
    return total


@linked_sum
def first_root(course: Floats) -> float:
    """First root between 0 and 1 of a polynomial that begins above zero; without a root, its minimum."""
    share, least, where = 0.0, np.inf, 0.0
    for part in range(1, N_LOOK + 1):
        share = part / N_LOOK
        value = value_at(course, share)
        if value < least:
            least, where = value, share
        if value < 0.0:
            break
    if not least < 0.0:
        return where
    before = share - 1.0 / N_LOOK
    for _ in range(N_BISECTION):
        middle = 0.5 * (before + share)
        if value_at(course, middle) < 0.0:
            share = middle
        else:
            before = middle
    return before


@linked_sum
def next_root(course: Floats) -> float:
    """Root of a polynomial beyond 1, by Newton's method; infinite where it does not fall."""
    share = 1.0
    for _ in range(N_NEWTON):
        slope = 0.0
        for power in range(course.size - 1, 0, -1):
            slope = slope * share + power * course[power]
        if not slope < 0.0:
            return np.inf
        share -= value_at(course, share) / slope
    return share if share >= 1.0 else np.inf


@linked_sum
def lowest(value: Floats, first: int) -> float:
    """Least value, between the first and the third, of the parabola through three values at nodes."""
    a, b = NODES[first + 1] - NODES[first], NODES[first + 2] - NODES[first]
    rise, whole = (value[first + 1] - value[first]) / a, (value[first + 2] - value[first]) / b
    bend = (whole - rise) / (b - a)
    slope = rise - a * bend
    if bend > 0.0 and 0.0 < -slope < 2.0 * b * bend:
        return float(value[first] - 0.25 * slope * slope / bend)
    return float(min(value[first], value[first + 2]))
