"""Linear bodies as uncoupled blocks: the free step of the central difference (paper, Eq. 20).

With `v` the velocity half a step before displacement `u`, Eq. 20 is, without its cancellation,

    (M + h/2 C) (v_next - v) = h (f - K u - C v),    u_next = u + h v_next.

Uncoupled degrees of freedom form separate blocks (rotor bending, torsion, each stator's axial and lateral
motion), so that no dense product includes both bodies: the inverse of `M + h/2 C` is dense within a block. K
and C are banded throughout and stored by diagonals, as in `scipy.sparse.dia_array`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels._struct import Struct

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Linear(Struct):
    """Blocks of the linear bodies; rows `start[b]:start[b + 1]` of a state vector are block b."""

    start: Ints  # (n_block + 1,)
    inverse: Floats  # (n_block, n_max, n_max), transpose of the inverse of M + h/2 C
    stiffness: Floats  # (n_diagonal, n_dof), K by diagonals
    stiffness_span: Ints  # (n_diagonal, 3), offset, first and past-last column of each
    damping: Floats  # (n_diagonal, n_dof), C = D + spin G by diagonals
    damping_span: Ints  # (n_diagonal, 3)
    circulation: Floats  # (n_circulation,), skew part of K, N/m (energy balance only)
    circulation_row: Ints  # (n_circulation,)
    circulation_column: Ints  # (n_circulation,)
    force_row: Ints  # (n_force,), rows on which unbalance and harmonics act
    force_order: Ints  # (n_force,), multiple of the spin
    force_cosine: Floats  # (n_force,), N
    force_sine: Floats  # (n_force,), N


@linked
def add_diagonals(values: Floats, span: Ints, x: Floats, y: Floats) -> None:
    """Add `A x` to `y` (n,), with `A[j - offset, j] = values[k, j]` for columns j of diagonal k's span."""
    for k in range(span.shape[0]):
        offset, first, last = span[k, 0], span[k, 1], span[k, 2]
        value, source, target = values[k, first:last], x[first:last], y[first - offset : last - offset]
        for i in range(value.size):
            target[i] += value[i] * source[i]


@linked
def add_columns(columns: Floats, x: Floats, y: Floats) -> None:
    """Add `columns.T @ x` to `y` (n,), four columns a pass: `y` is read and written a quarter as often."""
    n = y.size
    n_by_four = n - n % 4
    for j in range(0, n_by_four, 4):
        a, b, c, d = columns[j], columns[j + 1], columns[j + 2], columns[j + 3]
        p, q, r, s = x[j], x[j + 1], x[j + 2], x[j + 3]
        for i in range(n):
            y[i] += (a[i] * p + b[i] * q) + (c[i] * r + d[i] * s)
    for j in range(n_by_four, n):
        a, p = columns[j], x[j]
        for i in range(n):
            y[i] += a[i] * p


@linked
def turning_force(linear: Linear, k: int, cosine: float, sine: float) -> float:
    """Force k (N) at the shaft's angle."""
    a, b = cosine, sine
    for _ in range(1, linear.force_order[k]):
        a, b = a * cosine - b * sine, a * sine + b * cosine
    return float(linear.force_cosine[k] * a + linear.force_sine[k] * b)


@linked
def free_velocity(
    linear: Linear,
    step: float,
    cosine: float,
    sine: float,
    displacement: Floats,
    velocity: Floats,
    velocity_next: Floats,
    damping_force: Floats,
    residual: Floats,
) -> None:
    """Velocity half a step ahead without contact, into `velocity_next`; C v goes into `damping_force`.

    All state arrays are (n_dof,) in m, rad, m/s, rad/s; `residual` is work space.
    """
    residual[:] = 0.0
    damping_force[:] = 0.0
    add_diagonals(linear.stiffness, linear.stiffness_span, displacement, residual)
    add_diagonals(linear.damping, linear.damping_span, velocity, damping_force)
    for i in range(residual.size):
        residual[i] = -step * (residual[i] + damping_force[i])
        velocity_next[i] = velocity[i]
    for k in range(linear.force_row.size):
        residual[linear.force_row[k]] += step * turning_force(linear, k, cosine, sine)
    for b in range(linear.start.size - 1):
        first, last = linear.start[b], linear.start[b + 1]
        add_columns(linear.inverse[b], residual[first:last], velocity_next[first:last])


@linked
def circulatory_power(linear: Linear, displacement: Floats, velocity: Floats) -> float:
    """Power drawn by the skew part of K (cross-coupled bearings), W."""
    power = 0.0
    for k in range(linear.circulation.size):
        power += (
            velocity[linear.circulation_row[k]]
            * linear.circulation[k]
            * displacement[linear.circulation_column[k]]
        )
    return power
