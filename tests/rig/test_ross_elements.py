"""Every kind of element and rotor of ROSS, built from its own classes: taken over as ROSS has it, or refused.

Collected where ROSS is installed, 2.3 or 3. What solves for a film or a gas gets a table in place of that.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import ross
from ross.bearing_seal_element import BearingElement
from ross.element import Element
from ross_answers import differences

from rubhpc import InputError, Rig, assemble
from rubhpc.fem.modes import modes
from rubhpc.rig.reading import rig_from_dict

STEEL = ross.Material("steel_tested", rho=7850.0, E=206e9, G_s=79e9)
SPEEDS = (60.0, 130.0, 410.0)  # rad/s
AXIS = "speed" if hasattr(ross.BearingElement(0, kxx=1.0, cxx=0.0), "speed") else "frequency"
LAST = 6  # node of the right end
# Lines over the speed, of which the interpolations of ROSS 2 and 3 are exact.
TABLE_SPEED = np.linspace(0.0, 600.0, 7)
LINES = {"kxx": (2e7, 8e6), "kyy": (3e7, -5e6), "kxy": (1e6, 2e6), "kyx": (-1e6, -3e6)}
LINES |= {"cxx": (2e4, -1e4), "cyy": (3e4, -1e4)}
TABLE = {name: list(a + b * TABLE_SPEED / 600.0) for name, (a, b) in LINES.items()}


def shaft(**given):
    return [
        ross.ShaftElement(0.15, 0.0, 0.04, material=STEEL, **given),
        ross.ShaftElement(0.15, 0.01, 0.04, idr=0.02, odr=0.06, material=STEEL, **given),  # tapered
        *(ross.ShaftElement(0.1 + 0.02 * i, 0.02, 0.06, material=STEEL, **given) for i in range(4)),
    ]


def rotor(*elements, bearings=None, kind=ross.Rotor, shaft_elements=None, **given):
    discs = [ross.DiskElement(n=3, m=20.0, Id=0.15, Ip=0.28)]
    discs += [e for e in elements if isinstance(e, ross.DiskElement)]
    if bearings is None:
        bearings = [simple(0), simple(LAST)]
    bearings = [*bearings, *(e for e in elements if isinstance(e, BearingElement))]
    masses = [e for e in elements if isinstance(e, ross.PointMass)]
    return kind(shaft_elements or shaft(), discs, bearings, masses, **given)


def simple(n, **given):
    return ross.BearingElement(n=n, **({"kxx": 2e7, "kyy": 3e7, "cxx": 2e3, "cyy": 1e3} | given))


def table(cls, n=LAST, **given):
    """A bearing of a class with a table, without the solution that gives it."""
    bearing = cls.__new__(cls)
    BearingElement.__init__(bearing, n=n, **({AXIS: TABLE_SPEED} | TABLE | given))
    return bearing


def on_table(cls):
    return lambda: rotor(table(cls), bearings=[simple(0)])


def seal(cls):
    return lambda: rotor(table(cls, n=4, kxx=list(np.full(7, -2e5)), mxx=0.7, myy=0.5))


def with_bearing(build):
    return lambda: rotor(build(), bearings=[simple(0)])


def gear(cls=ross.GearElement):
    if cls.__name__ == "GearElementTVMS":
        gear = {"material": STEEL, "width": 0.02, "bore_diameter": 0.06, "module": 0.002, "n_teeth": 55}
        return rotor(cls(n=2, pr_angle=0.35, **gear))
    return rotor(cls(n=2, m=5.0, Id=0.02, Ip=0.04, n_teeth=37, base_diameter=0.19, pr_angle=0.35))


def coupled():
    """Two shafts, joined by a coupling that is stiff in all directions but along the axis."""
    stiff = {"kt_x": 3e7, "kt_y": 2e7, "kr_x": 3e5, "kr_y": 2e5, "kr_z": 4e5, "ct_x": 100.0, "cr_y": 3.0}
    coupling = ross.CouplingElement(m_l=3.0, m_r=2.0, Ip_l=0.02, Ip_r=0.01, **stiff)
    parts = shaft()
    parts[4] = coupling
    return rotor(simple(3), shaft_elements=parts)


def magnetic():
    gains = {"g0": 1e-3, "i0": 1.0, "ag": 1e-4, "nw": 400, "kp_pid": 2e6, "kd_pid": 2e3, "ki_pid": 0.0}
    return ross.MagneticBearingElement(n=LAST, frequency=np.linspace(1.0, 600.0, 40), **gains)


def cylindrical():
    film = {"weight": 525.0, "bearing_length": 0.03, "journal_diameter": 0.1, "radial_clearance": 1e-4}
    return ross.CylindricalBearing(n=LAST, speed=[50.0, *SPEEDS, 500.0], oil_viscosity=0.1, **film)


def squeeze_film():
    journal = {"journal_diameter": 0.129} if AXIS == "speed" else {"journal_radius": 0.0645}
    film = {"axial_length": 0.023, "radial_clearance": 7.5e-5, "eccentricity_ratio": 0.5}
    return ross.SqueezeFilmDamper(
        n=3, frequency=np.linspace(10.0, 600.0, 5), lubricant="ISOVG32", **film, **journal
    )


def thrust_pad():
    return table(ross.ThrustPad, n=3, kxx=0.0, cxx=0.0, kyy=0.0, cyy=0.0, kxy=0.0, kyx=0.0, kzz=TABLE["kxx"])


def pedestals():
    """One bearing on a pedestal, one with a table on another, both of unlike springs."""
    stands = [
        simple(LAST + 1, kxx=6e6, kyy=9e6, cxx=500.0, cyy=300.0),
        simple(LAST + 2, kxx=5e6, kyy=8e6, cxx=0.0, cyy=200.0, mxx=1.0, myy=2.0),
    ]
    linked = [simple(0, n_link=LAST + 1, mxx=0.3, myy=0.4), table(ross.BearingElement, n_link=LAST + 2)]
    masses = [ross.PointMass(n=LAST + 1, m=15.0), ross.PointMass(n=LAST + 2, mx=9.0, my=12.0, mz=5.0)]
    return rotor(*masses, bearings=[*linked, *stands])


def sleeve():
    """Elements with the numbers of others lie around them."""
    inside = [ross.ShaftElement(0.1, 0.0, 0.04, material=STEEL, n=i) for i in range(6)]
    around = [ross.ShaftElement(0.1, 0.04, 0.07, material=STEEL, n=i) for i in (1, 2)]
    return rotor(shaft_elements=[*inside, *around])


def coaxial():
    inner = [ross.ShaftElement(0.15, 0.0, 0.04, material=STEEL) for _ in range(6)]
    outer = [ross.ShaftElement(0.15, 0.08, 0.10, material=STEEL) for _ in range(3)]
    between = simple(5, n_link=9, kxx=1e7, kyy=1e7)
    return rotor(
        bearings=[simple(0), simple(6), simple(7), between],
        shaft_elements=[inner, outer],
        kind=ross.CoAxialRotor,
    )


KINDS = {
    "ShaftElement": rotor,
    "ShaftElement of Euler and Bernoulli": lambda: rotor(
        shaft_elements=shaft(shear_effects=False, gyroscopic=False)
    ),
    "ShaftElement without rotary inertia": lambda: rotor(shaft_elements=shaft(rotary_inertia=False)),
    "ShaftElement under force and torque": lambda: rotor(shaft_elements=shaft(axial_force=3e4, torque=900.0)),
    "ShaftElement with damping": lambda: rotor(shaft_elements=shaft(alpha=7.0, beta=2e-5)),
    "ShaftElement around another": sleeve,
    "CouplingElement": coupled,
    "DiskElement": lambda: rotor(ross.DiskElement.from_geometry(5, STEEL, 0.03, 0.06, 0.3)),
    "GearElement": gear,
    "GearElementTVMS": lambda: gear(ross.GearElementTVMS),
    "PointMass": pedestals,
    "BearingElement": on_table(ross.BearingElement),
    "BearingElement with a mass": lambda: rotor(simple(5, mxx=3.0, myy=4.0, kxy=2e5, kzz=1e6)),
    "BearingElement on a pedestal": pedestals,
    "BallBearingElement": with_bearing(lambda: ross.BallBearingElement(LAST, 8, 0.03, 500.0, 0.3)),
    "RollerBearingElement": with_bearing(lambda: ross.RollerBearingElement(LAST, 8, 0.03, 500.0, 0.3)),
    "CylindricalBearing": with_bearing(cylindrical),
    "SealElement": seal(ross.SealElement),
    "CoAxialRotor": coaxial,
}
if AXIS == "speed":  # ROSS 3
    KINDS["Rotor with damping"] = lambda: rotor(alpha=8.0, beta=1e-5)
    KINDS["Rotor with damping of modes"] = lambda: rotor(
        modal_damping_ratio=[0.01, 0.02, 0.03], default_damping_ratio=0.01
    )
KINDS |= {  # of films and gases: ROSS 3 has some that ROSS 2 has not
    cls.__name__: (seal if issubclass(cls, ross.SealElement) else on_table)(cls)
    for cls in BearingElement.get_subclasses()
    if cls.__name__ not in (*KINDS, "ThrustPad", "MagneticBearingElement", "SqueezeFilmDamper")
}
AT_ONE_SPEED = {
    "MagneticBearingElement": (with_bearing(magnetic), "depends on the whirl frequency"),
    "SqueezeFilmDamper": (lambda: rotor(squeeze_film()), "depends on the whirl frequency"),
    "ThrustPad": (lambda: rotor(thrust_pad()), "kzz depends on the speed"),
    "BearingElement with a mass of the speed": (
        lambda: rotor(table(ross.BearingElement, n=4, mxx=list(np.linspace(1.0, 2.0, 7)))),
        "mxx depends on the speed",
    ),
}

if AXIS == "speed":
    AT_ONE_SPEED["BearingElement of speed and whirl"] = (
        lambda: rotor(
            ross.BearingElement(
                n=4,
                kxx=[[1e6, 2e6], [3e6, 4e6]],
                cxx=[[1e2, 2e2], [3e2, 1e2]],
                speed=[0.0, 500.0],
                frequency=[0.0, 600.0],
            )
        ),
        "depends on the whirl frequency",
    )


@pytest.fixture(autouse=True)
def quiet():
    """ROSS warns of what it extrapolates and of few points."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def test_every_class_of_ross_is_among_the_kinds():
    classes = {cls.__name__ for cls in Element.get_subclasses()}
    assert classes <= {*KINDS, *AT_ONE_SPEED}


