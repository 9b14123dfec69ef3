"""Linear complementarity: the closed pairs among several, and their forces.

Find `force >= 0` with `gap + compliance @ force >= 0` such that one of the two is zero in every pair (paper,
Eqs. 7 and 10).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked

Floats = NDArray[np.float64]

UNSOLVED = -1


@linked
def solve_active(
    compliance: Floats, gap: Floats, active: NDArray[np.bool_], force: Floats, work: Floats
) -> bool:
    """Close the active gaps exactly; False where their compliance matrix is singular.

    `work` is (q, q + 1); the elimination pivots by rows, because friction makes the matrix unsymmetric.
    """
    q = gap.size
    n = 0
    for i in range(q):
        force[i] = 0.0
        if active[i]:
            m = 0
            for j in range(q):
                if active[j]:
                    work[n, m] = compliance[i, j]
                    m += 1
            work[n, q] = -gap[i]
            n += 1
    if not solve_rows(work, n):
        return False
    n = 0
    for i in range(q):
        if active[i]:
            force[i] = work[n, q]
            n += 1
    return True


@linked
def solve_rows(work: Floats, n: int) -> bool:
    """Solve n linear equations in place, right-hand sides in the last column; False where singular."""
    q = work.shape[1] - 1
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if not abs(work[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(k, n):
                work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
            work[k, q], work[pivot, q] = work[pivot, q], work[k, q]
        for i in range(k + 1, n):
            factor = work[i, k] / work[k, k]
            for j in range(k + 1, n):
                work[i, j] -= factor * work[k, j]
            work[i, q] -= factor * work[k, q]
    for k in range(n - 1, -1, -1):
        total = work[k, q]
        for j in range(k + 1, n):
            total -= work[k, j] * work[j, q]
        work[k, q] = total / work[k, k]
    return True


@linked
def natural_residual(give: float, force: float, gap: float) -> float:
    """Distance of a pair from complementarity, in the unit of its gap: |min(give force, gap)|.

    `give` is the change of the pair's own gap by a unit force. Zero for force >= 0, gap >= 0, one of them 0.
    """
    return float(abs(min(give * force, gap)))


@linked
def residual_of(compliance: Floats, gap: Floats, force: Floats) -> tuple[float, float]:
    """Largest residual of a problem at `force`, and the largest change of a gap by its own force."""
    largest, moved = 0.0, 0.0
    for i in range(gap.size):
        end = gap[i]
        for j in range(gap.size):
            end += compliance[i, j] * force[j]
        largest = max(largest, natural_residual(compliance[i, i], force[i], end))
        moved = max(moved, abs(compliance[i, i] * force[i]))
    return largest, moved


@linked
def solve_complementarity(
    compliance: Floats,
    gap: Floats,
    tolerance: float,
    force: Floats,
    active: NDArray[np.bool_],
    work: Floats,
) -> int:
    """Forces of all pairs, N, by block principal pivoting; returns the pivots taken, or UNSOLVED.

    All violated pairs are exchanged at once as long as that reduces their number; else only the last one
    (Murty's rule, finite for P-matrices; Judice and Pires, Comput. Oper. Res. 21 (1994) 587-596).

    Parameters
    ----------
    compliance : (q, q), m/N
        Change of gap i for a unit force in pair j over one step, friction included.
    gap : (q,), m
        Gaps without contact forces.
    tolerance : float, m
        Penetration that counts as closed.
    force, active, work : (q,) N, (q,), (q, q + 1)
        Filled in place; `active` on entry is the first guess.
    """
    q = gap.size
    fewest = q + 1
    n_patience = 3
    for n_pivot in range(1, 50 + 20 * q):
        if not solve_active(compliance, gap, active, force, work):
            return UNSOLVED
        n_violated = 0
        last = -1
        for i in range(q):
            if active[i]:
                is_violated = force[i] < 0.0
            else:
                opening = gap[i]
                for j in range(q):
                    opening += compliance[i, j] * force[j]
                is_violated = opening < -tolerance
            work[i, q] = 1.0 if is_violated else 0.0
            if is_violated:
                n_violated += 1
                last = i
        if n_violated == 0:
            return n_pivot
        if n_violated < fewest:
            fewest, n_patience = n_violated, 3
        else:
            n_patience -= 1
        if n_patience >= 0:
            for i in range(q):
                if work[i, q] > 0.0:
                    active[i] = not active[i]
        else:
            active[last] = not active[last]
    return UNSOLVED
