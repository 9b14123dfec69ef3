"""Events of an instant: forces that keep contacts closed, and impulses of hard contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.gaps import see_bend, see_gap
from rubhpc.kernels.collocation.laws import sliding_coefficient, spring_force
from rubhpc.kernels.collocation.structures import (
    FRICTION,
    NORMAL,
    OPEN,
    RATE,
    SLIP,
    STICKING,
    Bodies,
    Solution,
)
from rubhpc.kernels.elimination import eliminate
from rubhpc.kernels.laws import LAGRANGE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST_SWEEPS = 2000
CONVERGED = 1e-14  # of the largest impulse


@linked_sum
def see_rates(bodies: Bodies, s: int, i: int, solution: Solution) -> None:
    """See the gap of pair i and its rate, and the slip, at the local motions `start`: the first node."""
    n_local, n_row = bodies.n_local, bodies.load.shape[0]
    first, row = i * n_local, i * s
    see_gap(bodies, i, solution.start, first, row, solution)
    rate, slip = 0.0, bodies.rim_speed[i]
    for a in range(n_local):
        rate += solution.normal[row, a] * solution.start[n_row + first + a]
        slip -= solution.tangent[row, a] * solution.start[n_row + first + a]
    solution.seen[row, RATE], solution.seen[row, SLIP] = rate, slip


@linked_sum
def coupling(bodies: Bodies, rows: Floats, row: int, i: int, columns: Floats, col: int, j: int) -> float:
    """Acceleration along a direction of pair i by a unit force along one of pair j, 1/kg."""
    n_local, compliance, total = bodies.n_local, bodies.compliance, 0.0
    for a in range(n_local):
        for b in range(n_local):
            total += rows[row, a] * compliance[i * n_local + a, j * n_local + b] * columns[col, b]
    return total


@linked_sum
def push_instant(bodies: Bodies, s: int, force: Floats, solution: Solution, x: Floats) -> None:
    """Add to the coordinates, or to their rates, the effect of impulses or forces (q, 2)."""
    n_local, kick = bodies.n_local, bodies.kick
    for i in range(force.shape[0]):
        if force[i, NORMAL] == 0.0 and force[i, FRICTION] == 0.0:
            continue
        for a in range(n_local):
            size = (
                force[i, NORMAL] * solution.normal[i * s, a] + force[i, FRICTION] * solution.tangent[i * s, a]
            )
            if size != 0.0:
                row = kick[i * n_local + a]
                for k in range(x.size):
                    x[k] += size * row[k]


@linked_sum
def find_forces(bodies: Bodies, s: int, state: Ints, solution: Solution, force: Floats) -> bool:
    """Forces (q, 2) at the local motions `start` that keep the second derivatives of closed gaps at zero.

    The same of the slip of sticking pairs; springs follow their law. False where there are none.
    """
    q, n_local, n_row = state.size, bodies.n_local, bodies.load.shape[0]
    start, normal, tangent = solution.start, solution.normal, solution.tangent
    rows, last = np.zeros((2 * q, 2 * q + 1)), 2 * q  # the last column is what is wanted
    for i in range(q):
        if state[i] != OPEN:
            see_rates(bodies, s, i, solution)
    for i in range(q):
        row, first = i * s, i * n_local
        rows[i, i], rows[q + i, q + i] = 1.0, 1.0
        if state[i] == OPEN:
            continue
        see_bend(bodies, row, solution)
        opening, slipping = 0.0, 0.0
        for a in range(n_local):
            opening += normal[row, a] * start[2 * n_row + first + a]
            slipping -= tangent[row, a] * start[2 * n_row + first + a]
            for b in range(n_local):
                both = start[n_row + first + a] * start[n_row + first + b]
                opening += both * solution.normal_bend[a, b]
                slipping -= both * solution.tangent_bend[a, b]
        if bodies.normal_law[i] == LAGRANGE:
            rows[i, last] = -opening
            for j in range(q):
                if state[j] != OPEN:
                    rows[i, j] = coupling(bodies, normal, row, i, normal, j * s, j)
                    rows[i, q + j] = coupling(bodies, normal, row, i, tangent, j * s, j)
        else:
            rows[i, last] = spring_force(bodies, i, solution.gap[row], solution.seen[row, RATE])[0]
        if state[i] == STICKING:
            rows[q + i, last] = slipping
            for j in range(q):
                if state[j] != OPEN:
                    rows[q + i, j] = coupling(bodies, tangent, row, i, normal, j * s, j)
                    rows[q + i, q + j] = coupling(bodies, tangent, row, i, tangent, j * s, j)
        else:
            rows[q + i, i] = -state[i] * sliding_coefficient(bodies, i, solution.seen[row, SLIP])[0]
    if not eliminate(rows, 2 * q):
        return False
    for i in range(q):
        force[i, NORMAL], force[i, FRICTION] = rows[i, last], rows[q + i, last]
    return True


@linked_sum
def find_impulses(
    bodies: Bodies, s: int, touching: Flags, kept: Flags, bound: Flags, least: float, solution: Solution
) -> None:
    """Impulses of the pairs in `touching` at the local motions `start`, into `solution.impulse`.

    Newton's restitution for approaches faster than `least` (m/s), and Coulomb's cone, or steady sliding: by
    Gauss and Seidel's method over the pairs. Pairs in `kept` were closed before: their gap rates are
    rounding; those in `bound` stay closed, by an impulse that may pull.
    """
    q, speed, impulse = touching.size, solution.speed, solution.impulse
    normal, tangent = solution.normal, solution.tangent
    for i in range(q):
        see_rates(bodies, s, i, solution)
        speed[i, NORMAL] = 0.0 if kept[i] else solution.seen[i * s, RATE]
        speed[i, FRICTION] = solution.seen[i * s, SLIP]
        impulse[i, NORMAL], impulse[i, FRICTION] = 0.0, 0.0
    for _ in range(MOST_SWEEPS):
        moved, largest = 0.0, 0.0
        for i in range(q):
            if not touching[i]:
                continue
            opening, slip = speed[i, NORMAL], speed[i, FRICTION]
            for j in range(q):
                if touching[j] and j != i:
                    opening += coupling(bodies, normal, i * s, i, normal, j * s, j) * impulse[j, NORMAL]
                    opening += coupling(bodies, normal, i * s, i, tangent, j * s, j) * impulse[j, FRICTION]
                    slip -= coupling(bodies, tangent, i * s, i, normal, j * s, j) * impulse[j, NORMAL]
                    slip -= coupling(bodies, tangent, i * s, i, tangent, j * s, j) * impulse[j, FRICTION]
            before = speed[i, NORMAL]
            wanted = -bodies.restitution[i] * min(before, 0.0) if -before > least else 0.0
            n, t = impulse_of(bodies, s, i, opening - wanted, slip, bound[i], solution)
            moved = max(moved, abs(n - impulse[i, NORMAL]), abs(t - impulse[i, FRICTION]))
            largest = max(largest, n)
            impulse[i, NORMAL], impulse[i, FRICTION] = n, t
        if moved <= CONVERGED * largest:
            break


@linked_sum
def impulse_of(
    bodies: Bodies, s: int, i: int, opening: float, slip: float, is_bound: bool, solution: Solution
) -> tuple[float, float]:
    """Impulses of one pair that would open at a rate and slip (m/s) without them."""
    normal, tangent, row = solution.normal, solution.tangent, i * s
    if opening >= 0.0 and not is_bound:
        return 0.0, 0.0
    a, b = (
        coupling(bodies, normal, row, i, normal, row, i),
        coupling(bodies, normal, row, i, tangent, row, i),
    )
    ratio = sliding_coefficient(bodies, i, solution.speed[i, FRICTION])[0]
    if not bodies.may_stick or opening >= 0.0:
        n = -opening / (a + ratio * b)
        return n, ratio * n
    c, d = (
        coupling(bodies, tangent, row, i, normal, row, i),
        coupling(bodies, tangent, row, i, tangent, row, i),
    )
    determinant = a * d - b * c
    n, t = (-opening * d - b * slip) / determinant, (a * slip + c * opening) / determinant
    if n >= 0.0 and abs(t) <= ratio * n:
        return n, t
    for sense in (-1.0, 1.0):
        n = -opening / (a + sense * ratio * b)
        if n >= 0.0 and (slip - (c + sense * ratio * d) * n) * sense >= 0.0:
            return n, sense * ratio * n
    return 0.0, 0.0


@linked_sum
def is_jammed(bodies: Bodies, s: int, i: int, state: int, solution: Solution) -> bool:
    """Whether forces press the gap of a sliding pair further closed: none obeys the laws (Painleve)."""
    row = i * s
    if state in (STICKING, OPEN) or bodies.normal_law[i] != LAGRANGE:
        return False
    ratio = state * sliding_coefficient(bodies, i, solution.seen[row, SLIP])[0]
    along = coupling(bodies, solution.normal, row, i, solution.normal, row, i)
    return not along + ratio * coupling(bodies, solution.normal, row, i, solution.tangent, row, i) > 0.0


@linked_sum
def stop_opening(bodies: Bodies, s: int, i: int, solution: Solution, x: Floats) -> None:
    """Take the small gap rate of a hard pair away, which a part of a step has left."""
    impulse, row = solution.impulse, i * s
    see_rates(bodies, s, i, solution)
    clear_impulses(impulse)
    along = coupling(bodies, solution.normal, row, i, solution.normal, row, i)
    impulse[i, NORMAL] = -solution.seen[row, RATE] / along
    push_instant(bodies, s, impulse, solution, x)


@linked_sum
def stop_slip(bodies: Bodies, s: int, i: int, solution: Solution, x: Floats) -> None:
    """Take the small slip of a pair away with which it begins or ends to stick."""
    impulse, row = solution.impulse, i * s
    see_rates(bodies, s, i, solution)
    clear_impulses(impulse)
    along = coupling(bodies, solution.tangent, row, i, solution.tangent, row, i)
    impulse[i, FRICTION] = solution.seen[row, SLIP] / along
    push_instant(bodies, s, impulse, solution, x)


@linked_sum
def clear_impulses(impulse: Floats) -> None:
    """Set all impulses (q, 2) to zero."""
    for i in range(impulse.shape[0]):
        impulse[i, NORMAL], impulse[i, FRICTION] = 0.0, 0.0
