"""The contact forces of a step: those that close the gaps, or that laws of impact and friction require."""

from __future__ import annotations

from rubhpc.kernels._jit import jit, linked
from rubhpc.kernels.central_difference.coulomb_friction import fill_slip, friction_residual, solve_friction
from rubhpc.kernels.complementarity import UNSOLVED, natural_residual, solve_complementarity
from rubhpc.kernels.contact_pairs import (
    N_DEGREE,
    Pairs,
    Workspace,
    fill_directions,
    fill_friction_direction,
    fill_matrix,
    fill_moved,
    pair_normal_and_gap,
)
from rubhpc.kernels.laws import gap_target, is_bouncing, is_penalty, may_stick, softness

GAP_TOLERANCE = 1e-14  # m, to which a closed gap is zero
N_NEWTON = 25  # iterations for the curved gap; two or three are usual
MOST_RESIDUAL = 1e-6  # over the displacement by the forces; rounding leaves 1e-9, more is no solution


@jit
def fill_compliances(pairs: Pairs, work: Workspace, step: float) -> None:
    """Fill the changes of gaps and slips by unit forces over a step; the directions are already filled."""
    if may_stick(pairs.law):
        fill_matrix(pairs, work.gap_jacobian, work.gap_jacobian, work.matrix)
        fill_matrix(pairs, work.gap_jacobian, work.friction_direction, work.coupling)
        fill_matrix(pairs, work.friction_direction, work.gap_jacobian, work.tangential[0])
        fill_matrix(pairs, work.friction_direction, work.friction_direction, work.tangential[1])
        for i in range(pairs.radius.size):
            for j in range(pairs.radius.size):
                work.tangential[0, i, j] *= -1.0
                work.tangential[1, i, j] *= -1.0
    else:
        fill_matrix(pairs, work.gap_jacobian, work.force_direction, work.matrix)
    for i in range(pairs.radius.size):
        work.matrix[i, i] += softness(pairs.law, step)


@linked
def fill_targets(pairs: Pairs, work: Workspace, step: float) -> None:
    """Fill the gap required of each pair at the end of the step, and the delay of its impact."""
    for i in range(pairs.radius.size):
        _, _, gap = pair_normal_and_gap(pairs, i, work.now[i])
        opening = 0.0
        for a in range(N_DEGREE):
            opening += work.gap_jacobian[i, a] * work.rate[i, a]
        work.target[i], work.delay[i] = gap_target(pairs.law, step, gap, opening, work.gap[i])


@linked
def fill_residual(pairs: Pairs, work: Workspace) -> None:
    """Fill the deviation of gaps and slips from the laws at the end, and their change by the forces."""
    distance, moved = 0.0, 0.0
    for i in range(pairs.radius.size):
        end = work.gap[i] - work.target[i]
        for j in range(pairs.radius.size):
            end += work.matrix[i, j] * work.force[j]
            if may_stick(pairs.law):
                end += work.coupling[i, j] * work.traction[j]
        distance = max(distance, natural_residual(work.matrix[i, i], work.force[i], end))
        moved = max(moved, work.matrix[i, i] * work.force[i])
        if may_stick(pairs.law):
            slipped, held = friction_residual(work, i)
            distance, moved = max(distance, slipped), max(moved, held)
    work.solution[1], work.solution[2] = distance, moved


@linked
def solve_contact(pairs: Pairs, work: Workspace, step: float, spin: float) -> int:
    """Contact forces of a step (s) at a spin (rad/s); returns the pairs in contact, or UNSOLVED.

    Called after `is_any_closed` has filled the workspace, and after `now` and `rate` are filled where the law
    is not plain. With the fixed normal the gap is linear: one complementarity problem solves it. The updated
    normal is that of the free update; the curvature of the gap is resolved by Newton's method on |AB| - r_d,
    so that the gap closes to rounding. Pivots and residual are left in the workspace.
    """
    q = pairs.radius.size
    law = pairs.law
    work.solution[0] = 0.0
    for i in range(q):
        work.force[i] = 0.0
        work.active[i] = work.gap[i] < 0.0
    if pairs.is_updated:
        for i in range(q):
            ny, nz, _ = pair_normal_and_gap(pairs, i, work.at[i])
            fill_directions(pairs, i, ny, nz, work.force_direction[i], work.gap_jacobian[i])
            fill_friction_direction(pairs, i, ny, nz, work.friction_direction[i])
        fill_compliances(pairs, work, step)
    if is_penalty(law) or is_bouncing(law):
        fill_targets(pairs, work, step)
    if may_stick(law):
        fill_slip(pairs, work, step, spin)
    for _ in range(N_NEWTON):
        if may_stick(law):
            pivots = solve_friction(pairs, work, step, spin)
        else:
            for i in range(q):
                work.gap[i] -= work.target[i]
            pivots = solve_complementarity(
                work.matrix, work.gap, GAP_TOLERANCE, work.force, work.active, work.elimination
            )
            for i in range(q):
                work.traction[i] = pairs.friction[i] * work.force[i]
                work.gap[i] += work.target[i]
        if pivots == UNSOLVED:
            return UNSOLVED
        work.solution[0] += pivots
        error = 0.0
        if pairs.is_updated:
            for i in range(q):
                fill_moved(pairs, work, i)
                _, _, gap = pair_normal_and_gap(pairs, i, work.moved)
                gap += softness(law, step) * work.force[i]
                linear = gap
                for j in range(q):
                    linear -= work.matrix[i, j] * work.force[j]
                    if may_stick(law):
                        linear -= work.coupling[i, j] * work.traction[j]
                work.gap[i] = linear
                gap -= work.target[i]
                error = max(error, abs(gap) if work.force[i] > 0.0 else -gap)
        if error <= 10 * GAP_TOLERANCE:
            fill_residual(pairs, work)
            if not work.solution[1] <= MOST_RESIDUAL * work.solution[2] + 10 * GAP_TOLERANCE:
                return UNSOLVED
            n_touching = 0
            for i in range(q):
                n_touching += 1 if work.force[i] > 0.0 else 0
            return n_touching
    return UNSOLVED
