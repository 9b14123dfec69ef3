"""The contact forces of a step: what closes the gaps, or what the laws of impact and friction ask for."""

from __future__ import annotations

import numpy as np

from rubhpc.kernels._jit import jit, jit_inline
from rubhpc.kernels.complementarity import UNSOLVED, natural_residual, solve_complementarity
from rubhpc.kernels.contact_pairs import (
    N_DEGREE,
    Law,
    Pairs,
    Workspace,
    fill_directions,
    fill_drag,
    fill_matrix,
    fill_moved,
    pair_normal_and_gap,
)
from rubhpc.kernels.coulomb_friction import fill_slip, friction_residual, solve_friction

GAP_TOLERANCE = 1e-14  # m, to which a closed gap is zero
N_NEWTON = 25  # passes for the curved gap; two or three are taken
MOST_RESIDUAL = 1e-6  # over what the forces moved: rounding leaves 1e-9, and more is no solution


@jit
def is_plain(law: Law) -> bool:
    """Whether gaps are closed by multipliers under steady sliding: forces then follow from the gaps alone."""
    return law.stiffness == 0.0 and law.restitution == 0.0 and not law.is_set_valued


@jit
def softness(law: Law, step: float) -> float:
    """Compliance of the penalty over a step, m/N: one over (k/4 + c/(2 h)); a multiplier has none."""
    return 1.0 / (0.25 * law.stiffness + 0.5 * law.damping / step) if law.stiffness > 0.0 else 0.0


@jit
def fill_compliances(pairs: Pairs, work: Workspace, step: float) -> None:
    """What unit forces do to gaps and slips over a step; the directions are filled already."""
    if pairs.law.is_set_valued:
        fill_matrix(pairs, work.push, work.push, work.matrix)
        fill_matrix(pairs, work.push, work.drag, work.coupling)
        fill_matrix(pairs, work.drag, work.push, work.tangential[0])
        fill_matrix(pairs, work.drag, work.drag, work.tangential[1])
        work.tangential[:] *= -1.0
    else:
        fill_matrix(pairs, work.push, work.pull, work.matrix)
    for i in range(pairs.radius.size):
        work.matrix[i, i] += softness(pairs.law, step)


@jit
def fill_targets(pairs: Pairs, work: Workspace, step: float) -> None:
    """Gap that each pair asks for at the end of the step, m, less what its own force yields.

    Multiplier: zero. Restitution: see `bounce`. Penalty: the force is the mean, 1:2:1, of the springs' at the
    ends of this step and the one before, and the damper's over both. This mean neither adds nor takes energy,
    and it is stable for any stiffness.
    """
    law = pairs.law
    for i in range(pairs.radius.size):
        work.target[i] = work.delay[i] = 0.0
        _, _, gap = pair_normal_and_gap(pairs, i, work.now[i])
        opening = 0.0
        for a in range(N_DEGREE):
            opening += work.push[i, a] * work.rate[i, a]
        if law.stiffness > 0.0:
            if gap < 0.0 or work.gap[i] < 0.0:
                before = gap - step * opening
                spring = 0.25 * law.stiffness * (2.0 * max(-gap, 0.0) + max(-before, 0.0))
                work.target[i] = softness(law, step) * (spring + 0.5 * law.damping * before / step)
        elif work.gap[i] < 0.0 and gap >= 0.0:
            work.target[i], work.delay[i] = bounce(law.restitution, step, gap, opening, work.gap[i])


@jit_inline
def bounce(restitution: float, step: float, gap: float, opening: float, end: float) -> tuple[float, float]:
    """Gap to ask for at the end of a step (m) in which an impact falls, and when it falls (s).

    The gap, `gap` at the beginning, would be `end` < 0 at the end, and opened at the rate `opening` half a
    step before the beginning. With the acceleration that this makes, it closes after the delay, at the rate
    v-; v+ = -e v- then gives the rate half a step after the beginning. The step is taken at that rate, and
    what the force has moved before it was due is taken back. Where the flight that follows would end within
    the step, the gap is closed instead, as without restitution: (0, 0).
    """
    acceleration = (end - gap - step * opening) / step**2
    rate = opening + 0.5 * step * acceleration
    closing = np.sqrt(max(rate * rate - 2.0 * acceleration * gap, 0.0))
    if not closing > 0.0 or 2.0 * restitution * closing <= -acceleration * step:
        return 0.0, 0.0
    # The root of gap + rate t + acceleration t^2 / 2 that does not cancel.
    delay = min(2.0 * gap / (closing - rate), step) if closing > rate else step
    after = restitution * closing + acceleration * (0.5 * step - delay)
    return gap + step * after, delay


@jit_inline
def fill_residual(pairs: Pairs, work: Workspace) -> None:
    """How far gaps and slips are from the laws at the end of the step, and how far the forces moved them."""
    distance, moved = 0.0, 0.0
    for i in range(pairs.radius.size):
        end = work.gap[i] - work.target[i]
        for j in range(pairs.radius.size):
            end += work.matrix[i, j] * work.force[j]
            if pairs.law.is_set_valued:
                end += work.coupling[i, j] * work.traction[j]
        distance = max(distance, natural_residual(work.matrix[i, i], work.force[i], end))
        moved = max(moved, work.matrix[i, i] * work.force[i])
        if pairs.law.is_set_valued:
            slipped, held = friction_residual(work, i)
            distance, moved = max(distance, slipped), max(moved, held)
    work.solution[1], work.solution[2] = distance, moved


@jit
def solve_contact(pairs: Pairs, work: Workspace, step: float, spin: float) -> int:
    """Contact forces of a step (s) at a spin (rad/s); returns the pairs in contact, or UNSOLVED.

    Called once `is_any_closed` has filled the workspace, and `now` and `rate` too where the law is not plain.
    With the fixed normal the gap is linear and one complementarity problem solves it; the updated normal is
    taken at the free update, and the gap's curvature by Newton's method on |AB| - r_d, so that the gap
    closes to rounding. The pivots taken and the residual are left in the workspace.
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
            fill_directions(pairs, i, ny, nz, work.pull[i], work.push[i])
            fill_drag(pairs, i, ny, nz, work.drag[i])
        fill_compliances(pairs, work, step)
    if law.stiffness > 0.0 or law.restitution > 0.0:
        fill_targets(pairs, work, step)
    if law.is_set_valued:
        fill_slip(pairs, work, step, spin)
    for _ in range(N_NEWTON):
        if law.is_set_valued:
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
                    if law.is_set_valued:
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
