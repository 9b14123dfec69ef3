"""Keys of shafts and supports in a rig file: how they are read, set, and refused where they contradict."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest

from rubhpc import assemble
from rubhpc.errors import InputError
from rubhpc.input.reading import build
from rubhpc.rig.reading import rig_from_dict, with_keys
from rubhpc.rig.rig import Rig

FILE = """
name = "parts"
[[rotor.shaft]]
length = "0.3 m"
outer_diameter = "20 mm"
outer_diameter_right = "30 mm"
elements = 3
youngs_modulus = "210 GPa"
poissons_ratio = 0.3
density = 7800.0
[[rotor.shaft]]
length = "0.3 m"
outer_diameter = "30 mm"
elements = 3
youngs_modulus = "210 GPa"
poissons_ratio = 0.3
density = 7800.0
[[rotor.sleeve]]
position = "0.3 m"
length = "0.2 m"
outer_diameter = "45 mm"
inner_diameter = "30 mm"
youngs_modulus = "100 GPa"
poissons_ratio = 0.34
density = 8800.0
[[rotor.disc]]
position = "0.2 m"
diameter = "0.12 m"
thickness = "0.03 m"
density = 7800.0
[[rotor.bearing]]
position = 0.0
stiffness = 1e7
mass = "0.2 kg"
[[rotor.bearing]]
position = "0.6 m"
speed = ["0 rpm", "6000 rpm"]
stiffness = [2e7, 1e7]
[rotor.bearing.pedestal]
mass = "3 kg"
stiffness = 5e6
[[rotor.unbalance]]
position = "0.2 m"
mass = "1 g"
radius = "4 cm"
[[rotor.load]]
position = "0.4 m"
vertical = -5.0
"""


def read(*changes):
    text = FILE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return build(Rig, tomllib.loads(text), "a.toml")


def same(one, other):
    bodies = assemble(one), assemble(other)
    return all(
        np.array_equal(getattr(bodies[0].rotor, name), getattr(bodies[1].rotor, name))
        for name in ("mass", "damping", "gyroscopic", "stiffness")
    ) and all(np.array_equal(*(getattr(b, n) for b in bodies)) for n in ("unbalance_cosine", "load"))


def test_parts_are_placed_by_node_or_by_position():
    by_node = [
        ('position = "0.3 m"', "node = 4"),
        ('position = "0.2 m"', "node = 3"),
        ("position = 0.0", "node = 1"),
        ('position = "0.6 m"', "node = 7"),
        ('position = "0.2 m"', "node = 3"),
        ('position = "0.4 m"', "node = 5"),
    ]
    rig = read()
    assert same(rig, read(*by_node))
    assert rig.rotor.rim_radius(3) == 0.06
    assert rig.rotor.recorded_node([]) == 3
    assert rig.rotor.positions == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.6])
    finer = with_keys(rig, {"rotor.shaft.elements": 6})
    assert finer.rotor.node_of(finer.rotor.disc[0]) == 5
    assert finer.rotor.sleeve_nodes(finer.rotor.sleeve[0]) == (7, 11)
    assert rig_from_dict(json.loads(json.dumps(rig.as_dict()))) == rig


@pytest.mark.parametrize(
    ("key", "value", "read_back"),
    [
        ("rotor.disc.position", "0.4 m", lambda r: r.rotor.node_of(r.rotor.disc[0]) == 5),
        ("rotor.disc.1.node", 5, lambda r: r.rotor.disc[0].position is None),
        ("rotor.bearing.1.position", 0.1, lambda r: r.rotor.node_of(r.rotor.bearing[0]) == 2),
        ("rotor.unbalance.position", 0.4, lambda r: r.rotor.node_of(r.rotor.unbalance[0]) == 5),
        ("rotor.bearing.2.pedestal.stiffness", 9e6, lambda r: r.rotor.bearing[1].pedestal.stiffness == 9e6),
        ("rotor.bearing.pedestal.mass", 4.0, lambda r: r.rotor.bearing[1].pedestal.mass == 4.0),
        ("rotor.bearing.2.pedestal.kyy", 9e6, lambda r: r.rotor.bearing[1].pedestal.kzz == 5e6),
        ("rotor.bearing.2.mass", 0.5, lambda r: r.rotor.bearing[1].mass == 0.5),
        ("rotor.bearing.1.mzz", 0.5, lambda r: r.rotor.bearing[0].mass_matrix == ((0.2, 0.0), (0.0, 0.5))),
        (
            "rotor.shaft.1.outer_diameter_right",
            0.025,
            lambda r: r.rotor.shaft[0].diameters[0] == (0.02, 0.025),
        ),
        (
            "rotor.shaft.2.outer_diameter_right",
            0.025,
            lambda r: r.rotor.shaft[1].diameters[0] == (0.03, 0.025),
        ),
        ("rotor.shaft.poissons_ratio", 0.2, lambda r: r.rotor.shaft[0].modulus_in_shear == 2.1e11 / 2.4),
        ("rotor.shaft.shear_modulus", 8e10, lambda r: r.rotor.shaft[0].poissons_ratio is None),
        ("rotor.sleeve.outer_diameter", 0.05, lambda r: r.rotor.sleeve[0].outer_diameter == 0.05),
        ("rotor.sleeve.position", 0.4, lambda r: r.rotor.sleeve_nodes(r.rotor.sleeve[0]) == (5, 7)),
    ],
)
def test_a_study_sets_them(key, value, read_back):
    rig = read()
    if key == "rotor.bearing.pedestal.mass":  # of all bearings: one of them has no pedestal
        with pytest.raises(InputError, match=r"rotor\.bearing\.2\.pedestal\.mass"):
            with_keys(rig, {key: value})
        return
    changed = with_keys(rig, {key: value})
    assert read_back(changed)
    assert not read_back(rig) or key == "rotor.bearing.2.pedestal.kyy"
    assert not same(rig, changed)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'position = "0.2 m"',
            'position = "0.2 m"\nnode = 3',
            r"a\.toml: \[rotor\.disc\.1\] position: conflicts with node; give either node or position",
        ),
        (
            'position = "0.2 m"',
            'position = "0.23 m"',
            r"disc\.1\] position: no node is at 0\.23 m; the nearest is node 3, at 0\.2 m; change position",
        ),
        (
            'position = "0.6 m"',
            'position = "0.7 m"',
            r"bearing\.2\] position: .* nearest is node 7, at 0\.6 m",
        ),
        ('position = "0.2 m"', "", r"disc\.1\] node: missing; give node, or position"),
        (
            'position = "0.2 m"',
            "node = 8",
            r"disc\.1\] node: 8 is not on the shaft; its nodes run from 1 to 7",
        ),
        ('position = "0.4 m"', 'position = "-0.4 m"', r"load\.1\] position: -0\.4 m is out of range"),
        (
            "poissons_ratio = 0.3",
            'poissons_ratio = 0.3\nshear_modulus = "80 GPa"',
            r"shaft\.1\] poissons_ratio: conflicts with shear_modulus, .*; give one of the two",
        ),
        (
            "poissons_ratio = 0.3",
            "",
            r"shaft\.1\] shear_modulus: missing; give shear_modulus or poissons_ratio",
        ),
        ("poissons_ratio = 0.3", "poissons_ratio = 0.5", r"shaft\.1\] poissons_ratio: 0\.5 is out of range"),
        (
            'outer_diameter_right = "30 mm"',
            'outer_diameter_right = "30 mm"\ninner_diameter_right = "31 mm"',
            r"shaft\.1\] inner_diameter_right: 0\.031 m must be below outer_diameter_right, 0\.03 m",
        ),
        (
            'outer_diameter_right = "30 mm"',
            'outer_diameter_right = "8 mm"\ninner_diameter = "10 mm"',
            r"shaft\.1\] inner_diameter: 0\.01 m must be below outer_diameter_right, 0\.008 m",
        ),
        (
            'inner_diameter = "30 mm"',
            'inner_diameter = "29 mm"',
            r"sleeve\.1\] inner_diameter: 0\.029 m is below",
        ),
        ('position = "0.3 m"', 'position = "0.25 m"', r"sleeve\.1\] position: no node is at 0\.25 m"),
        ('length = "0.2 m"', 'length = "0.25 m"', r"sleeve\.1\] length: no node is at 0\.55 m"),
        ('length = "0.2 m"', 'length = "0.1 um"', r"sleeve\.1\] length: 1e-07 m reaches no other node"),
        ('mass = "0.2 kg"', 'mass = "0.2 kg"\nmyy = 0.1', r"bearing\.1\] myy: conflicts with mass"),
        ('mass = "3 kg"', "", r"bearing\.2\.pedestal\] myy: missing or 0; a pedestal has a mass"),
        ('mass = "3 kg"', "mass = 0.0", r"bearing\.2\.pedestal\] mass: missing or 0; a pedestal has a mass"),
        ("stiffness = 5e6", "", r"bearing\.2\.pedestal\] kyy: missing; give either stiffness"),
        (
            "stiffness = 5e6",
            "stifness = 5e6",
            r"bearing\.2\.pedestal\] stifness: unknown key; did you mean stiff",
        ),
        (
            "stiffness = [2e7, 1e7]",
            "stiffness = 1e7\nlink = 3",
            r"bearing\.2\] link: is only for rotors given by",
        ),
    ],
)
def test_contradictions_are_refused_in_one_line(old, new, message):
    with pytest.raises(InputError, match=message) as refused:
        read((old, new))
    assert "\n" not in str(refused.value)


def test_a_rotor_without_bearings_floats_freely():
    table = tomllib.loads(FILE)
    del table["rotor"]["bearing"]
    with pytest.raises(
        InputError, match=r"bearing: missing, so that the rotor floats freely; add at least one"
    ):
        build(Rig, table, "a.toml")


@pytest.mark.parametrize(("key", "value"), [("mass", 1.0), ("pedestal", {"mass": 1.0, "stiffness": 1e6})])
def test_what_matrices_hold_is_refused_beside_them(key, value):
    bearing = {"node": 1, "speed": [0.0, 100.0], "stiffness": [1e6, 2e6], key: value}
    rotor = {"mass": [[1.0]], "stiffness": [[1.0]], "degrees": [[1, "v"]], "bearing": [bearing]}
    with pytest.raises(InputError, match=rf"bearing\.1\] {key}: cannot be given to a rotor of matrices"):
        build(Rig, {"name": "m", "rotor": rotor}, "a.toml")
    rotor["bearing"] = []
    rotor["load"] = [{"position": 0.1, "vertical": 1.0}]
    with pytest.raises(
        InputError, match=r"load\.1\] position: this kind of rotor has no positions; give node"
    ):
        build(Rig, {"name": "m", "rotor": rotor}, "a.toml")
