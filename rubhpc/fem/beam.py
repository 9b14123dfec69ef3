"""Element matrices of Timoshenko beams, in closed form.

Consistent matrices with the shear parameter `phi = 12 EI / (kappa G A L^2)`: J. S. Przemieniecki, Theory of
Matrix Structural Analysis (1968), Secs. 5.6 and 11.4; for rotors H. D. Nelson, J. Mech. Design 102 (1980)
793-803.
With phi = 0 they are those of a Rayleigh beam, which has rotary inertia but no shear deformation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.rig.parts import ShaftSection
    from rubhpc.rig.stators import Stator

    Matrix = NDArray[np.float64]

ROTOR_DEGREES = ("u", "v", "w", "thx", "thy", "thz")
STATOR_DEGREES = ("axial", "lateral", "rotation")


@dataclass(frozen=True, kw_only=True, eq=False)
class Element:
    """Matrices of one element, or of several joined, node by node, in SI units.

    Attributes
    ----------
    mass, gyroscopic, stiffness : (n_dof, n_dof)
        For one element (12, 12) of a rotor, (6, 6) of a stator. The gyroscopic matrix holds for a spin of
        1 rad/s.
    """

    mass: Matrix
    gyroscopic: Matrix
    stiffness: Matrix


def join(elements: Sequence[Element]) -> Element:
    """Return the assembled matrices, (n_dof, n_dof), of elements joined end to end."""
    half = len(elements[0].mass) // 2
    n_dof = half * (len(elements) + 1)
    mass, gyroscopic, stiffness = np.zeros((3, n_dof, n_dof))
    for i_element, element in enumerate(elements):
        rows = slice(half * i_element, half * (i_element + 2))
        mass[rows, rows] += element.mass
        gyroscopic[rows, rows] += element.gyroscopic
        stiffness[rows, rows] += element.stiffness
    return Element(mass=mass, gyroscopic=gyroscopic, stiffness=stiffness)


def shear_coefficient_circle(poissons_ratio: float, bore_ratio: float = 0.0) -> float:
    """Return Cowper's shear coefficient of a circle with a bore of `bore_ratio` times its diameter.

    G. R. Cowper, J. Appl. Mech. 33 (1966) 335-340.
    """
    square = bore_ratio**2
    closed = (1 + square) ** 2
    return (
        6 * (1 + poissons_ratio) * closed
        / ((7 + 6 * poissons_ratio) * closed + (20 + 12 * poissons_ratio) * square)
    )  # fmt: skip


def shear_coefficient_rectangle(poissons_ratio: float) -> float:
    """Return Cowper's shear coefficient of a rectangle; it does not depend on the sides."""
    return 10 * (1 + poissons_ratio) / (12 + 11 * poissons_ratio)


def bar(length: float, rigidity: float, inertia: float) -> tuple[Matrix, Matrix]:
    """Return consistent mass and stiffness matrix of a bar in tension or torsion.

    Parameters
    ----------
    length : float
        m.
    rigidity : float
        E A, N, or G J, N m^2.
    inertia : float
        Per length: rho A, kg/m, or rho J, kg m.

    Returns
    -------
    mass, stiffness : (2, 2)
    """
    mass = inertia * length / 6 * np.array([[2.0, 1.0], [1.0, 2.0]])
    stiffness = rigidity / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return mass, stiffness


def bending(
    length: float, flexural_rigidity: float, shear_rigidity: float, mass: float, rotary_inertia: float
) -> tuple[Matrix, Matrix, Matrix]:
    """Return translational mass, rotary mass and stiffness matrix of a beam bent in one plane.

    Degrees: deflection and rotation of the first end, then of the second. The rotation has the sign of the
    slope; without shear deformation it is the slope.

    Parameters
    ----------
    length : float
        L, m.
    flexural_rigidity : float
        E I, N m^2.
    shear_rigidity : float
        kappa G A, N; infinite without shear deformation.
    mass : float
        rho A, kg/m.
    rotary_inertia : float
        rho I, kg m.

    Returns
    -------
    translational, rotary, stiffness : (4, 4)
        In kg, kg m or kg m^2, and N/m, N or N m, depending on the degrees coupled.
    """
    L = length
    phi = 12 * flexural_rigidity / (shear_rigidity * L**2)

    a = 13 / 35 + 7 * phi / 10 + phi**2 / 3
    b = 9 / 70 + 3 * phi / 10 + phi**2 / 6
    c = (11 / 210 + 11 * phi / 120 + phi**2 / 24) * L
    d = (13 / 420 + 3 * phi / 40 + phi**2 / 24) * L
    e = (1 / 105 + phi / 60 + phi**2 / 120) * L**2
    f = -(1 / 140 + phi / 60 + phi**2 / 120) * L**2
    translational = mass * L / (1 + phi) ** 2 * _symmetric(a, b, c, d, e, f)

    a = 6 / 5
    c = (1 / 10 - phi / 2) * L
    e = (2 / 15 + phi / 6 + phi**2 / 3) * L**2
    f = (-1 / 30 - phi / 6 + phi**2 / 6) * L**2
    rotary = rotary_inertia / (L * (1 + phi) ** 2) * _symmetric(a, -a, c, -c, e, f)

    e, f = (4 + phi) * L**2, (2 - phi) * L**2
    stiffness = flexural_rigidity / (L**3 * (1 + phi)) * _symmetric(12, -12, 6 * L, -6 * L, e, f)
    return translational, rotary, stiffness


