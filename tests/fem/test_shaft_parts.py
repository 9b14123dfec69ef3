"""Tapered sections, sleeves, masses of bearings and pedestals: known answers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate
from scipy.linalg import eigh

from rubhpc import assemble
from rubhpc.fem.assemble import model_at
from rubhpc.fem.beam import join, rotor_elements
from rubhpc.fem.modes import modes
from rubhpc.fem.probes import with_probes
from rubhpc.fem.response import first_lateral_frequency
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Bearing, Disc, ShaftSection, Sleeve
from rubhpc.rig.probes import Probe
from rubhpc.rig.supports import Pedestal

STEEL = {"youngs_modulus": 2.1e11, "poissons_ratio": 0.3, "density": 7800.0}
MATRICES = ("mass", "damping", "gyroscopic", "stiffness")


@pytest.fixture(scope="module")
def packaged():
    return read_rig("mokhtar2017")


def with_parts(rig, **parts):
    return replace(rig, rotor=replace(rig.rotor, **parts))


def tube(length=0.3, *, shear=True, right=(None, None), **given):
    given = {"outer_diameter": 0.05, "inner_diameter": 0.02} | given
    ends = {"outer_diameter_right": right[0], "inner_diameter_right": right[1]}
    return ShaftSection(length=length, elements=1, shear=shear, **ends, **STEEL, **given)


def cantilever(section, n):
    """Mass and stiffness matrix in the vertical plane, of n elements, the left end clamped."""
    shaft = join(rotor_elements(section, [section.length / n] * n))
    rows = [6 * node + row for node in range(1, n + 1) for row in (1, 5)]
    return shaft.mass[np.ix_(rows, rows)], shaft.stiffness[np.ix_(rows, rows)]


@pytest.mark.parametrize("shear", [True, False])
def test_a_taper_that_vanishes_is_a_cylinder(shear):
    straight = rotor_elements(tube(shear=shear), [0.3])[0]
    tapered = rotor_elements(tube(shear=shear, right=(0.05 * (1 + 1e-13), None)), [0.3])[0]
    for name in ("mass", "gyroscopic", "stiffness"):
        expected = getattr(straight, name)
        assert getattr(tapered, name) == pytest.approx(
            expected, rel=1e-10, abs=1e-12 * np.abs(expected).max()
        )


def test_a_cone_has_its_mass_and_inertias():
    """Of a frustum: mass rho pi L (R^2 + R r + r^2) / 3, polar inertia rho pi L (R^4 + ... + r^4) / 10."""
    element = rotor_elements(tube(right=(0.08, 0.03)), [0.3])[0]
    (a, b), (c, d) = (0.025, 0.04), (0.01, 0.015)
    rho, length = STEEL["density"] * math.pi, 0.3
    mass = rho * length / 3 * (a * a + a * b + b * b - (c * c + c * d + d * d))
    fourth = [sum(x ** (4 - k) * y**k for k in range(5)) for x, y in ((a, b), (c, d))]
    polar = rho * length / 10 * (fourth[0] - fourth[1])
    along = np.tile([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 2)
    turned = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 2)
    assert along @ element.mass @ along == pytest.approx(mass)
    assert turned @ element.mass @ turned == pytest.approx(polar)
    for matrix in (element.mass, element.stiffness):
        assert matrix == pytest.approx(matrix.T, rel=1e-12, abs=1e-12 * np.abs(matrix).max())
    assert np.abs(element.stiffness @ along).max() < 1e-9 * np.abs(element.stiffness).max()


def test_a_conical_cantilever_sags_and_vibrates_as_known():
    """Tip deflection F L^3 / (3 E I) D / d, with I and D at the root and d at the tip.

    G. Kirchhoff (1879): a slender cone clamped at its base has a frequency of 8.7193 sqrt(E I / rho A) / L^2.
    """
    root, tip, length = 0.02, 0.01, 2.0
    E, rho = STEEL["youngs_modulus"], STEEL["density"]
    area, second = math.pi / 4 * root**2, math.pi / 64 * root**4
    exact = length**3 / (3 * E * second) * root / tip
    errors = []
    for n in (2, 4, 8):
        _, stiffness = cantilever(
            tube(length, shear=False, outer_diameter=root, inner_diameter=0.0, right=(tip, None)), n
        )
        force = np.zeros(2 * n)
        force[-2] = 1.0
        errors.append(abs(np.linalg.solve(stiffness, force)[-2] / exact - 1))
    assert errors[-1] < 1e-4
    assert errors[0] / errors[1] > 8 < errors[1] / errors[2]  # fourth order, in the end

    pointed = tube(length, shear=False, outer_diameter=root, inner_diameter=0.0, right=(1e-6 * root, None))
    mass, stiffness = cantilever(pointed, 40)
    lowest = math.sqrt(eigh(stiffness, mass, eigvals_only=True, subset_by_index=[0, 0])[0])
    assert lowest * length**2 / math.sqrt(E * second / (rho * area)) == pytest.approx(8.7193, rel=1e-4)


def test_a_sleeve_of_the_shafts_material_is_a_thicker_shaft(packaged):
    """Of Rayleigh beams, whose second moments of area add up."""
    (section,) = packaged.rotor.shaft
    parts = [replace(section, length=n * section.length / 14, elements=n, shear=False) for n in (4, 3, 7)]
    thick = [parts[0], replace(parts[1], outer_diameter=0.05), parts[2]]
    material = {name: getattr(section, name) for name in ("youngs_modulus", "shear_modulus", "density")}
    around = {"outer_diameter": 0.05, "inner_diameter": section.outer_diameter, "shear": False} | material
    sleeve = Sleeve(position=parts[0].length, length=parts[1].length, **around)
    sleeved = with_parts(packaged, shaft=tuple(parts), sleeve=(sleeve,))
    for name in MATRICES:
        one, other = (
            getattr(assemble(rig).rotor, name) for rig in (sleeved, with_parts(packaged, shaft=tuple(thick)))
        )
        assert one == pytest.approx(other, rel=1e-9, abs=1e-12 * np.abs(other).max())


def test_a_bearings_mass_is_that_of_a_disc_without_inertia(packaged):
    disc = Disc(node=15, mass=0.7, diametral_inertia=0.0, polar_inertia=0.0)
    first, last = packaged.rotor.bearing
    heavy = assemble(with_parts(packaged, bearing=(first, replace(last, mass=0.7)))).rotor
    with_disc = assemble(with_parts(packaged, disc=(*packaged.rotor.disc, disc))).rotor
    rows = [i for i, (_, name) in enumerate(heavy.degrees) if name in ("v", "w")]
    assert heavy.mass[np.ix_(rows, rows)] == pytest.approx(with_disc.mass[np.ix_(rows, rows)])
    unlike = assemble(with_parts(packaged, bearing=(first, replace(last, mzz=0.7)))).rotor
    added = unlike.mass - assemble(packaged).rotor.mass
    assert np.argwhere(added).tolist() == [[unlike.index(15, "w")] * 2]


def test_a_light_pedestal_is_a_spring_in_series(packaged):
    """K_series^-1 = K_bearing^-1 + K_pedestal^-1, of matrices; with a table; two in series."""
    first = packaged.rotor.bearing[0]
    bearing = Bearing(node=15, kyy=2e6, kzz=3e6, kyz=4e5, kzy=-1e5)
    pedestal = Pedestal(mass=1e-7, kyy=1e6, kzz=4e6, kyz=2e5, kzy=2e5)
    series = np.linalg.inv(np.linalg.inv(bearing.stiffness_matrix) + np.linalg.inv(pedestal.stiffness_matrix))
    keys = ("kyy", "kyz", "kzy", "kzz")
    direct = Bearing(node=15, **dict(zip(keys, series.ravel().tolist(), strict=True)))
    given = {key: (getattr(bearing, key),) for key in keys}
    table = BearingTable(node=15, speed=(0.0, 500.0), pedestal=pedestal, **given)
    halves = replace(pedestal, kyy=2e6, kzz=8e6, kyz=4e5, kzy=4e5)
    twice = replace(bearing, pedestal=replace(halves, pedestal=halves))
    expected = [
        mode.eigenvalue for mode in modes(assemble(with_parts(packaged, bearing=(first, direct))).rotor)
    ]
    for support, last in ((replace(bearing, pedestal=pedestal), 16), (table, 16), (twice, 17)):
        rig = with_parts(packaged, bearing=(first, support))
        body = assemble(rig).rotor
        assert body.degrees[-2:] == ((last, "v"), (last, "w"))
        assert rig.rotor.positions[15:] == pytest.approx(0.8)
        found = [mode.eigenvalue for mode in modes(body)]
        assert found[:8] == pytest.approx(expected[:8], rel=1e-6)


def test_a_pedestal_lowers_the_frequency_of_a_rigid_rotor():
    """Two masses on two springs in series, in closed form; the shaft is as good as rigid."""
    rig = read_rig("mokhtar2017")
    (section,) = rig.rotor.shaft
    stiff = replace(section, youngs_modulus=1e16, shear_modulus=4e15)
    stand = Pedestal(mass=1.5, stiffness=3e6, damping=10.0)
    bearings = tuple(replace(bearing, pedestal=stand) for bearing in rig.rotor.bearing)
    model = assemble(with_parts(rig, shaft=(stiff,), bearing=bearings))
    up = np.array([name == "v" and node <= 15 for node, name in model.rotor.degrees], dtype=float)
    mass = up @ model.rotor.mass @ up
    k, kp, m = 1e6, 3e6, mass / 2
    expected = np.linalg.eigvals(np.array([[k / m, -k / m], [-k / 1.5, (k + kp) / 1.5]]))
    assert first_lateral_frequency(model) == pytest.approx(math.sqrt(expected.min()), rel=1e-4)


def test_a_probe_of_a_bearing_on_a_pedestal_sees_the_force_between_them(packaged):
    """The pedestal's own equation of motion, in which the bearing is the only other force."""
    stand = Pedestal(mass=2.0, kyy=3e6, kzz=2e6, damping=40.0)
    table = BearingTable(
        node=15, speed=(0.0, 400.0), stiffness=(1e6, 2e6), damping=(50.0, 90.0), mass=0.4, pedestal=stand
    )
    rig = with_parts(packaged, bearing=(packaged.rotor.bearing[0], table))
    model = model_at(assemble(rig), 200.0)
    probe = Probe(name="force", node=15, angle=math.pi / 2, quantity="bearing_force")
    seen = with_probes(model, rig, (probe,), 200.0).probe.rows[:, 0, : model.rotor.n_dof]
    row, alpha = model.rotor.index(16, "w"), packaged.rotor.damping.alpha
    own = np.zeros((3, model.rotor.n_dof))
    own[:, row] = 2e6, 40.0 + alpha * 2.0, 2.0
    body = (model.rotor.stiffness[row], model.rotor.damping[row], model.rotor.mass[row])
    assert seen == pytest.approx(own - np.array(body), abs=1e-6)


