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

    from rubhpc.rig.parts import Damping, Tube
    from rubhpc.rig.stators import Stator

    Matrix = NDArray[np.float64]


def rayleigh_coefficients(damping: Damping) -> tuple[float, float]:
    """Coefficients alpha (1/s) and beta (s) of `D = alpha M + beta K`.

    A mode at angular frequency w then has the ratio `alpha / (2 w) + beta w / 2`. One given ratio is met
    by alpha alone, two are met exactly, and more in the least squares. Neither coefficient is let below
    zero, so two ratios that fall faster than 1/frequency are met in the least squares too: a negative
    beta, however small, would make the highest modes of the mesh grow.
    """
    if not damping.ratios:
        return damping.alpha, damping.beta
    from scipy.optimize import nnls  # 0.3 s to load, and few rigs ask for it

    omega = 2 * math.pi * np.array([frequency for frequency, _ in damping.ratios])
    ratio = np.array([ratio for _, ratio in damping.ratios])
    if len(omega) == 1:
        return float(2 * ratio[0] * omega[0]), 0.0
    # beta is sought as beta * scale^2, so that both columns are of one size
    scale = float(np.sqrt(omega.min() * omega.max()))
    columns = np.stack([0.5 / omega, 0.5 * omega / scale**2], axis=1)
    (alpha, beta), _ = nnls(columns, ratio)
    return float(alpha), float(beta / scale**2)


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


def rotor_elements(tube: Tube, lengths: Sequence[float]) -> list[Element]:
    """Return the elements of a shaft section or sleeve that is cut into `lengths` (m), from its left end.

    They are (12, 12), with degrees `ROTOR_DEGREES` at each node. The slope of v is `thz`, of w `-thy`. A
    slice of a round shaft has Ip = 2 Id, so by `Id thy'' + spin Ip thz' = My` and
    `Id thz'' - spin Ip thy' = Mz`, the equations of a disc, the gyroscopic matrix is twice the rotary mass
    matrix, between the two planes.
    """
    outer, inner = tube.diameters
    if outer[0] == outer[1] and inner[0] == inner[1]:
        of_length = {length: _cylinder(tube, length) for length in set(lengths)}
        return [of_length[length] for length in lengths]
    cuts = np.cumsum([0.0, *lengths]) / sum(lengths)
    ends = [tuple(np.interp(cuts, [0.0, 1.0], pair).tolist()) for pair in (outer, inner)]
    return [
        _cone(tube, length, (ends[0][i], ends[0][i + 1]), (ends[1][i], ends[1][i + 1]))
        for i, length in enumerate(lengths)
    ]


def _cylinder(tube: Tube, L: float) -> Element:
    """Return the element of a cylinder of the length L, m."""
    outer, inner = tube.outer_diameter, tube.inner_diameter
    area = math.pi / 4 * (outer**2 - inner**2)
    second_moment = math.pi / 64 * (outer**4 - inner**4)
    E, G, rho = tube.youngs_modulus, tube.modulus_in_shear, tube.density
    shear_rigidity = math.inf
    if tube.shear:
        shear_rigidity = shear_coefficient_circle(E / (2 * G) - 1, inner / outer) * G * area
    planar = bending(L, E * second_moment, shear_rigidity, rho * area, rho * second_moment)
    polar = 2 * second_moment
    return _in_space(*planar, bar(L, E * area, rho * area), bar(L, G * polar, rho * polar))


def _cone(tube: Tube, L: float, outer: tuple[float, float], inner: tuple[float, float]) -> Element:
    """Return the element of a tapered part of the length L, m, with the diameters at its ends.

    Energies are integrated, exactly by Gauss's points, over the deflections of a uniform beam with the shear
    parameter of the middle: G. Genta, A. Gugliotta, J. Sound Vib. 120 (1988) 175-182.
    """
    E, G, rho = tube.youngs_modulus, tube.modulus_in_shear, tube.density
    place, weight = np.polynomial.legendre.leggauss(5)
    x, weight = (1 + place) / 2, weight / 2
    d, bore = (ends[0] + (ends[1] - ends[0]) * x for ends in (outer, inner))
    area = math.pi / 4 * (d**2 - bore**2)
    second = math.pi / 64 * (d**4 - bore**4)
    phi, shear = 0.0, np.zeros_like(x)
    if tube.shear:
        shear = shear_coefficient_circle(E / (2 * G) - 1, sum(inner) / sum(outer)) * G * area
        middle = math.pi / 64 * ((sum(outer) / 2) ** 4 - (sum(inner) / 2) ** 4)
        phi = 12 * E * middle / (float(shear[2]) * L**2)  # the third of five points is the middle
    one = np.ones_like(x)
    deflection = np.array([
        1 - 3 * x**2 + 2 * x**3 + phi * (1 - x),
        L * (x - 2 * x**2 + x**3 + phi / 2 * (x - x**2)),
        3 * x**2 - 2 * x**3 + phi * x,
        L * (x**3 - x**2 - phi / 2 * (x - x**2)),
    ]) / (1 + phi)  # fmt: skip
    rotation = np.array([
        6 / L * (x**2 - x),
        1 - 4 * x + 3 * x**2 + phi * (1 - x),
        6 / L * (x - x**2),
        3 * x**2 - 2 * x + phi * x,
    ]) / (1 + phi)  # fmt: skip
    curvature = np.array([
        6 / L * (2 * x - 1),
        6 * x - 4 - phi,
        6 / L * (1 - 2 * x),
        6 * x - 2 + phi,
    ]) / (L * (1 + phi))  # fmt: skip
    strain = -phi / (1 + phi) * np.array([one / L, one / 2, -one / L, one / 2])

    def over(shape: Matrix, density: Matrix) -> Matrix:
        result: Matrix = (shape * (L * weight * density)) @ shape.T
        return result

    def rod(rigidity: Matrix, inertia: Matrix) -> tuple[Matrix, Matrix]:
        return over(np.array([1 - x, x]), inertia), over(np.array([-one / L, one / L]), rigidity)

    flexural = over(curvature, E * second) + over(strain, shear)
    polar = 2 * second
    return _in_space(
        over(deflection, rho * area),
        over(rotation, rho * second),
        flexural,
        rod(E * area, rho * area),
        rod(G * polar, rho * polar),
    )


def _in_space(
    translational: Matrix,
    rotary: Matrix,
    flexural: Matrix,
    tension: tuple[Matrix, Matrix],
    torsion: tuple[Matrix, Matrix],
) -> Element:
    """Return the element of a shaft from matrices in one plane (4, 4), in tension and torsion (2, 2)."""
    mass, gyroscopic, stiffness = np.zeros((3, 12, 12))
    for first, (inertia, rigidity) in ((0, tension), (3, torsion)):
        rows = np.ix_((first, first + 6), (first, first + 6))
        mass[rows], stiffness[rows] = inertia, rigidity

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
