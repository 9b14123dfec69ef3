"""The rotor assembled: shaft sections, discs, bearings, torsional drive, damping and unbalance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.beam import ROTOR_DEGREES, join, rotor_element
from rubhpc.fem.damping import rayleigh_coefficients
from rubhpc.fem.model import Body

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.rig.rig import Rotor, Unbalance


def assemble_rotor(rotor: Rotor) -> Body:
    """Rotor reduced to its free degrees: axial motion is held at node 1, torsion where the drive holds it.

    Rayleigh damping takes in the springs of the bearings and of the drive, as the paper's proportional
    damping does; dampers of bearings and drive come on top.

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
    held = {(1, "u"), (drive.fixed_node, "thx")}
    degrees = [(node, name) for node in range(1, n_node + 1) for name in ROTOR_DEGREES]
    free = [row for row, degree in enumerate(degrees) if degree not in held]
    rows = np.ix_(free, free)
    return Body(
        mass=M[rows],
        damping=(alpha * M + beta * K + dampers)[rows],
        gyroscopic=G[rows],
        stiffness=K[rows],
        degrees=tuple(degrees[row] for row in free),
    )


def unbalance_vectors(
    unbalances: Sequence[Unbalance], body: Body
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unbalance per spin squared, (n_dof,) each, kg m: the factors of cos(spin t) and of sin(spin t).

    An unbalance `m e` at the phase p pulls with `m e spin^2 (cos(spin t + p), sin(spin t + p))` on (v, w); a
    direction in which the node cannot move does not feel it.
    """
    cosine, sine = np.zeros((2, body.n_dof))
    for unbalance in unbalances:
        moment = unbalance.mass * unbalance.radius
        along, across = moment * np.cos(unbalance.phase), moment * np.sin(unbalance.phase)
        for name, parts in (("v", (along, -across)), ("w", (across, along))):
            row = body.index(unbalance.node, name)
            if row >= 0:
                cosine[row] += parts[0]
                sine[row] += parts[1]
    return cosine, sine