def test_schemes_agree_of_a_rotor_with_all_of_it(packaged):
    """Rub with a tapered, sleeved shaft in bearings with masses on pedestals, one with a table."""
    (section,) = packaged.rotor.shaft
    halves = [
        replace(section, length=0.4, elements=7, outer_diameter=a, outer_diameter_right=b)
        for a, b in ((0.016, 0.022), (0.022, 0.016))
    ]
    material = {"youngs_modulus": 1e11, "poissons_ratio": 0.34, "density": 8800.0}
    sleeve = Sleeve(node=8, length=0.8 / 7, outer_diameter=0.03, inner_diameter=0.022, **material)
    stand = Pedestal(mass=3.0, kyy=4e6, kzz=2e6, damping=150.0)
    table = {"speed": (0.0, 400.0), "stiffness": (1e6, 3e6), "damping": (900.0, 300.0)}
    bearings = (
        Bearing(position=0.0, stiffness=1e6, damping=100.0, mass=0.2, pedestal=stand),
        BearingTable(position=0.8, mass=0.3, pedestal=stand, **table),
    )
    rig = with_parts(packaged, shaft=tuple(halves), sleeve=(sleeve,), bearing=bearings)
    case = {"speed": 140.0, "clearance": 5e-5, "friction": 0.1, "transient": 1, "revolutions": 2}
    exact = simulate(rig, **case)
    stepped = simulate(rig, method="central-difference", step=1e-6, **case)
    assert exact.contact_impulse[0] > 0.0
    assert exact.energy_residual < 1e-9
    # the difference falls with the step: 1e-5 at 0.1 us
    assert stepped.contact_impulse == pytest.approx(exact.contact_impulse, rel=2e-4)
    assert stepped.vertical == pytest.approx(exact.vertical, abs=1e-5 * np.ptp(exact.vertical))
