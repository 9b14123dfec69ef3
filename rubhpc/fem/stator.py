"""A stator assembled: a cantilever with its root held, its free end facing the rim."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.beam import STATOR_DEGREES, join, stator_element
from rubhpc.fem.damping import rayleigh_coefficients
from rubhpc.fem.model import Body, StatorModel

if TYPE_CHECKING:
    from rubhpc.rig.rig import Stator


def assemble_stator(stator: Stator, radius: float) -> StatorModel:
    """Stator with node 1, its root, held; without lateral freedom only the axial degrees remain.

    Parameters
    ----------
    stator : Stator
    radius : float
        Radius of contact, m.
    """
    beam = join([stator_element(stator)] * stator.elements)
    names = STATOR_DEGREES if stator.lateral else ("axial",)
    tip = stator.elements + 1
    degrees = [(node, name) for node in range(1, tip + 1) for name in STATOR_DEGREES]
    free = [row for row, (node, name) in enumerate(degrees) if node > 1 and name in names]
    rows = np.ix_(free, free)
    alpha, beta = rayleigh_coefficients(stator.damping)
    M, K = beam.mass[rows], beam.stiffness[rows]
    body = Body(
        mass=M,
        damping=alpha * M + beta * K,
        gyroscopic=beam.gyroscopic[rows],
        stiffness=K,
        degrees=tuple(degrees[row] for row in free),
    )
    return StatorModel(
        body=body,
        node=stator.node,
        angle=stator.angle,
        radius=radius,
        clearance_offset=stator.clearance_offset,
        length=stator.length,
        euler_load=stator.euler_load,
        axial=body.index(tip, "axial"),
        lateral=body.index(tip, "lateral"),
    )
