"""Contact pairs: where disc and stator tip face each other, and the forces between (paper, Eqs. 3-10, 19)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit, jit_inline
from rubhpc.kernels.complementarity import UNSOLVED, solve_complementarity

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Columns of a pair's degrees: disc v, disc w, disc torsion, stator tip axial, stator tip lateral.
V, W, TORSION, AXIAL, LATERAL = range(5)
N_DEGREE = 5

GAP_TOLERANCE = 1e-14  # m, to which a closed gap is zero
N_NEWTON = 25  # passes for the curved gap; two or three are taken


class Pairs(NamedTuple):
    """The q contact pairs of a case."""

    row: Ints  # (q, 5), row of each degree in the state; -1 where it is held or absent
    block: Ints  # (q, 5), block of each degree; -1 likewise
    axis_y: Floats  # (q,), stator's axis from the disc outwards
    axis_z: Floats  # (q,)
    radius: Floats  # (q,), of contact, m
    clearance: Floats  # (q,), at rest, m
    friction: Floats  # (q,), coefficient, with the sign of the spin
    compliance: Floats  # (q, 5, q, 5), displacement of a degree for a unit force on another over a step, m/N
    is_updated: bool  # the normal follows the line of centres


class Workspace(NamedTuple):
    """Arrays of one contact solution."""

    at: Floats  # (q, 5), displacement of each degree, m or rad
    pull: Floats  # (q, 5), generalised force on each degree for a unit normal force
    push: Floats  # (q, 5), change of the gap with each degree
    matrix: Floats  # (q, q), m/N
    gap: Floats  # (q,), m
    force: Floats  # (q,), N
    active: NDArray[np.bool_]  # (q,)
    elimination: Floats  # (q, q + 1)
    moved: Floats  # (5,), degrees of one pair after contact


@jit_inline
def force_on_disc(
    ny: float, nz: float, force: float, friction: float, radius: float
) -> tuple[float, float, float]:
    """Generalised force (Fy, Fz, Mx) of the stator on the disc, N, N, N m.

    -N n - mu N t and -mu N r_d (paper, Eqs. 8-10, 19), with n = (ny, nz) from disc to stator and
    t = x_hat x n = (-nz, ny), the way the rim moves under positive spin.
    """
    slide = friction * force
    return -force * ny + slide * nz, -force * nz - slide * ny, -slide * radius


@jit_inline
def normal_and_gap(
    ey: float, ez: float, radius: float, clearance: float, is_updated: bool, at: Floats
) -> tuple[float, float, float]:
    """Unit normal (ny, nz) from disc to stator tip, and gap (m), of a pair with its degrees `at` (5,).

    (ey, ez) is the stator's axis; radius and clearance in m.
    """
    if not is_updated:
        return ey, ez, clearance + at[AXIAL] - ey * at[V] - ez * at[W]
    reach = radius + clearance + at[AXIAL]
    y = reach * ey - at[LATERAL] * ez - at[V]
    z = reach * ez + at[LATERAL] * ey - at[W]
    distance = np.hypot(y, z)
    return y / distance, z / distance, distance - radius


@jit_inline
def fill_directions(pairs: Pairs, i: int, ny: float, nz: float, pull: Floats, push: Floats) -> None:
    """Directions of pair i for normal (ny, nz): `pull` (5,) the force's, `push` (5,) the gap's.

    Displacements of the tip: axial along the stator's axis e, lateral along x_hat x e.
    """
    ey, ez = pairs.axis_y[i], pairs.axis_z[i]
    fy, fz, moment = force_on_disc(ny, nz, 1.0, pairs.friction[i], pairs.radius[i])
    pull[V], pull[W], pull[TORSION] = fy, fz, moment
    pull[AXIAL], pull[LATERAL] = -(fy * ey + fz * ez), -(-fy * ez + fz * ey)
    push[V], push[W], push[TORSION] = -ny, -nz, 0.0
    push[AXIAL], push[LATERAL] = ny * ey + nz * ez, -ny * ez + nz * ey


@jit
def fill_matrix(pairs: Pairs, work: Workspace) -> None:
    """Change of each gap for a unit force in each pair over a step, G_N Mt^-1 G_NT^T of Eq. 24, m/N."""
    q = pairs.radius.size
    for i in range(q):
        for j in range(q):
            total = 0.0
            for a in range(N_DEGREE):
                for b in range(N_DEGREE):
                    total += work.push[i, a] * pairs.compliance[i, a, j, b] * work.pull[j, b]
            work.matrix[i, j] = total


@jit
def fill_moved(pairs: Pairs, work: Workspace, i: int) -> None:
    """Degrees of pair i with the contact forces applied, into `work.moved`."""
    for a in range(N_DEGREE):
        total = work.at[i, a]
        for j in range(pairs.radius.size):
            if work.force[j] != 0.0:
                for b in range(N_DEGREE):
                    total += pairs.compliance[i, a, j, b] * work.pull[j, b] * work.force[j]
        work.moved[a] = total


@jit_inline
def is_any_closed(
    row: Ints,
    axis_y: Floats,
    axis_z: Floats,
    radius: Floats,
    clearance: Floats,
    is_updated: bool,
    displacement: Floats,
    at: Floats,
    gap: Floats,
) -> bool:
    """Whether a pair penetrates at `displacement` (n_dof,), the free update of Eq. 20.

    Fills the degrees `at` (q, 5) and the `gap` (q,) of every pair. It takes the fields of `Pairs` one by one
    because it runs at every step, and each look into a tuple of arrays counts a reference there.
    """
    is_closed = False
    for i in range(gap.size):
        for a in range(N_DEGREE):
            at[i, a] = displacement[row[i, a]] if row[i, a] >= 0 else 0.0
        _, _, gap[i] = normal_and_gap(axis_y[i], axis_z[i], radius[i], clearance[i], is_updated, at[i])
        is_closed = is_closed or gap[i] < 0.0
    return is_closed


@jit
def pair_normal_and_gap(pairs: Pairs, i: int, at: Floats) -> tuple[float, float, float]:
    """`normal_and_gap` of pair i."""
    return normal_and_gap(
        pairs.axis_y[i], pairs.axis_z[i], pairs.radius[i], pairs.clearance[i], pairs.is_updated, at
    )


@jit
def solve_contact(pairs: Pairs, work: Workspace) -> int:
    """Contact forces that leave no pair penetrating; returns the pairs in contact, or UNSOLVED.

    Called once `is_any_closed` has filled the workspace. With the fixed normal the gap is linear and one
    complementarity problem solves it; the updated normal is taken at the free update, and the gap's
    curvature by Newton's method on |AB| - r_d, so that the gap closes to rounding.
    """
    q = pairs.radius.size
    for i in range(q):
        work.force[i] = 0.0
        work.active[i] = work.gap[i] < 0.0
    if pairs.is_updated:
        for i in range(q):
            ny, nz, _ = pair_normal_and_gap(pairs, i, work.at[i])
            fill_directions(pairs, i, ny, nz, work.pull[i], work.push[i])
        fill_matrix(pairs, work)
    for _ in range(N_NEWTON):
        pivots = solve_complementarity(
            work.matrix, work.gap, GAP_TOLERANCE, work.force, work.active, work.elimination
        )
        if pivots == UNSOLVED:
            return UNSOLVED
        error = 0.0
        if pairs.is_updated:
            for i in range(q):
                fill_moved(pairs, work, i)
                _, _, gap = pair_normal_and_gap(pairs, i, work.moved)
                linear = gap
                for j in range(q):
                    linear -= work.matrix[i, j] * work.force[j]
                work.gap[i] = linear
                error = max(error, abs(gap) if work.active[i] else -gap)
        if error <= 10 * GAP_TOLERANCE:
            n_touching = 0
            for i in range(q):
                n_touching += 1 if work.force[i] > 0.0 else 0
            return n_touching
    return UNSOLVED
