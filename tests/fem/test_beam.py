"""Element matrices against quadrature of the exact static shapes, and against rigid-body mechanics."""

import math

import numpy as np
import pytest

from rubhpc.fem.beam import (
    ROTOR_DEGREES,
    bar,
    bending,
    rotor_elements,
    shear_coefficient_circle,
    shear_coefficient_rectangle,
)
from rubhpc.rig.parts import ShaftSection

LENGTH = 0.13
STEEL = {"youngs_modulus": 2.1e11, "shear_modulus": 8e10, "density": 7800.0}
ALUMINIUM = {"youngs_modulus": 7e10, "shear_modulus": 2.6e10, "density": 2700.0}
SECTIONS = {
    "solid": ShaftSection(length=LENGTH, outer_diameter=0.05, elements=1, **STEEL),
    "hollow": ShaftSection(length=LENGTH, outer_diameter=0.06, inner_diameter=0.045, elements=1, **ALUMINIUM),
    "rayleigh": ShaftSection(length=LENGTH, outer_diameter=0.05, elements=1, shear=False, **STEEL),
}


def quadrature(length, flexural_rigidity, shear_rigidity, mass, rotary_inertia):
    """The three matrices by integration of the shapes that an unloaded beam takes between its ends."""
    # deflection a0 + a1 x + a2 x^2 + a3 x^3; its slope exceeds the rotation by the shear angle, which the
    # bending moment's slope sets: kappa G A gamma = -E I v'''
    gamma = -6 * flexural_rigidity / shear_rigidity

    def deflection(x):
        return np.array([1, x, x**2, x**3])

    def rotation(x):
        return np.array([0, 1, 2 * x, 3 * x**2 - gamma])

    ends = np.array([deflection(0), rotation(0), deflection(length), rotation(length)])
    coefficients = np.linalg.inv(ends)
    shear = np.array([0, 0, 0, gamma])
    points, weights = np.polynomial.legendre.leggauss(4)
    translational, rotary, stiffness = np.zeros((3, 4, 4))
    for x, weight in zip(length * (points + 1) / 2, length * weights / 2, strict=True):
        curvature = np.array([0, 0, 2, 6 * x])
        translational += weight * mass * np.outer(deflection(x), deflection(x))
        rotary += weight * rotary_inertia * np.outer(rotation(x), rotation(x))
        stiffness += weight * flexural_rigidity * np.outer(curvature, curvature)
        if np.isfinite(shear_rigidity):
            stiffness += weight * shear_rigidity * np.outer(shear, shear)
    return [coefficients.T @ matrix @ coefficients for matrix in (translational, rotary, stiffness)]


@pytest.mark.parametrize("phi", [0.0, 0.02, 1.0, 30.0])
def test_bending_matrices_integrate_the_static_shapes(phi):
    length, flexural_rigidity = 0.3, 50.0
    shear_rigidity = 12 * flexural_rigidity / (phi * length**2) if phi else math.inf
    given = (length, flexural_rigidity, shear_rigidity, 3.0, 0.02)
    for matrix, reference in zip(bending(*given), quadrature(*given), strict=True):
        assert matrix == pytest.approx(reference, rel=1e-9, abs=1e-12 * np.abs(reference).max())


def test_bar_carries_a_uniform_strain():
    mass, stiffness = bar(2.0, 10.0, 3.0)
    assert stiffness @ [0.0, 0.1] == pytest.approx([-0.5, 0.5])
    assert np.array([1.0, 1.0]) @ mass @ [1.0, 1.0] == pytest.approx(6.0)
    assert np.array([0.0, 2.0]) @ mass @ [0.0, 2.0] == pytest.approx(3.0 * 2.0**3 / 3)


def element_of(section):
    return rotor_elements(section, [LENGTH])[0]


def rigid_motion(name):
    """Degrees of a two-node element in a unit translation or rotation about its first node."""
    motion = np.zeros((2, 6))
    motion[:, ROTOR_DEGREES.index(name)] = 1.0
    position = np.array([[0.0, 0, 0], [LENGTH, 0, 0]])
    motion[:, :3] += np.cross(motion[:, 3:], position)
    return motion.ravel()


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_rigid_body_has_its_inertia_and_no_force(section):
    element = element_of(section)
    outer, inner = section.outer_diameter / 2, section.inner_diameter / 2
    mass = section.density * math.pi * (outer**2 - inner**2) * LENGTH
    polar = mass * (outer**2 + inner**2) / 2
    about_end = polar / 2 + mass * LENGTH**2 / 3
    inertias = {"u": mass, "v": mass, "w": mass, "thx": polar, "thy": about_end, "thz": about_end}
    for name, inertia in inertias.items():
        motion = rigid_motion(name)
        assert np.abs(element.stiffness @ motion).max() < 1e-12 * np.abs(element.stiffness).max()
        assert motion @ element.mass @ motion == pytest.approx(inertia)


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_gyroscopic_moment_is_spin_momentum_cross_tilt_rate(section):
    element = element_of(section)
    outer, inner = section.outer_diameter / 2, section.inner_diameter / 2
    polar = section.density * math.pi * (outer**2 - inner**2) * LENGTH * (outer**2 + inner**2) / 2
    rate = np.array([0.0, 0.7, -0.4])
    tilting = rate[1] * rigid_motion("thy") + rate[2] * rigid_motion("thz")
    # a rotor whose momentum H = Ip x_hat tilts at this rate needs the moment rate x H
    needed = np.cross(rate, [polar, 0.0, 0.0])
    for axis, name in ((1, "thy"), (2, "thz")):
        assert rigid_motion(name) @ element.gyroscopic @ tilting == pytest.approx(needed[axis])
    for name in ("u", "v", "w", "thx"):
        assert rigid_motion(name) @ element.gyroscopic @ tilting == pytest.approx(0.0, abs=1e-12 * polar)


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_matrices_do_not_change_when_the_axes_turn_about_the_shaft(section):
    element = element_of(section)
    angle = 0.6
    turn = np.eye(12)
    for first in (1, 4, 7, 10):
        rows = slice(first, first + 2)
        turn[rows, rows] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    for matrix in (element.mass, element.gyroscopic, element.stiffness):
        assert turn @ matrix @ turn.T == pytest.approx(matrix, abs=1e-12 * np.abs(matrix).max())


def test_shear_coefficients_of_circles_and_rectangles():
    nu = 0.3
    assert shear_coefficient_circle(nu) == pytest.approx(0.886364, abs=1e-6)  # Cowper's table
    assert shear_coefficient_circle(0.0) == pytest.approx(6 / 7)
    # the thin tube: 2 (1 + nu) / (4 + 3 nu)
    assert shear_coefficient_circle(nu, 0.9999) == pytest.approx(2 * 1.3 / 4.9, rel=1e-7)
    assert shear_coefficient_rectangle(nu) == pytest.approx(0.849673, abs=1e-6)
    assert shear_coefficient_rectangle(0.0) == pytest.approx(5 / 6)
