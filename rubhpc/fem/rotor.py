"""Assembly of a rotor from its parts (shaft sections, sleeves, discs, supports, drive) or its matrices."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.beam import ROTOR_DEGREES, join, rayleigh_coefficients, rotor_elements
from rubhpc.fem.model import Body, SpeedDependence, Support, couple
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.rotors import MatrixRotor, Rotor
from rubhpc.rig.supports import Springs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.rotors import AnyRotor

GROUND = (-1, -1)


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
    lengths = [[section.length / section.elements] * section.elements for section in rotor.shaft]
    sections = [rotor_elements(*given) for given in zip(rotor.shaft, lengths, strict=True)]
    shaft = join([element for equal in sections for element in equal])
    n_shaft = len(shaft.mass)
    stands = [node for stand in rotor.stands.values() for node, _ in stand]
    n_all = n_shaft + 2 * len(stands)
    M, G, K, dampers = np.zeros((4, n_all, n_all))
    for matrix, own in ((M, shaft.mass), (G, shaft.gyroscopic), (K, shaft.stiffness)):
        matrix[:n_shaft, :n_shaft] = own
    degrees = [(node, name) for node in range(1, rotor.n_node + 1) for name in ROTOR_DEGREES]
    degrees += [(node, name) for node in stands for name in ("v", "w")]

    every = [length for equal in lengths for length in equal]
    for sleeve in rotor.sleeve:
        first, last = rotor.sleeve_nodes(sleeve)
        part = join(rotor_elements(sleeve, every[first - 1 : last - 1]))
        covered = slice(6 * (first - 1), 6 * last)
        for matrix, added in ((M, part.mass), (G, part.gyroscopic), (K, part.stiffness)):
            matrix[covered, covered] += added
    for disc in rotor.disc:
        node = rotor.node_of(disc)
        u, v, w, thx, thy, thz = range(6 * (node - 1), 6 * node)
        mass, diametral, polar = disc.inertia
        diagonal = [u, v, w, thx, thy, thz]
        M[diagonal, diagonal] += [mass, mass, mass, polar, diametral, diametral]
        G[thy, thz] += polar
        G[thz, thy] -= polar
    for number, bearing in enumerate(rotor.bearing, 1):
        supports = [bearing, *(pedestal for _, pedestal in rotor.stands[number])]
        nodes = [rotor.node_of(bearing), *(node for node, _ in rotor.stands[number])]
        places = [*(_rows(degrees, node) for node in nodes), GROUND]
        for support, near, far in zip(supports, places, places[1:], strict=False):
            # the mass of a pedestal is its own, that of a bearing acts on relative motion
            couple(M, np.array(support.mass_matrix), near, far if support is bearing else GROUND)
            if isinstance(support, Springs):
                couple(K, np.array(support.stiffness_matrix), near, far)
                couple(dampers, np.array(support.damping_matrix), near, far)
    drive = rotor.torsion
    if drive.fixed_node is None:
        thx = 6 * (drive.node - 1) + 3
        K[thx, thx] += drive.stiffness or 0.0
        dampers[thx, thx] += drive.damping

    alpha, beta = rayleigh_coefficients(rotor.damping)
    constrained = {(1, "u"), (drive.fixed_node, "thx")}
    free = [row for row, degree in enumerate(degrees) if degree not in constrained]
    rows = np.ix_(free, free)
    body = Body(
        mass=M[rows],
        damping=(alpha * M + beta * K + dampers)[rows],
        gyroscopic=G[rows],
        stiffness=K[rows],
        degrees=tuple(degrees[row] for row in free),
    )
    return _with_tables(body, rotor, beta)


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
    return _with_tables(body, rotor)


def _rows(degrees: Sequence[tuple[int, str]], node: int | None) -> tuple[int, int]:
    """Rows of "v" and "w" of a node; -1 where there is none."""
    v, w = ((node, name) for name in ("v", "w"))
    return (degrees.index(v) if v in degrees else -1, degrees.index(w) if w in degrees else -1)


def _with_tables(body: Body, rotor: AnyRotor, proportional: float = 0.0) -> Body:
    """Return a body with the speed-dependent bearings of its rotor, at standstill.

    Parameters
    ----------
    body : Body
        Without its speed-dependent bearings.
    rotor : Rotor or MatrixRotor
    proportional : float
        Rayleigh's beta, s, which includes their stiffness.
    """
    supports = tuple(
        Support(
            table=bearing,
            node=rotor.node_of(bearing),
            rows=_rows(body.degrees, rotor.node_of(bearing)),
            far=_rows(body.degrees, rotor.stands_on(number)),
            name=f"rotor.bearing.{number}",
        )
        for number, bearing in enumerate(rotor.bearing, 1)
        if isinstance(bearing, BearingTable)
    )
    if not supports:
        return body
    by_speed = SpeedDependence(
        stiffness=body.stiffness, damping=body.damping, proportional=proportional, supports=supports
    )
    return replace(body, by_speed=by_speed).at(0.0)
