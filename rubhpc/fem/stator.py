"""Assembly of a stator: a cantilever, a mass on springs or a wall, its matrices, or a bore."""

from __future__ import annotations

import math
from functools import singledispatch
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.beam import STATOR_DEGREES, join, rayleigh_coefficients, stator_element, stator_foreshortening
from rubhpc.fem.model import Body, StatorModel
from rubhpc.rig.stators import Bore, LumpedStator, MatrixStator, Stator

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.rig.stators import Seat

    Matrix = NDArray[np.float64]


@singledispatch
def assemble_stator(stator: object, radius: float) -> StatorModel:
    """Return the model of a stator; register a function for each kind of `rubhpc.rig.stators`.

    Parameters
    ----------
    stator : Stator, LumpedStator, MatrixStator or Bore
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
    return _model(
        stator,
        radius,
        (M, alpha * M + beta * K, K),
        tuple(degrees[row] for row in free),
        tip=tip,
        length=stator.length,
        euler_load=stator.euler_load,
        squared_slope=stator_foreshortening(stator)[rows] if stator.is_bent else None,
    )


@assemble_stator.register(MatrixStator)
def _(stator: MatrixStator, radius: float) -> StatorModel:
    assert stator.damping is not None
    degrees = tuple((1, name) for name in stator.degrees)
    return _model(stator, radius, (stator.mass, stator.damping, stator.stiffness), degrees)


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
    return _model(stator, radius, (M, C, K), tuple((1, name) for name in names))


@assemble_stator.register(Bore)
def _(stator: Bore, radius: float) -> StatorModel:
    """A hole whose centre moves up, "axial", and horizontally, "lateral"; a rigid one has no degrees."""
    n = 0 if stator.rigid else 2
    table = np.array([(stator.mass,) * 2, stator.dampers, stator.springs][: 3 if n else 0], dtype=np.float64)
    M, C, K = (np.diag(row) for row in table.reshape(3, n))
    return _model(stator, radius, (M, C, K), ((1, "axial"), (1, "lateral"))[:n], centre=stator.centre)


def _model(
    seat: Seat,
    radius: float,
    matrices: tuple[Matrix, Matrix, Matrix],
    degrees: tuple[tuple[int, str], ...],
    *,
    tip: int = 1,
    length: float = math.inf,
    euler_load: float = math.inf,
    squared_slope: Matrix | None = None,
    centre: tuple[float, ...] = (0.0, 0.0),
) -> StatorModel:
    """Return a stator by its mass, damping and stiffness; without a length nothing depends on it."""
    mass, damping, stiffness = matrices
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
        length=length,
        euler_load=euler_load,
        strength=math.inf if seat.strength is None else seat.strength,
        axial=body.index(tip, "axial"),
        lateral=body.index(tip, "lateral"),
        squared_slope=squared_slope,
        centre=(centre[0], centre[1]),
        is_bore=seat.is_bore,
        friction_factor=seat.friction_factor,
        law=seat.law,
    )
