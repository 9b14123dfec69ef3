"""A step of closed contacts with curved gaps, by collocation with an estimate of its error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.curved_contact import (
    BEFORE,
    LARGEST,
    N_NODE,
    PAST,
    PATIENCE,
    SLOPED,
    SOLVED,
    SWEEPS,
    CurvedPairs,
    CurvedTables,
    CurvedWork,
    is_closed,
)
from rubhpc.kernels.curved_forces import evaluate, find_gaps, find_lone_forces
from rubhpc.kernels.curved_joint import find_joint_system, move_jointly, take_joint_states
from rubhpc.kernels.curved_levels import fill_level
from rubhpc.kernels.curved_loads import (
    FORCES,
    GUESS,
    IMAGE,
    LOADS,
    MISSED,
    MOVE,
    give_loads,
    size_of,
    take_loads,
    weigh_loads,
)
from rubhpc.kernels.curved_newton import fill_slopes, find_system, move_by_newton, take_states
from rubhpc.kernels.curved_response import (
    arrive,
    leave_from,
    lone_pair,
    move_coordinates,
    predict_loads,
    read_free,
    read_loaded,
    respond,
    take_motion,
)
from rubhpc.kernels.curved_slopes import fill_answers

if TYPE_CHECKING:
    from rubhpc.kernels.contact_modes import ModeTables

Floats = NDArray[np.float64]

MOST_SWEEPS = 12  # over the nodes
# The error of a polynomial through the loads is below this fraction of the error of the extrapolated previous
# one: |t (t - 1/2) (t - 1) (t^2 - t + 1/7)| is at most 0.0029 within a step, 6.4 a step further.
INTERPOLATED = 5e-4
SETTLED = 0.1  # of the loads' tolerance, at which the iteration ends
OBSERVED_SETTLED = 0.1  # of that while recording, so that energies balance
EASY, VERY_EASY = 0.02, 5e-4  # of the tolerance, below which steps may be twice, four times as long
STALE = 2  # sweeps after which derivatives are computed again
ANSWERED = 0.5  # of the tolerance, below which one more correction has an error below `SETTLED`
HOPELESS = 6  # sweeps after which the residual must be below `FALLEN` of the first one
FALLEN = 0.1
PATIENT = 16  # steps after a failed one before a longer one is tried
QUICK = 5  # most sweeps of a step after which one twice as long may follow
LEAST_TRAVEL = 0.01  # of the clearance: errors are relative to a force that moves the tip at least so far


@linked_sum
def take_step(
    pairs: CurvedPairs,
    curved: CurvedTables,
    tables: ModeTables,
    rim_speed: Floats,
    mode: int,
    level: int,
    step: float,
    tolerance: float,
    is_recorded: bool,
    z: Floats,
    z_next: Floats,
    work: CurvedWork,
) -> tuple[bool, int]:
    """Take a step of 2^level ticks (s) from coordinates `z` to `z_next` by collocation.

    On entry `work` holds forces and loads at the beginning, on return those at the other nodes too.

    Parameters
    ----------
    tolerance : float
        Tolerance of the loads, relative to the largest force of the contact.
    is_recorded : bool
        Whether slips at the nodes must be those of the final loads.

    Returns
    -------
    bool
        Whether the loads are found and a polynomial follows them; a step of one tick is always accepted.
    int
        Binary logarithm of the allowed growth of the next step.
    """
    if not curved.is_filled[mode, level]:
        fill_level(curved, mode, level, step)
    mask = int(tables.mask[mode])
    scale = work.span[LARGEST]
    for i in range(pairs.radius.size):
        if is_closed(mask, i):
            scale = max(scale, work.force[0, i], pairs.stiffness[i] * LEAST_TRAVEL * pairs.clearance[i])
    allowed = tolerance * scale
    settled = SETTLED * allowed * (OBSERVED_SETTLED if is_recorded else 1.0)
    predict_loads(mask, step, work)
    is_lone = lone_pair(mask, pairs.radius.size) == 0
    if is_lone:
        read_free(curved, mode, level, z[0], z[1], work)
    else:
        leave_from(curved, mode, mask, level, z, work)
    point, n_load = work.point, work.load.shape[2]
    weigh_loads(pairs, mask, step, work)
    n = take_loads(mask, work, point[LOADS])
    for j in range(n):
        point[GUESS, j] = point[LOADS, j]
    is_newton, takes_slopes = work.span[SOLVED] == 1.0 * level if is_lone else work.is_solved[level], False
    moved, first, sweep, is_last = np.inf, np.inf, 0, False
    while True:
        has_none = not is_newton and work.span[SLOPED] == 0.0
        takes_slopes = sweep == STALE or (has_none and (sweep > 0 or work.span[SWEEPS] > 0.0))
        if is_lone:
            is_found = sweep_alone(pairs, curved, rim_speed, mode, level, takes_slopes, work)
        else:
            is_found = sweep_all(pairs, curved, rim_speed, mode, mask, level, takes_slopes, work)
        if not is_found:
            work.span[PATIENCE] = 1.0 * PATIENT
            return False, 0
        take_loads(mask, work, point[IMAGE])
        for j in range(n):
            point[MISSED, j] = point[IMAGE, j] - point[LOADS, j]
        moved = size_of(point[MISSED], n, n_load, point[FORCES])
        if moved <= settled or sweep == MOST_SWEEPS:
            if takes_slopes and not is_lone:
                work.is_solved[level], work.span[SLOPED] = False, 1.0  # its factors are outdated
            break
        first = moved if sweep == 0 else first
        if sweep >= HOPELESS and not moved <= FALLEN * first:
            break
        if takes_slopes or (not is_newton and work.span[SLOPED] == 1.0):
            if is_lone:
                is_newton = find_system(curved, mode, level, work)
                work.span[SOLVED] = 1.0 * level if is_newton else -1.0
            else:
                is_newton = find_joint_system(curved, mode, level, mask, work)
                work.is_solved[level], work.span[SLOPED] = is_newton, 1.0
        if is_newton:
            if is_lone:
                move_by_newton(work)
            else:
                move_jointly(curved, mode, level, mask, work)
            is_last = not is_recorded and moved <= ANSWERED * allowed
        else:
            for j in range(n):
                point[MOVE, j] = point[MISSED, j]
                point[LOADS, j] = point[IMAGE, j]
        if sweep == 0 and level > 0:
            missed = INTERPOLATED * size_of(point[MOVE], n, n_load, point[FORCES])
            if missed > 4.0 * allowed:
                return False, 0
        give_loads(mask, work)
        sweep += 1
        if is_last:
            if is_lone:
                take_states(work)
            else:
                take_joint_states(mask, work)
            break
    take_loads(mask, work, point[LOADS])
    for j in range(n):
        point[MOVE, j] = point[LOADS, j] - point[GUESS, j]
    missed = INTERPOLATED * size_of(point[MOVE], n, n_load, point[FORCES])
    is_settled, work.span[SWEEPS] = is_last or moved <= settled, 1.0 * sweep
    if is_settled:
        work.span[PATIENCE] = max(work.span[PATIENCE] - 1.0, 0.0)
    else:
        work.span[PATIENCE] = 1.0 * PATIENT
    if level > 0 and not (is_settled and missed <= allowed):
        return False, 0
    respond(curved, mode, mask, 0, N_NODE, work)
    if is_lone:
        move_coordinates(curved, mode, level, N_NODE - 1, z, work, z_next)
    else:
        for node in range(1, N_NODE):
            arrive(curved, mode, level, node, work, z_next)
            find_gaps(pairs, curved, mode, mask, node, z_next[0], z_next[1], work)
    growth = 0
    if missed <= EASY * allowed and sweep <= QUICK and work.span[PATIENCE] == 0.0:
        growth = 2 if missed <= VERY_EASY * allowed else 1
    return True, growth


@linked_sum
def sweep_alone(
    pairs: CurvedPairs,
    curved: CurvedTables,
    rim_speed: Floats,
    mode: int,
    level: int,
    takes_slopes: bool,
    work: CurvedWork,
) -> bool:
    """Loads of the single pair at the nodes under the current loads, and derivatives if requested.

    Returns False where no forces are found.
    """
    read_loaded(curved, mode, level, work)
    is_found = True
    for node in range(1, N_NODE):
        take_motion(curved.bound.shape[2], node, work)
        is_found = is_found and find_lone_forces(pairs, curved, rim_speed, mode, node, work)
        if takes_slopes:
            fill_slopes(pairs, curved, mode, node, work)
    return is_found


@linked_sum
def sweep_all(
    pairs: CurvedPairs,
    curved: CurvedTables,
    rim_speed: Floats,
    mode: int,
    mask: int,
    level: int,
    takes_slopes: bool,
    work: CurvedWork,
) -> bool:
    """Loads of all closed pairs at the nodes, as `sweep_alone`."""
    respond(curved, mode, mask, 1, N_NODE, work)
    for node in range(1, N_NODE):
        arrive(curved, mode, level, node, work, work.middle)
        if not evaluate(pairs, curved, rim_speed, mode, mask, node, work.middle[0], work.middle[1], work):
            return False
        if takes_slopes and not fill_answers(pairs, curved, mode, mask, node, work):
            return False
    return True


@linked_sum
def go_on(mask: int, step: float, work: CurvedWork) -> None:
    """Make the end of a step (s) the beginning of the next one."""
    follow_loads(mask, step, step, work)
    end = N_NODE - 1
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for node in range(N_NODE):
                work.span[LARGEST] = max(work.span[LARGEST], work.force[node, i])
            for a in range(work.load.shape[2]):
                work.load[0, i, a] = work.load[end, i, a]
        work.h[0, i], work.rate[0, i] = work.h[end, i], work.rate[end, i]
        work.force[0, i], work.slip[0, i] = work.force[end, i], work.slip[end, i]
        work.gap[0, 0, i], work.gap[1, 0, i] = work.gap[0, end, i], work.gap[1, end, i]


@linked_sum
def follow_loads(mask: int, step: float, past: float, work: CurvedWork) -> None:
    """Extrapolate the next loads from those of a step (s) that began a time `past` (s) before."""
    for i in range(work.load.shape[1]):
        if is_closed(mask, i):
            for node in range(N_NODE):
                for a in range(work.load.shape[2]):
                    work.before[node, i, a] = work.load[node, i, a]
    work.span[BEFORE], work.span[PAST] = step, past
