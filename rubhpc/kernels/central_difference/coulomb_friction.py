"""Set-valued Coulomb friction in a step: which pairs part, stick or slip, and their forces.

With the normal force N of a pair, its friction T (positive where the rim is faster than the tip), and the
slip d of the rim over the tip in the step,

    |T| <= mu N,    d > 0: T = mu N,    d < 0: T = -mu N,    else the pair sticks.

With T+ = mu N + T, T- = mu N - T and d = d+ - d-, each pair contributes the complementary pairs of unknowns
(N, gap), (T-, d+) and (d-, T+). Gap and slip are linear in the forces: one linear complementarity problem for
all pairs, solved exactly (Glocker and Pfeiffer, Multibody Dynamics with Unilateral Contacts, Wiley 1996).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact_pairs import N_DEGREE, Pairs, Workspace
from rubhpc.kernels.laws import friction_coefficient
from rubhpc.kernels.lemke import solve_lemke

Floats = NDArray[np.float64]

ROUNDING = 1e-12  # of a force: smaller ones count as zero
UNNOTICED = 1e-6  # of the slip that friction can change in a step: less counts as no slip
LAST_BITS = 2e-15  # of the positions of a pair: their difference, the slip of a step, errs by as much


@linked
def fill_slip(pairs: Pairs, work: Workspace, step: float, spin: float) -> None:
    """Slip of every pair over the step without forces, m, into `work.slip`."""
    for i in range(pairs.radius.size):
        total = step * pairs.radius[i] * spin
        for a in range(N_DEGREE):
            total -= work.friction_direction[i, a] * (work.at[i, a] - work.now[i, a])
        work.slip[i] = total


@linked
def solve_friction(pairs: Pairs, work: Workspace, step: float, spin: float) -> int:
    """Forces N and T of all pairs, into `work.force` and `work.traction`; pivots taken, or UNSOLVED.

    A pair that stuck in the step before sticks up to the static coefficient, beyond which it slides. The law
    uses the slip of the step, but friction works on the mean of the velocities before and after. Where a slip
    reverses within the step, friction in the new sense would add energy: that pair has no friction in this
    step.
    """
    q = pairs.radius.size
    for i in range(q):
        slip_speed, friction = slip_speed_before(pairs, work, i, spin), abs(pairs.friction[i])
        work.cone[i] = friction_coefficient(pairs.law, friction, slip_speed, work.is_sticking[i])
    for _ in range(2 * q + 1):
        pivots = solve_cones(work)
        if pivots == UNSOLVED:
            return UNSOLVED
        is_settled = True
        for i in range(q):
            bound = work.cone[i] * work.force[i]
            slip_speed, friction = slip_speed_before(pairs, work, i, spin), abs(pairs.friction[i])
            sliding = friction_coefficient(pairs.law, friction, slip_speed, False)
            if work.cone[i] > sliding and abs(work.traction[i]) >= bound * (1.0 - ROUNDING):
                work.cone[i] = sliding
                is_settled = False
            elif bound > 0.0 and feeds_energy(pairs, work, i, step, spin):
                work.cone[i] = 0.0
                is_settled = False
        if is_settled:
            break
    for i in range(q):
        bound = work.cone[i] * work.force[i] * (1.0 - ROUNDING)
        work.is_sticking[i] = abs(work.traction[i]) < bound
        share = work.traction[i] / work.force[i] if work.force[i] > 0.0 else 0.0
        for a in range(N_DEGREE):
            work.force_direction[i, a] = work.gap_jacobian[i, a] + share * work.friction_direction[i, a]
    return pivots


@linked
def slip_speed_before(pairs: Pairs, work: Workspace, i: int, spin: float) -> float:
    """Slip of the rim of pair i over the tip before the forces of the step, m/s."""
    speed: float = pairs.radius[i] * spin
    for a in range(N_DEGREE):
        speed -= work.friction_direction[i, a] * work.rate[i, a]
    return speed


@linked
def feeds_energy(pairs: Pairs, work: Workspace, i: int, step: float, spin: float) -> bool:
    """Whether the friction of pair i has the direction of the mean slip, so that it adds energy."""
    before = step * pairs.radius[i] * spin
    after = work.slip[i]
    reach = 0.0
    for a in range(N_DEGREE):
        before -= step * work.friction_direction[i, a] * work.rate[i, a]
        reach += abs(work.friction_direction[i, a] * work.at[i, a])
    for j in range(work.force.size):
        after += work.tangential[0, i, j] * work.force[j] + work.tangential[1, i, j] * work.traction[j]
    # Relative to the slip that friction can change in a step: a sticking pair slips by the rounding of
    # positions.
    least = UNNOTICED * abs(work.tangential[1, i, i]) * work.cone[i] * work.force[i] + LAST_BITS * reach
    return bool(work.traction[i] * (before + after) < -abs(work.traction[i]) * least)


@linked
def friction_residual(work: Workspace, i: int) -> tuple[float, float]:
    """Deviation of pair i from Coulomb's law, and the change of its slip by its friction, m."""
    slip = work.slip[i]
    for j in range(work.force.size):
        slip += work.tangential[0, i, j] * work.force[j] + work.tangential[1, i, j] * work.traction[j]
    give, bound = abs(work.tangential[1, i, i]), work.cone[i] * work.force[i]
    # Coulomb's law: friction stops the slip, limited by the friction cone.
    wanted = min(max(work.traction[i] + slip / give, -bound), bound) if give > 0.0 else work.traction[i]
    return give * abs(work.traction[i] - wanted), give * abs(work.traction[i])