@pytest.mark.parametrize("kind", KINDS)
def test_frequencies_and_response_are_those_of_ross(kind):
    of_values, of_response = differences(KINDS[kind](), SPEEDS, [3, 4])
    is_smoothed = kind == "CylindricalBearing" and AXIS == "frequency"  # by ROSS 2: it misses its own values
    assert max(of_values, of_response) < (1e-5 if is_smoothed else 1e-8)


@pytest.mark.parametrize("kind", AT_ONE_SPEED)
def test_what_no_table_holds_is_taken_at_one_speed(kind):
    build, message = AT_ONE_SPEED[kind]
    with pytest.raises(InputError, match=message):
        Rig.from_ross(build())
    of_values, of_response = differences(build(), SPEEDS[1:2], [3, 4], speed=SPEEDS[1])
    assert max(of_values, of_response) < 1e-8


def test_masses_that_ross_leaves_singular_are_taken_over():
    """At a node of the shaft, for which ROSS counts rows that stay empty; without mass along the axis."""
    on_shaft = assemble(Rig.from_ross(rotor(ross.PointMass(n=0, mx=4.0, my=6.0, mz=5.0)))).rotor
    alike = assemble(
        Rig.from_ross(rotor(simple(0, kxx=0.0, kyy=0.0, cxx=0.0, cyy=0.0, mxx=4.0, myy=6.0, mzz=5.0)))
    )
    for name in ("mass", "damping", "gyroscopic", "stiffness"):
        assert np.array_equal(getattr(on_shaft, name), getattr(alike.rotor, name))
    light = pedestals()
    light.point_mass_elements[0].mz = 0.0
    light.M0[-6 + 2, -6 + 2] = 0.0
    degrees = Rig.from_ross(light).rotor.degrees
    assert [name for node, name in degrees if node > LAST + 1] == ["v", "w", "v", "w"]


