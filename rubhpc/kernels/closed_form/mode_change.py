"""Events of the exact integrator: impacts, and the pairs closed afterwards."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.accumulators import (
    IMPACT,
    IMPACT_LOSS,
    PRESSING,
    Accumulator,
    observe_rub,
    observe_solution,
)
from rubhpc.kernels.complementarity import UNSOLVED, residual_of, solve_active, solve_complementarity
from rubhpc.kernels.contact_modes import Reduced  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]

OPENING = 1e-9  # m/s, above which a pair parts
AT_REST = 1e-12  # m/s, of gaps that stay closed
GAP_TOLERANCE = 1e-14  # m, of overlap, above which a gap has closed
HIDDEN = 8.0 * GAP_TOLERANCE  # m, first speed squared over deceleration of a flight four tolerances high
SUSTAINED = 0.08  # the same over the overlap that followed modes may leave as a pair opens


class EventWork(Struct):
    """Work space of an event, q pairs."""

    force: Floats  # (q,)
    given: Floats  # (q,), normal impulses of the event, N s
    speed: Floats  # (q,)
    impulse: Floats  # (q,), accumulated before the event, N s
    active: NDArray[np.bool_]  # (q,)
    elimination: Floats  # (q, q + 1)


def event_work(q: int) -> EventWork:
    """Work space of the events of q pairs."""
    return EventWork(
        force=np.zeros(q),
        given=np.zeros(q),
        speed=np.zeros(q),
        impulse=np.zeros(q),
        active=np.zeros(q, dtype=np.bool_),
        elimination=np.zeros((q, q + 1)),
    )


@linked_sum
def hidden_flight(reduced: Reduced) -> float:
    """First speed squared over deceleration, m, of flights that are not resolved.

    Modes that follow the speed err as each flight enters them: bounces, and two pairs that throw each other
    open, would go on at the speed that this brings.
    """
    return max(HIDDEN, SUSTAINED * reduced.overlap)


@linked_sum
def least_flight(acceleration: float, moment: float, hidden: float) -> float:
    """Time (s) within which a pair that parts has to be pressed together to count as closed.

    It is `moment` (s) or longer, where flights are `hidden` (`hidden_flight`). A flight within the tolerance
    of gaps would end at a speed due to that, and two pairs that throw each other open would never come to
    rest. The acceleration (m/s2) is the gap's.
    """
    pressed = max(-acceleration, 0.0)
    return float(np.sqrt(hidden / pressed)) if 0.0 < pressed * moment * moment < hidden else moment


@linked_sum
def product(a: Floats, b: Floats) -> float:
    """Inner product; `np.dot` would call a library for a dozen numbers."""
    total = 0.0
    for k in range(a.size):
        total += a[k] * b[k]
    return total


@jit_sum
def change_contacts(
    reduced: Reduced,
    closed: int,
    crossing: int,
    spin: float,
    moment: float,
    cosine: float,
    sine: float,
    motion: Floats,
    is_recorded: bool,
    work: EventWork,
    accumulator: Accumulator,
) -> int:
    """Impact, then the set of pairs closed afterwards; -1 where there is none.

    `closed` are the pairs closed before, `crossing` those whose gap closes or whose force vanishes now. Every
    candidate that closes rebounds with its restitution (0: inelastic). Among those that do not part for
    longer than `moment` (s), the accelerations decide. Fills the impulses `work.given`.
    """
    q, n = reduced.gap_jacobian.shape
    force, given, speed, active = work.force, work.given, work.speed, work.active
    hidden = hidden_flight(reduced)
    candidates = (closed & ~crossing) | (crossing & ~closed)
    velocity = motion[n:]
    for i in range(q):
        given[i] = 0.0
        speed[i] = product(reduced.gap_jacobian[i], velocity) if (candidates >> i) & 1 else np.inf
        active[i] = speed[i] < 0.0
        if active[i]:
            speed[i] *= 1.0 + reduced.restitution
    pivots = solve_complementarity(reduced.delassus, speed, 1e-14, force, active, work.elimination)
    if pivots == UNSOLVED:
        return -1
    if is_recorded:
        residual, moved = residual_of(reduced.delassus, speed, force)
        observe_solution(IMPACT, pivots, residual, moved, accumulator)
    for i in range(q):
        if force[i] > 0.0:
            if is_recorded:
                observe_impact(reduced, i, spin, force[i], velocity, accumulator)
            given[i] = force[i]
            for k in range(n):
                velocity[k] += reduced.force_direction[i, k] * force[i]
    for i in range(q):
        speed[i] = np.inf
        if (candidates >> i) & 1:
            acceleration = 0.0
            for k in range(n):
                acceleration += reduced.gap_jacobian[i, k] * (
                    reduced.force_cosine[k] * cosine
                    + reduced.force_sine[k] * sine
                    - product(reduced.stiffness[k], motion[:n])
                    - product(reduced.damping[k], velocity)
                )
            # A pair that parts so slowly that it is pressed together again at once counts as closed.
            time = least_flight(acceleration, moment, hidden)
            if product(reduced.gap_jacobian[i], velocity) <= OPENING + max(-acceleration, 0.0) * time:
                speed[i] = acceleration
        active[i] = speed[i] < 0.0
    pivots = solve_complementarity(reduced.delassus, speed, 1e-12, force, active, work.elimination)
    if pivots == UNSOLVED:
        return -1
    if is_recorded:
        residual, moved = residual_of(reduced.delassus, speed, force)
        observe_solution(PRESSING, pivots, residual, moved, accumulator)
    remaining = 0
    parts = 0.0
    for i in range(q):
        active[i] = force[i] > 0.0
        if active[i]:
            remaining |= 1 << i
            speed[i] = product(reduced.gap_jacobian[i], velocity)
            parts = max(parts, speed[i])
        elif is_recorded and reduced.restitution > 0.0 and (crossing & ~closed) >> i & 1:
            accumulator.n_contact[i] += 1  # it bounces
    if parts > AT_REST:  # where it parts for a moment, the impulse that closes it again is missing
        if not solve_active(reduced.delassus, speed, active, force, work.elimination):
            return -1
        for i in range(q):
            if active[i]:
                if is_recorded:
                    observe_impact(reduced, i, spin, force[i], velocity, accumulator)
                given[i] += force[i]
                for k in range(n):
                    velocity[k] += reduced.force_direction[i, k] * force[i]
    return remaining


@linked_sum
def observe_impact(
    reduced: Reduced, i: int, spin: float, impulse: float, velocity: Floats, accumulator: Accumulator
) -> None:
    """Add an impact's impulse (N s) and work to the accumulator; `velocity` (n,) is that before it."""
    friction = reduced.friction[i] * impulse
    # An impulse does work at the mean of the velocities before and after; the force direction includes
    # friction.
    closing = product(reduced.gap_jacobian[i], velocity) + 0.5 * impulse * reduced.delassus[i, i]
    total = product(reduced.force_direction[i], velocity) + 0.5 * impulse * product(
        reduced.force_direction[i], reduced.force_direction[i]
    )
    drive = friction * reduced.radius[i] * abs(spin)
    if reduced.friction[i] > 0.0:
        change = impulse * (
            product(reduced.force_direction[i], reduced.force_direction[i]) - reduced.delassus[i, i]
        )
        gain = (total - closing - 0.5 * change) / reduced.friction[i]  # of the slip over the rim's own speed
        slip = reduced.radius[i] * abs(spin) - gain
        accumulator.least_slip[i] = min(accumulator.least_slip[i], slip, slip - change / reduced.friction[i])
    friction_work = drive - (total - closing) * impulse
    observe_rub(i, impulse, drive, friction_work, accumulator)
    accumulator.energy[IMPACT_LOSS] -= closing * impulse
