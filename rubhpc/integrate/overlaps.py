"""Gaps of the bodies of a case, and how far they overlap in a state."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.packing import degrees_of
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL, V, W, normal_and_gap

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import Setup

    Floats = NDArray[np.float64]


def with_overlap(state: State, setup: Setup, clearance: float) -> State:
    """Return the final state of a case with the overlap of its gaps."""
    gap, _ = gaps(state.displacement, setup, clearance)
    return replace(state, overlap=np.maximum(-gap, 0.0))


def gaps(displacement: Floats, setup: Setup, clearance: float) -> tuple[Floats, Floats]:
    """Gap of each pair (q,), m, and its change with each degree of the bodies (q, n_dof)."""
    model = setup.model
    degree = degrees_of(model)
    gap, gap_jacobian = np.zeros(len(degree)), np.zeros((len(degree), displacement.size))
    for i, (stator, rows) in enumerate(zip(model.stators, degree, strict=True)):
        at = np.where(rows >= 0, displacement[rows], 0.0)
        at[[V, W]] -= stator.centre
        body = slice(model.stator_start[i], model.stator_start[i] + stator.body.n_dof)
        drawn = np.zeros(stator.body.n_dof)
        if stator.squared_slope is not None:
            drawn = stator.squared_slope @ displacement[body]
            at[AXIAL] += 0.5 * displacement[body] @ drawn
        ey, ez = float(np.cos(stator.angle)), float(np.sin(stator.angle))
        reach = clearance + stator.clearance_offset
        if stator.is_bore:
            y, z = at[V] - at[AXIAL], at[W] - at[LATERAL]
            away = math.hypot(y, z)
            ny, nz = (y / away, z / away) if away > 0.0 else (1.0, 0.0)
            gap[i], change = reach - away, np.array([-ny, -nz, 0.0, ny, nz])
            gap_jacobian[i, rows[rows >= 0]] = change[rows >= 0]
            continue
        ny, nz, gap[i] = normal_and_gap(ey, ez, stator.radius, reach, 0.0, setup.is_updated, at)
        change = np.array([-ny, -nz, 0.0, ny * ey + nz * ez, ny * -ez + nz * ey])
        gap_jacobian[i, rows[rows >= 0]] = change[rows >= 0]
        gap_jacobian[i, body] += change[AXIAL] * drawn
    return gap, gap_jacobian