def test_shafts_of_unlike_speeds_are_refused():
    driving = rotor(
        ross.GearElement(n=2, m=5.0, Id=0.02, Ip=0.04, n_teeth=37, base_diameter=0.19, pr_angle=0.35)
    )
    driven = rotor(
        ross.GearElement(n=2, m=2.0, Id=0.01, Ip=0.02, n_teeth=17, base_diameter=0.09, pr_angle=0.35)
    )
    both = ross.MultiRotor(driving, driven, coupled_nodes=(2, 2), gear_mesh_stiffness=1e8)
    with pytest.raises(InputError, match=r"the shafts of a MultiRotor turn at different speeds.*driving"):
        Rig.from_ross(both)
    assert Rig.from_ross(both.rotors["driving"])


def test_an_inertia_that_is_not_symmetric_is_refused():
    with pytest.raises(InputError, match=r"mass: is not symmetric \(5\.v with 5\.w: 1 and -1\)"):
        Rig.from_ross(rotor(simple(4, mxy=1.0, myx=-1.0)))


def test_every_shaft_and_pedestal_is_held_along_its_axis():
    """And in torsion, both shafts of two: neither has an unconstrained motion left."""
    for build in (pedestals, coaxial):
        model = assemble(Rig.from_ross(build()))
        assert min(mode.frequency for mode in modes(model.rotor, 0.0)) > 1.0


