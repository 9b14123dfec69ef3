"""Contact pairs of disc and stator tip: geometry and forces (paper, Eqs. 3-10, 19)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit, linked
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.laws import Law  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Columns of a pair's degrees: disc v, disc w, disc torsion, stator tip axial, stator tip lateral.
V, W, TORSION, AXIAL, LATERAL = range(5)
N_DEGREE = 5


class Pairs(Struct):
    """The q contact pairs of a case."""

    row: Ints  # (q, 5), row of each degree in the state; -1 where it is constrained or absent
    block: Ints  # (q, 5), block of each degree; -1 likewise
    axis_y: Floats  # (q,), stator's axis from the disc outwards
    axis_z: Floats  # (q,)
    radius: Floats  # (q,), of contact, m
    clearance: Floats  # (q,), at rest, m
    aside: Floats  # (q,), lateral offset of a tip at rest from its axis through the disc, m
    friction: Floats  # (q,), coefficient, with the sign of the spin
    compliance: Floats  # (q, 5, q, 5), displacement of a degree for a unit force on another over a step, m/N
    is_updated: bool  # the normal follows the line of centres
    law: Law


class Workspace(Struct):
    """Arrays of one contact solution."""

    at: Floats  # (q, 5), displacement of each degree at the end of the step without forces, m or rad
    now: Floats  # (q, 5), at its beginning (for laws that use velocities or the step before)
    rate: Floats  # (q, 5), velocity before the forces of the step, m/s or rad/s (likewise)
    force_direction: (
        Floats  # (q, 5), generalised force on each degree for a unit normal force, friction included
    )
    gap_jacobian: Floats  # (q, 5), change of the gap with each degree; force of a unit normal force alone
    friction_direction: (
        Floats  # (q, 5), force of a unit friction; its negative is the change of the slip with each degree
    )
    matrix: Floats  # (q, q), m/N
    gap: Floats  # (q,), m
    force: Floats  # (q,), normal, N
    traction: Floats  # (q,), friction, positive where the rim is faster than the tip, N
    active: NDArray[np.bool_]  # (q,)
    is_sticking: NDArray[np.bool_]  # (q,), at the end of the step
    elimination: Floats  # (q, q + 1)
    moved: Floats  # (5,), degrees of one pair after contact
    target: Floats  # (q,), gap required by the law at the end of the step, m
    delay: Floats  # (q,), time from the beginning of the step to an impact with restitution, s; else 0
    slip: Floats  # (q,), slip over the step without forces, m
    cone: Floats  # (q,), largest friction for a unit normal force
    coupling: Floats  # (q, q), m/N, change of a gap for a unit friction
    tangential: Floats  # (2, q, q), m/N, change of a slip for a unit normal force, for a unit friction
    tableau: Floats  # (3 q, 6 q + 2)
    basis: Ints  # (3 q,)
    members: Ints  # (q,)
    solution: Floats  # (3,), of the last one: pivots, deviation from the laws, displacement by forces, m


@linked
def rim_sense(spin: float) -> float:
    """1 or -1: direction in which the rim slides over a tip, the sign of friction and slip."""
    return 1.0 if spin >= 0.0 else -1.0


@linked
def force_on_disc(
    ny: float, nz: float, force: float, friction: float, radius: float
) -> tuple[float, float, float]:
    """Generalised force (Fy, Fz, Mx) of the stator on the disc, N, N, N m.

    -N n - mu N t and -mu N r_d (paper, Eqs. 8-10, 19), with n = (ny, nz) from disc to stator and t = x_hat x
    n = (-nz, ny), the direction of the rim under positive spin.
    """
    slide = friction * force
    return -force * ny + slide * nz, -force * nz - slide * ny, -slide * radius


@jit
def normal_and_gap(
    ey: float, ez: float, radius: float, clearance: float, aside: float, is_updated: bool, at: Floats
) -> tuple[float, float, float]:
    """Unit normal (ny, nz) from disc to stator tip, and gap (m), of a pair with its degrees `at` (5,).

    (ey, ez) is the stator's axis; radius, clearance and `aside` in m.
    """
    if not is_updated:
        return ey, ez, clearance + at[AXIAL] - ey * at[V] - ez * at[W]
    reach, lateral = radius + clearance + at[AXIAL], aside + at[LATERAL]
    y = reach * ey - lateral * ez - at[V]
    z = reach * ez + lateral * ey - at[W]
    distance = np.hypot(y, z)
    return y / distance, z / distance, distance - radius


@jit
def fill_directions(
    pairs: Pairs, i: int, ny: float, nz: float, force_direction: Floats, gap_jacobian: Floats
) -> None:
    """Force direction (5,) of a sliding contact of pair i with the normal (ny, nz), and gap Jacobian (5,).

    Displacements of the tip: axial along the stator's axis e, lateral along x_hat x e.
    """
    ey, ez = pairs.axis_y[i], pairs.axis_z[i]
    fy, fz, moment = force_on_disc(ny, nz, 1.0, pairs.friction[i], pairs.radius[i])
    force_direction[V], force_direction[W], force_direction[TORSION] = fy, fz, moment
    force_direction[AXIAL], force_direction[LATERAL] = -(fy * ey + fz * ez), -(-fy * ez + fz * ey)
    gap_jacobian[V], gap_jacobian[W], gap_jacobian[TORSION] = -ny, -nz, 0.0
    gap_jacobian[AXIAL], gap_jacobian[LATERAL] = ny * ey + nz * ez, -ny * ez + nz * ey


@jit
def fill_friction_direction(pairs: Pairs, i: int, ny: float, nz: float, friction_direction: Floats) -> None:
    """Direction `friction_direction` (5,) of a unit friction of pair i: -t on the rotor, +t on the tip."""
    ey, ez = pairs.axis_y[i], pairs.axis_z[i]
    friction_direction[V], friction_direction[W], friction_direction[TORSION] = nz, -ny, -pairs.radius[i]
    friction_direction[AXIAL], friction_direction[LATERAL] = -nz * ey + ny * ez, nz * ez + ny * ey


@linked
def fill_matrix(pairs: Pairs, rows: Floats, columns: Floats, matrix: Floats) -> None:
    """Displacement along `rows` (q, 5) by unit forces along `columns`, `rows Mt^-1 columns^T`, m/N."""
    q = pairs.radius.size
    for i in range(q):
        for j in range(q):
            total = 0.0
            for a in range(N_DEGREE):
                for b in range(N_DEGREE):
                    total += rows[i, a] * pairs.compliance[i, a, j, b] * columns[j, b]
            matrix[i, j] = total


@linked
def fill_moved(pairs: Pairs, work: Workspace, i: int) -> None:
    """Degrees of pair i with the contact forces applied, into `work.moved`."""
    for a in range(N_DEGREE):
        total = work.at[i, a]
        for j in range(pairs.radius.size):
            if work.force[j] != 0.0:
                for b in range(N_DEGREE):
                    total += pairs.compliance[i, a, j, b] * work.force_direction[j, b] * work.force[j]
        work.moved[a] = total


@linked
def fill_start(row: Ints, displacement: Floats, velocity: Floats, now: Floats, rate: Floats) -> None:
    """Degrees `now` and their `rate` (q, 5) at the beginning of a step, from those of the system (n_dof,)."""
    for i in range(row.shape[0]):
        for a in range(N_DEGREE):
            k = row[i, a]
            now[i, a] = displacement[k] if k >= 0 else 0.0
            rate[i, a] = velocity[k] if k >= 0 else 0.0


@linked
def is_any_closed(
    row: Ints,
    axis_y: Floats,
    axis_z: Floats,
    radius: Floats,
    clearance: Floats,
    aside: Floats,
    is_updated: bool,
    displacement: Floats,
    at: Floats,
    gap: Floats,
) -> bool:
    """Whether a pair penetrates at `displacement` (n_dof,), the free update of Eq. 20.

    Fills the degrees `at` (q, 5) and the `gap` (q,) of every pair. Fields of `Pairs` are passed one by one:
    it runs at every step, and each access to a tuple of arrays counts a reference.
    """
    is_closed = False
    for i in range(gap.size):
        for a in range(N_DEGREE):
            at[i, a] = displacement[row[i, a]] if row[i, a] >= 0 else 0.0
        _, _, gap[i] = normal_and_gap(
            axis_y[i], axis_z[i], radius[i], clearance[i], aside[i], is_updated, at[i]
        )
        is_closed = is_closed or gap[i] < 0.0
    return is_closed


@jit
def pair_normal_and_gap(pairs: Pairs, i: int, at: Floats) -> tuple[float, float, float]:
    """`normal_and_gap` of pair i."""
    return normal_and_gap(
        pairs.axis_y[i],
        pairs.axis_z[i],
        pairs.radius[i],
        pairs.clearance[i],
        pairs.aside[i],
        pairs.is_updated,
        at,
    )