def squared_slope(length: float, flexural_rigidity: float, shear_rigidity: float) -> Matrix:
    """Return the matrix S (4, 4), 1/m, whose form `u^T S u` is the integral of the squared slope of a beam.

    Degrees and parameters as in `bending`. Half of it is by how much the ends of a bent beam come nearer to
    each other while its axis keeps its length; S is the stiffness that a unit axial tension adds.
    """
    L = length
    phi = 12 * flexural_rigidity / (shear_rigidity * L**2)
    a = 6 / 5 + 2 * phi + phi**2
    e = (2 / 15 + phi / 6 + phi**2 / 12) * L**2
    f = -(1 / 30 + phi / 6 + phi**2 / 12) * L**2
    slope: Matrix = _symmetric(a, -a, L / 10, -L / 10, e, f) / (L * (1 + phi) ** 2)
    return slope


def _symmetric(a: float, b: float, c: float, d: float, e: float, f: float) -> Matrix:
    """Return the matrix of a beam that is symmetric about its middle."""
    return np.array([[a, c, b, -d], [c, e, d, f], [b, d, a, -c], [-d, f, -c, e]])


def rotor_element(section: ShaftSection) -> Element:
    """Return the element of a shaft section: (12, 12), degrees `ROTOR_DEGREES` at each node.

    The slope of v is `thz`, that of w is `-thy`. A slice of a round shaft has Ip = 2 Id, so by
    `Id thy'' + spin Ip thz' = My` and `Id thz'' - spin Ip thy' = Mz`, the equations of a disc, the gyroscopic
    matrix is twice the rotary mass matrix, between the two planes.
    """
    L = section.length / section.elements
    outer, inner = section.outer_diameter, section.inner_diameter
    area = math.pi / 4 * (outer**2 - inner**2)
    second_moment = math.pi / 64 * (outer**4 - inner**4)
    E, G, rho = section.youngs_modulus, section.shear_modulus, section.density
    shear_rigidity = math.inf
    if section.shear:
        shear_rigidity = shear_coefficient_circle(E / (2 * G) - 1, inner / outer) * G * area
    translational, rotary, flexural = bending(
        L, E * second_moment, shear_rigidity, rho * area, rho * second_moment
    )

    mass, gyroscopic, stiffness = np.zeros((3, 12, 12))
    polar = 2 * second_moment
    for first, rigidity, inertia in ((0, E * area, rho * area), (3, G * polar, rho * polar)):
        rows = np.ix_((first, first + 6), (first, first + 6))
        mass[rows], stiffness[rows] = bar(L, rigidity, inertia)

    vertical, horizontal = [1, 5, 7, 11], [2, 4, 8, 10]
    sign = np.array([1.0, -1.0, 1.0, -1.0])  # of the rotation: thz in the x-y plane, -thy in the x-z plane
    both = np.outer(sign, sign)
    mass[np.ix_(vertical, vertical)] = translational + rotary
    mass[np.ix_(horizontal, horizontal)] = both * (translational + rotary)
    stiffness[np.ix_(vertical, vertical)] = flexural
    stiffness[np.ix_(horizontal, horizontal)] = both * flexural
    gyroscopic[np.ix_(vertical, horizontal)] = 2 * rotary * sign
    gyroscopic[np.ix_(horizontal, vertical)] = -2 * rotary * sign[:, np.newaxis]
    return Element(mass=mass, gyroscopic=gyroscopic, stiffness=stiffness)


def stator_element(stator: Stator) -> Element:
    """Return the element of a stator: (6, 6), degrees `STATOR_DEGREES` at each node, from root to tip."""
    L = stator.length / stator.elements
    area, second_moment = stator.area, stator.second_moment
    E, rho = stator.youngs_modulus, stator.density
    flexural_rigidity, shear_rigidity = _bending_rigidities(stator)
    translational, rotary, flexural = bending(
        L, flexural_rigidity, shear_rigidity, rho * area, rho * second_moment
    )

    mass, stiffness = np.zeros((2, 6, 6))
    axial, lateral = np.ix_((0, 3), (0, 3)), np.ix_((1, 2, 4, 5), (1, 2, 4, 5))
    mass[axial], stiffness[axial] = bar(L, E * area, rho * area)
    mass[lateral], stiffness[lateral] = translational + rotary, flexural
    return Element(mass=mass, gyroscopic=np.zeros((6, 6)), stiffness=stiffness)


def stator_foreshortening(stator: Stator) -> Matrix:
    """Return the squared slope of a meshed stator, (3 n_node, 3 n_node), 1/m: `squared_slope`, assembled."""
    element = np.zeros((6, 6))
    lateral = np.ix_((1, 2, 4, 5), (1, 2, 4, 5))
    element[lateral] = squared_slope(stator.length / stator.elements, *_bending_rigidities(stator))
    nothing = np.zeros_like(element)
    part = Element(mass=nothing, gyroscopic=nothing, stiffness=element)
    return join([part] * stator.elements).stiffness


def _bending_rigidities(stator: Stator) -> tuple[float, float]:
    """E I (N m^2) and kappa G A (N) of a stator."""
    E, nu = stator.youngs_modulus, stator.poissons_ratio
    is_round = stator.diameter is not None
    coefficient = shear_coefficient_circle(nu) if is_round else shear_coefficient_rectangle(nu)
    return E * stator.second_moment, coefficient * E / (2 * (1 + nu)) * stator.area
