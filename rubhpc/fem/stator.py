"""Assembly of a stator: a cantilever, a mass on springs or a wall, or its matrices."""

from __future__ import annotations

import math
from functools import singledispatch
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.beam import STATOR_DEGREES, join, stator_element, stator_foreshortening
from rubhpc.fem.damping import rayleigh_coefficients
from rubhpc.fem.model import Body, StatorModel
from rubhpc.rig.stators import SECOND_ORDER, LumpedStator, MatrixStator, Stator

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.rig.stators import Seat


@singledispatch
def assemble_stator(stator: object, radius: float) -> StatorModel:
    """Return the model of a stator; register a function for each kind of `rubhpc.rig.stators`.

    Parameters
    ----------
    stator : Stator, LumpedStator or MatrixStator
    radius : float
        Contact radius, m.
    """
    raise TypeError(f"no assembly for {type(stator).__name__}")


@assemble_stator.register(Stator)
def _(stator: Stator, radius: float) -> StatorModel:
    """Cantilever with its root, node 1, clamped; without lateral motion only the axial degrees remain."""
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
        strength=_strength(stator),
        axial=body.index(tip, "axial"),
        lateral=body.index(tip, "lateral"),
        squared_slope=stator_foreshortening(stator)[rows] if stator.geometry == SECOND_ORDER else None,
    )


@assemble_stator.register(MatrixStator)
def _(stator: MatrixStator, radius: float) -> StatorModel:
    assert stator.damping is not None
    degrees = tuple((1, name) for name in stator.degrees)
    return _without_length(stator, radius, stator.mass, stator.damping, stator.stiffness, degrees)


@assemble_stator.register(LumpedStator)
def _(stator: LumpedStator, radius: float) -> StatorModel:
    """One mass, or a wall without degrees of freedom."""
    names = [] if stator.rigid else ["axial"]
    values = [] if stator.rigid else [(stator.mass, stator.damping, stator.stiffness)]
    if stator.lateral_stiffness is not None:
        names.append("lateral")
        mass = stator.mass if stator.lateral_mass is None else stator.lateral_mass
        values.append((mass, stator.lateral_damping, stator.lateral_stiffness))
    table = np.array(values, dtype=np.float64).reshape(-1, 3)
    M, C, K = (np.diag(column) for column in table.T)
    return _without_length(stator, radius, M, C, K, tuple((1, name) for name in names))


def _strength(seat: Seat) -> float:
    """Contact force that it bears, N; infinite where none is given."""
    return math.inf if seat.strength is None else seat.strength


def _without_length(
    seat: Seat,
    radius: float,
    mass: NDArray[np.float64],
    damping: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    degrees: tuple[tuple[int, str], ...],
) -> StatorModel:
    """Return a stator without a length and an Euler load: both are infinite."""
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
        strength=_strength(seat),
        axial=body.index(1, "axial"),
        lateral=body.index(1, "lateral"),
    )
