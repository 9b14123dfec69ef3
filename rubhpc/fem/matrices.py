"""Bodies that come as matrices, or as a mass on springs, in the form of the finite element bodies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.model import Body, StatorModel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.rig.matrices import MatrixRotor
    from rubhpc.rig.stators import LumpedStator, MatrixStator, Seat


def matrix_rotor(rotor: MatrixRotor) -> Body:
    """Rotor as its matrices have it."""
    assert rotor.damping is not None  # zeros at least, once checked
    assert rotor.gyroscopic is not None
    return Body(
        mass=rotor.mass,
        damping=rotor.damping,
        gyroscopic=rotor.gyroscopic,
        stiffness=rotor.stiffness,
        degrees=rotor.degrees,
    )


def matrix_stator(stator: MatrixStator, radius: float) -> StatorModel:
    """Stator as its matrices have it; it meets the rotor with the degrees "axial" and "lateral"."""
    assert stator.damping is not None
    degrees = tuple((1, name) for name in stator.degrees)
    return _model(stator, radius, stator.mass, stator.damping, stator.stiffness, degrees)


def lumped_stator(stator: LumpedStator, radius: float) -> StatorModel:
    """Stator of one mass, or a wall without a degree of freedom."""
    names = [] if stator.rigid else ["axial"]
    values = [] if stator.rigid else [(stator.mass, stator.damping, stator.stiffness)]
    if stator.lateral_stiffness is not None:
        names.append("lateral")
        mass = stator.mass if stator.lateral_mass is None else stator.lateral_mass
        values.append((mass, stator.lateral_damping, stator.lateral_stiffness))
    table = np.array(values, dtype=np.float64).reshape(-1, 3)
    M, C, K = (np.diag(column) for column in table.T)
    return _model(stator, radius, M, C, K, tuple((1, name) for name in names))


def _model(
    seat: Seat,
    radius: float,
    mass: NDArray[np.float64],
    damping: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    degrees: tuple[tuple[int, str], ...],
) -> StatorModel:
    """A stator that cannot buckle, and whose length is not known."""
    body = Body(
        mass=mass,
        damping=damping,
        gyroscopic=np.zeros_like(mass),
        stiffness=stiffness,
        degrees=degrees,
    )
    return StatorModel(
        body=body,
        node=seat.node,
        angle=seat.angle,
        radius=radius,
        clearance_offset=seat.clearance_offset,
        length=math.inf,
        euler_load=math.inf,
        axial=body.index(1, "axial"),
        lateral=body.index(1, "lateral"),
    )