@linked
def solve_cones(work: Workspace) -> int:
    """Forces for the given `work.cone`; pivots taken, or UNSOLVED.

    Pairs whose gap stays open without forces are left out, and added where the forces of the others close it.
    """
    q = work.force.size
    pivots = 0
    for i in range(q):
        work.active[i] = work.gap[i] < work.target[i]
    for _ in range(q + 1):
        n_member = 0
        for i in range(q):
            work.force[i] = work.traction[i] = 0.0
            if work.active[i]:
                work.members[n_member] = i
                n_member += 1
        taken = solve_members(work, n_member)
        if taken == UNSOLVED:
            return UNSOLVED
        pivots += taken
        is_complete = True
        for i in range(q):
            if not work.active[i]:
                gap = work.gap[i] - work.target[i]
                for k in range(n_member):
                    j = work.members[k]
                    gap += work.matrix[i, j] * work.force[j] + work.coupling[i, j] * work.traction[j]
                if gap < 0.0:
                    work.active[i] = True
                    is_complete = False
        if is_complete:
            return pivots
    return UNSOLVED


@linked
def solve_members(work: Workspace, q: int) -> int:
    """Forces of the first q `work.members`; pivots taken, or UNSOLVED.

    Friction and slip of a pair are positive in the sense of its slip without forces, so that the method
    starts from steady sliding, the usual case. Rows: gap, d+, T+; unknowns of their columns: N, T-, d-.
    Forces are scaled to the displacement that they cause: all entries of the tableau are then of order one.
    """
    tableau, basis, members = work.tableau, work.basis, work.members
    n = 3 * q
    value = 2 * n + 1  # last column
    scale = 0.0
    for a in range(q):
        i = members[a]
        scale = max(scale, abs(work.matrix[i, i]), abs(work.tangential[1, i, i]))
    if q > 0 and not scale > 0.0:
        return UNSOLVED
    for row in range(n):
        for column in range(2 * n + 2):
            tableau[row, column] = 0.0
        tableau[row, row], tableau[row, 2 * n] = 1.0, -1.0
    for a in range(q):
        i, ahead, room = members[a], q + a, 2 * q + a
        forward = 1.0 if work.slip[i] >= 0.0 else -1.0
        tableau[a, value] = work.gap[i] - work.target[i]
        tableau[ahead, value] = forward * work.slip[i]
        tableau[ahead, n + room] = -1.0
        tableau[room, n + a], tableau[room, n + ahead] = -2.0 * work.cone[i], 1.0
        for b in range(q):
            j = members[b]
            sense = 1.0 if work.slip[j] >= 0.0 else -1.0
            couple, turn = work.coupling[i, j] * sense / scale, work.tangential[1, i, j] * sense / scale
            tableau[a, n + b] = -work.matrix[i, j] / scale - work.cone[j] * couple
            tableau[ahead, n + b] = -forward * (work.tangential[0, i, j] / scale + work.cone[j] * turn)
            if work.cone[j] > 0.0:
                tableau[a, n + q + b], tableau[ahead, n + q + b] = couple, forward * turn
        if not work.cone[i] > 0.0:  # no friction at any slip: these rows are satisfied
            for column in range(n, 2 * n + 2):
                tableau[ahead, column] = tableau[room, column] = 0.0
    pivots = solve_lemke(tableau, basis, n)
    if pivots == UNSOLVED:
        return UNSOLVED
    for row in range(n):
        k = basis[row] - n
        found = max(tableau[row, value] / scale, 0.0)
        if 0 <= k < q:
            i = members[k]
            work.force[i] += found
            work.traction[i] += work.cone[i] * found
        elif q <= k < 2 * q:
            work.traction[members[k - q]] -= found
    for a in range(q):
        i = members[a]
        bound = work.cone[i] * work.force[i]  # may be exceeded by rounding, above all at zero
        work.traction[i] = min(max(work.traction[i], -bound), bound)
        work.traction[i] *= 1.0 if work.slip[i] >= 0.0 else -1.0
    return pivots
