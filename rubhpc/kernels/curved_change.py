"""Events of contacts with curved gaps: impacts along the current normals, and the pairs closed afterwards."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.accumulators import IMPACT, PRESSING, Accumulator, observe_solution
from rubhpc.kernels.complementarity import UNSOLVED, residual_of, solve_active, solve_complementarity
from rubhpc.kernels.contact_modes import Reduced
from rubhpc.kernels.curved_contact import CurvedPairs, CurvedWork, is_closed
from rubhpc.kernels.curved_forces import fill_geometry
from rubhpc.kernels.mode_change import (
    AT_REST,
    OPENING,
    EventWork,
    hidden_flight,
    least_flight,
    observe_impact,
    product,
)

Floats = NDArray[np.float64]


@linked_sum
def look_at(pairs: CurvedPairs, i: int, motion: Floats, work: CurvedWork) -> float:
    """Fill geometry, Jacobian and force direction of pair i from a reduced motion (2 n,).

    Returns the acceleration of its gap at constant rates, m/s2.
    """
    n_row, n = pairs.row.shape[1], pairs.row.shape[2]
    for a in range(n_row):
        row = pairs.row[i, a]
        work.motion[0, i, a], work.motion[1, i, a] = product(row, motion[:n]), product(row, motion[n:])
    _, bends = fill_geometry(pairs, i, n_row - 1, work)
    for k in range(n):
        rate, force = 0.0, 0.0
        for a in range(n_row):
            rate += work.jacobian[i, a] * pairs.row[i, a, k]
            force += work.direction[i, a] * pairs.row[i, a, k]
        work.shape[0, i, k], work.shape[1, i, k] = rate, force
    return bends


@linked_sum
def change_curved(
    pairs: CurvedPairs,
    reduced: Reduced,
    closed: int,
    crossing: int,
    spin: float,
    moment: float,
    cosine: float,
    sine: float,
    motion: Floats,
    is_recorded: bool,
    work: CurvedWork,
    events: EventWork,
    accumulator: Accumulator,
) -> int:
    """Impact, then the set of pairs closed afterwards, as `mode_change.change_contacts`; -1: there is none.

    Gap rates and forces are those of the current normals, which an impact does not turn.
    """
    q, n = reduced.gap_jacobian.shape
    candidates = (closed & ~crossing) | (crossing & ~closed)
    velocity = motion[n:]
    force, speed, active, elimination = events.force, events.speed, events.active, events.elimination
    rate_row, force_row, delassus = work.shape[0], work.shape[1], work.matrix
    for i in range(q):
        if is_closed(candidates, i):
            look_at(pairs, i, motion, work)
    for i in range(q):
        for k in range(q):
            both = is_closed(candidates, i) and is_closed(candidates, k)
            delassus[i, k] = product(rate_row[i], force_row[k]) if both else 0.0
        if not is_closed(candidates, i):
            delassus[i, i] = 1.0
    whole = Reduced(
        stiffness=reduced.stiffness,
        damping=reduced.damping,
        force_cosine=reduced.force_cosine,
        force_sine=reduced.force_sine,
        gap_jacobian=rate_row,
        force_direction=force_row,
        slip=reduced.slip,
        delassus=delassus,
        friction=reduced.friction,
        radius=reduced.radius,
        rim_speed=reduced.rim_speed,
        restitution=reduced.restitution,
        spring=reduced.spring,
        damper=reduced.damper,
        clearance=reduced.clearance,
        translations=reduced.translations,
        displacement_limit=reduced.displacement_limit,
        overlap=reduced.overlap,
    )
    for i in range(q):
        speed[i] = product(rate_row[i], velocity) if is_closed(candidates, i) else np.inf
        active[i] = speed[i] < 0.0
        if active[i]:
            speed[i] *= 1.0 + reduced.restitution
    pivots = solve_complementarity(delassus, speed, 1e-14, force, active, elimination)
    if pivots == UNSOLVED:
        return -1
    if is_recorded:
        residual, moved = residual_of(delassus, speed, force)
        observe_solution(IMPACT, pivots, residual, moved, accumulator)
    for i in range(q):
        if force[i] > 0.0:
            if is_recorded:
                observe_impact(whole, i, spin, force[i], velocity, accumulator)
            for k in range(n):
                velocity[k] += force_row[i, k] * force[i]
    for i in range(q):
        speed[i] = np.inf
        if is_closed(candidates, i):
            acceleration = look_at(pairs, i, motion, work)
            for k in range(n):
                acceleration += rate_row[i, k] * (
                    reduced.force_cosine[k] * cosine
                    + reduced.force_sine[k] * sine
                    - product(reduced.stiffness[k], motion[:n])
                    - product(reduced.damping[k], velocity)
                )
            # A pair that parts so slowly that it is pressed together again at once counts as closed.
            time = least_flight(acceleration, moment, hidden_flight(reduced))
            if product(rate_row[i], velocity) <= OPENING + max(-acceleration, 0.0) * time:
                speed[i] = acceleration
        active[i] = speed[i] < 0.0
    pivots = solve_complementarity(delassus, speed, 1e-12, force, active, elimination)
    if pivots == UNSOLVED:
        return -1
    if is_recorded:
        residual, moved = residual_of(delassus, speed, force)
        observe_solution(PRESSING, pivots, residual, moved, accumulator)
    remaining = 0
    parts = 0.0
    for i in range(q):
        active[i] = force[i] > 0.0
        if active[i]:
            remaining |= 1 << i
            speed[i] = product(rate_row[i], velocity)
            parts = max(parts, speed[i])
        elif is_recorded and reduced.restitution > 0.0 and is_closed(crossing & ~closed, i):
            accumulator.n_contact[i] += 1  # it bounces
    if parts > AT_REST:  # where it parts for a moment, the impulse that closes it again is missing
        if not solve_active(delassus, speed, active, force, elimination):
            return -1
        for i in range(q):
            if active[i]:
                if is_recorded:
                    observe_impact(whole, i, spin, force[i], velocity, accumulator)
                for k in range(n):
                    velocity[k] += force_row[i, k] * force[i]
    return remaining