def test_a_rig_file_says_what_ross_does():
    """Tapered sections, a sleeve, a bearing with a mass, pedestals, one under a table: equal eigenvalues."""
    sections = [(0.1, 0.03, 0.04), (0.1, 0.04, 0.04), (0.2, 0.04, 0.04), (0.1, 0.04, 0.025)]
    halves = [(0, 0.03, 0.035), (1, 0.035, 0.04), (2, 0.04, 0.04), (3, 0.04, 0.04), (4, 0.04, 0.04)]
    halves += [(5, 0.04, 0.04), (6, 0.04, 0.0325), (7, 0.0325, 0.025)]
    lengths = [0.05, 0.05, 0.05, 0.05, 0.1, 0.1, 0.05, 0.05]
    inner = [
        ross.ShaftElement(length, 0.01, left, 0.01, right, material=STEEL, n=n)
        for (n, left, right), length in zip(halves, lengths, strict=True)
    ]
    around = [ross.ShaftElement(0.1, 0.04, 0.07, material=STEEL, n=n) for n in (4, 5)]
    stands = [simple(n, kxx=6e6, kyy=9e6, cxx=500.0, cyy=300.0) for n in (9, 10)]
    linked = [simple(0, n_link=9, mxx=0.3, myy=0.4), table(ross.BearingElement, n=8, n_link=10)]
    masses = [ross.PointMass(n=9, m=15.0), ross.PointMass(n=10, m=9.0)]
    theirs = ross.Rotor(
        [*inner, *around], [ross.DiskElement(n=4, m=20.0, Id=0.15, Ip=0.28)], [*linked, *stands], masses
    )
    steel = {"youngs_modulus": STEEL.E, "poissons_ratio": STEEL.Poisson, "density": STEEL.rho}
    stand = {"kyy": 9e6, "kzz": 6e6, "cyy": 300.0, "czz": 500.0}
    turned = {"yy": ("yy", 1), "yz": ("yx", -1), "zy": ("xy", -1), "zz": ("xx", 1)}  # (y, -x) are (v, w)
    given = {
        f"{k}{here}": [sign * value for value in TABLE[f"{k}{there}"]]
        for k in "kc"
        for here, (there, sign) in turned.items()
        if f"{k}{there}" in TABLE
    }
    file = {
        "shaft": [
            {"length": length, "elements": 2, "outer_diameter": left, "outer_diameter_right": right}
            | {"inner_diameter": 0.01}
            | steel
            for length, left, right in sections
        ],
        "sleeve": [{"position": 0.2, "length": 0.2, "outer_diameter": 0.07, "inner_diameter": 0.04} | steel],
        "disc": [{"position": 0.2, "mass": 20.0, "diametral_inertia": 0.15, "polar_inertia": 0.28}],
        "bearing": [
            {"node": 1, "kyy": 3e7, "kzz": 2e7, "cyy": 1e3, "czz": 2e3, "myy": 0.4, "mzz": 0.3}
            | {"pedestal": {"mass": 15.0} | stand},
            {"position": 0.5, "speed": TABLE_SPEED.tolist(), "pedestal": {"mass": 9.0} | stand} | given,
        ],
    }
    ours = assemble(rig_from_dict({"name": "file", "rotor": file})).rotor
    for speed in SPEEDS:
        values = theirs.run_modal(speed, num_modes=2 * theirs.ndof, sparse=False).evalues
        found = [mode.eigenvalue for mode in modes(ours, speed) if mode.kind == "lateral"]
        for value in [value for value in found if value.imag > 0.0][:8]:
            assert np.abs(values - value).min() < 1e-8 * abs(value)
