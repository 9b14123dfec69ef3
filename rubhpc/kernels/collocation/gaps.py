"""Gaps of a pair: their value, slope and curvature in the local motions.

A gap gives its normal, the slope of the gap `J_n`, and its tangent `J_t`. Loads on the local motions are
`N J_n + T J_t`, and the slip is `rim speed - J_t q'`. Another smooth gap is another branch of `see_gap`.

A round rim of radius R meets a tip at the distance `reach` from its centre: the gap is `reach - R`. A bore of
the clearance c is a rim of the radius -c at the negative distance, so that the gap is `c - distance`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.structures import (
    ACROSS,
    ALONG,
    BENDING,
    ROUND,
    TWIST,
    Bodies,
    Solution,
)

Floats = NDArray[np.float64]

CENTRED = 1e-30  # m, least distance from the centre of a bore: there any direction is the normal


@linked_sum
def reach_of(radius: float, line: float, across: float) -> float:
    """Distance of a tip from the centre of the rim, m, with the sign of the radius."""
    return math.copysign(max(math.sqrt(line * line + across * across), CENTRED), radius)


@linked_sum
def gap_of(bodies: Bodies, i: int, q: Floats, first: int) -> float:
    """Gap of pair i at its local displacements, from `first` on in `q`, m."""
    bent = 0.0
    for a in range(first + BENDING, first + bodies.n_local):
        bent += q[a] * q[a]
    along = bodies.clearance[i] + q[first + ALONG] + 0.5 * bent
    if bodies.kind[i] == ROUND:
        across, radius = bodies.aside[i] + q[first + ACROSS], bodies.radius[i]
        reach = reach_of(radius, radius + along, across)
        along = ((2.0 * radius + along) * along + across * across) / (reach + radius)
    return float(along)


@linked_sum
def see_gap(bodies: Bodies, i: int, q: Floats, first: int, row: int, solution: Solution) -> None:
    """Fill a row of the solution with gap, curvature, unit normal, normal and tangent of pair i."""
    n_local = bodies.n_local
    bent = 0.0
    for a in range(first + BENDING, first + n_local):
        bent += q[a] * q[a]
    along = bodies.clearance[i] + q[first + ALONG] + 0.5 * bent
    gap, curvature, n_along, n_across = along, 0.0, 1.0, 0.0
    if bodies.kind[i] == ROUND:
        across, radius = bodies.aside[i] + q[first + ACROSS], bodies.radius[i]
        reach = reach_of(radius, radius + along, across)
        curvature = 1.0 / reach
        n_along, n_across = (radius + along) * curvature, across * curvature
        if abs(reach) <= CENTRED:
            n_along, n_across = 1.0, 0.0
        # Without the difference of reach and radius, which has lost half of the digits.
        gap = ((2.0 * radius + along) * along + across * across) / (reach + radius)
    normal, tangent = solution.normal[row], solution.tangent[row]
    solution.gap[row], solution.curvature[row] = gap, curvature
    solution.unit[row, 0], solution.unit[row, 1] = n_along, n_across
    normal[ALONG], normal[ACROSS], normal[TWIST] = n_along, n_across, 0.0
    tangent[ALONG], tangent[ACROSS], tangent[TWIST] = -n_across, n_along, -1.0
    for a in range(BENDING, n_local):
        normal[a], tangent[a] = n_along * q[first + a], -n_across * q[first + a]


@linked_sum
def see_bend(bodies: Bodies, row: int, solution: Solution) -> None:
    """Fill `normal_bend` and `tangent_bend` with the derivatives of a row's normal and tangent."""
    n_local, curvature = bodies.n_local, solution.curvature[row]
    normal, tangent = solution.normal[row], solution.tangent[row]
    of_normal, of_tangent = solution.normal_bend, solution.tangent_bend
    for a in range(n_local):
        for b in range(n_local):
            of_normal[a, b], of_tangent[a, b] = 0.0, 0.0
            if b != TWIST and a != TWIST:
                of_normal[a, b] = curvature * tangent[a] * tangent[b]
                of_tangent[a, b] = -curvature * normal[a] * tangent[b]
        if a >= BENDING:
            of_normal[a, a] += solution.unit[row, 0]
            of_tangent[a, a] -= solution.unit[row, 1]


@linked_sum
def slip_path(bodies: Bodies, i: int, row: int, first_row: int, moved: float, solution: Solution) -> float:
    """Path (m) by which the normal of pair i has turned on the rim from one row to another.

    `moved` is the displacement across the axis from one to the other, the path where the normal is fixed.
    """
    if bodies.kind[i] != ROUND:
        return moved
    a, b = solution.unit[first_row, 0], solution.unit[first_row, 1]
    c, d = solution.unit[row, 0], solution.unit[row, 1]
    return float(bodies.radius[i] * math.atan2(a * d - b * c, a * c + b * d))
