"""Assembly of a rotor: shaft sections, discs, bearings, torsional drive and damping, or its matrices."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.beam import ROTOR_DEGREES, join, rotor_element
from rubhpc.fem.damping import rayleigh_coefficients
from rubhpc.fem.model import Body, SpeedDependence, Support
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.rotors import MatrixRotor, Rotor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.bearing_table import AnyBearing


@singledispatch
def assemble_rotor(rotor: object) -> Body:
    """Return the body of a rotor; register a function for each kind of `rubhpc.rig.rotors`."""
    raise TypeError(f"no assembly for {type(rotor).__name__}")


@assemble_rotor.register(Rotor)
def _(rotor: Rotor) -> Body:
    """Shaft with axial motion constrained at node 1, and torsion where the drive constrains it.

    Rayleigh damping includes the springs of the bearings and of the drive, as the paper's proportional
    damping does; dampers of bearings and drive are added to it. Speed-dependent bearings are those of
    standstill; `Body.at` returns the rotor at another speed.

    Notes
    -----
    A disc tilted by (thy, thz) carries its polar momentum along `(1, thz, -thy)`, hence
    `Id thy'' + spin Ip thz' = My` and `Id thz'' - spin Ip thy' = Mz`.
    """
    sections = [[rotor_element(section)] * section.elements for section in rotor.shaft]
    shaft = join([element for equal in sections for element in equal])
    M, G, K = shaft.mass, shaft.gyroscopic, shaft.stiffness
    dampers = np.zeros_like(M)
    n_node = len(M) // 6

    for disc in rotor.disc:
        u, v, w, thx, thy, thz = range(6 * (disc.node - 1), 6 * disc.node)
        mass, diametral, polar = disc.inertia
        diagonal = [u, v, w, thx, thy, thz]
        M[diagonal, diagonal] += [mass, mass, mass, polar, diametral, diametral]
        G[thy, thz] += polar
        G[thz, thy] -= polar
    for bearing in rotor.bearing:
        if isinstance(bearing, BearingTable):
            continue
        first = 6 * (bearing.node - 1) + 1
        seat = slice(first, first + 2)
        K[seat, seat] += bearing.stiffness_matrix
        dampers[seat, seat] += bearing.damping_matrix
    drive = rotor.torsion
    if drive.fixed_node is None:
        thx = 6 * (drive.node - 1) + 3
        K[thx, thx] += drive.stiffness or 0.0
        dampers[thx, thx] += drive.damping

    alpha, beta = rayleigh_coefficients(rotor.damping)
    constrained = {(1, "u"), (drive.fixed_node, "thx")}
    degrees = [(node, name) for node in range(1, n_node + 1) for name in ROTOR_DEGREES]
    free = [row for row, degree in enumerate(degrees) if degree not in constrained]
    rows = np.ix_(free, free)
    body = Body(
        mass=M[rows],
        damping=(alpha * M + beta * K + dampers)[rows],
        gyroscopic=G[rows],
        stiffness=K[rows],
        degrees=tuple(degrees[row] for row in free),
    )
    return _with_tables(body, rotor.bearing, beta)


@assemble_rotor.register(MatrixRotor)
def _(rotor: MatrixRotor) -> Body:
    assert rotor.damping is not None  # zeros if not given
    assert rotor.gyroscopic is not None
    body = Body(
        mass=rotor.mass,
        damping=rotor.damping,
        gyroscopic=rotor.gyroscopic,
        stiffness=rotor.stiffness,
        degrees=rotor.degrees,
    )
    return _with_tables(body, rotor.bearing)


def _with_tables(body: Body, bearings: Sequence[AnyBearing], proportional: float = 0.0) -> Body:
    """Return a body with its speed-dependent bearings, at standstill.

    Parameters
    ----------
    body : Body
        Without its speed-dependent bearings.
    bearings : sequence of Bearing or BearingTable
    proportional : float
        Rayleigh's beta, s, which includes their stiffness.
    """
    supports = tuple(
        Support(
            table=bearing,
            rows=(body.index(bearing.node, "v"), body.index(bearing.node, "w")),
            name=f"rotor.bearing.{number}",
        )
        for number, bearing in enumerate(bearings, 1)
        if isinstance(bearing, BearingTable)
    )
    if not supports:
        return body
    by_speed = SpeedDependence(
        stiffness=body.stiffness, damping=body.damping, proportional=proportional, supports=supports
    )
    return replace(body, by_speed=by_speed).at(0.0)
