"""The rig: what its parts amount to, what they refuse, and how single keys are set."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from rubhpc.errors import InputError
from rubhpc.rig.parts import Bearing, Damping, Disc, Torsion
from rubhpc.rig.reading import PACKAGED, packaged_rigs, read_rig, rig_from_dict, with_keys


@pytest.fixture(scope="module")
def rig():
    return read_rig("mokhtar2017")


def test_the_packaged_rig_is_the_papers(rig):
    assert packaged_rigs() == ("mokhtar2017",)
    assert rig.rotor.n_node == 15
    assert rig.rotor.disc[0].inertia[0] == pytest.approx(2.646, abs=5e-4)  # kg
    unbalance = rig.rotor.unbalance[0]
    assert unbalance.mass * unbalance.radius == pytest.approx(3.6e-4)  # kg m
    stator = rig.stator[0]
    assert stator.width * stator.height == pytest.approx(25e-6)
    assert stator.youngs_modulus * 25e-6 / stator.length == pytest.approx(1.875e6)  # N/m, axial
    assert stator.euler_load == pytest.approx(241, abs=0.5)
    assert rig.contact_radius(stator) == 0.06


def test_a_study_in_place_of_a_rig_is_named(tmp_path):
    (tmp_path / "a.toml").write_text('rig = "b.toml"\n[grid]\nfriction = 0.1\n')
    with pytest.raises(
        InputError, match=r'is a study, not a rig; give a rig, as this study does: "b[.]toml"'
    ):
        read_rig(tmp_path / "a.toml")


def test_a_carrier_that_is_mistyped_is_named(tmp_path):
    text = '[[carrier]]\nname = "casing"\nmass = 1.0\nstiffness = 1e6\n[[stator]]\ncarrier = "casng"'
    packaged = (PACKAGED / "mokhtar2017.toml").read_text()
    (tmp_path / "a.toml").write_text(packaged.replace("[[stator]]", text))
    with pytest.raises(InputError, match=r"no carrier is named casng; did you mean casing\?"):
        read_rig(tmp_path / "a.toml")


def test_a_beam_that_is_free_to_bends_to_second_order_by_default(rig):
    held = replace(rig, stator=(replace(rig.stator[0], lateral=False),))
    assert [one.stator[0].is_bent for one in (rig, held, rig.with_geometry("linear"))] == [True, False, False]


def test_inertia_of_a_disc_is_the_integral_over_its_points():
    disc = Disc(node=1, diameter=0.3, thickness=0.1, density=7800.0)
    middles = np.linspace(-1, 1, 1001)[:-1] + 1e-3
    y, z = np.meshgrid(0.15 * middles, 0.15 * middles)
    y, z = y[y**2 + z**2 <= 0.15**2], z[y**2 + z**2 <= 0.15**2]
    point, across = 7800.0 * 0.1 * 0.3**2 / 1000**2, np.mean((0.05 * middles) ** 2)
    # the staircase around the rim errs by 1.5e-4 at this resolution
    found = (point * y.size, point * np.sum(across + y**2), point * np.sum(y**2 + z**2))
    assert disc.inertia == pytest.approx(found, rel=2e-4)


def test_bearing_matrices():
    common = Bearing(node=1, stiffness=5.0, damping=7.0)
    assert common.stiffness_matrix == ((5.0, 0.0), (0.0, 5.0))
    assert common.damping_matrix == ((7.0, 0.0), (0.0, 7.0))
    full = Bearing(node=1, kyy=1.0, kyz=2.0, kzy=-3.0, kzz=4.0, cyy=5.0, czy=6.0)
    assert full.stiffness_matrix == ((1.0, 2.0), (-3.0, 4.0))
    assert full.damping_matrix == ((5.0, 0.0), (6.0, 0.0))


@pytest.mark.parametrize(
    ("key", "value", "read"),
    [
        ("stator.youngs_modulus", "30 GPa", lambda r: [s.youngs_modulus == 3e10 for s in r.stator]),
        ("stator.1.angle", "90 deg", lambda r: [r.stator[0].angle == math.pi / 2]),
        ("stator.lateral", False, lambda r: [not s.lateral for s in r.stator]),
        ("rotor.bearing.2.node", 14, lambda r: [b.node for b in r.rotor.bearing] == [1, 14]),
        ("rotor.damping.alpha", 12, lambda r: [r.rotor.damping.alpha == 12]),
        ("rotor.shaft.shear", 0.0, lambda r: [not r.rotor.shaft[0].shear]),
        ("stator.elements", 4.0, lambda r: [r.stator[0].elements == 4]),  # an axis holds floats
    ],
)
def test_a_dotted_key_sets_what_it_names(rig, key, value, read):
    assert np.all(read(with_keys(rig, {key: value})))
    assert not np.all(read(rig))


def test_a_number_names_one_of_many(rig):
    twice = rig_from_dict({**rig.as_dict(), "stator": rig.as_dict()["stator"] * 2})
    changed = with_keys(twice, {"stator.2.angle": 1.0, "stator.length": 0.05})
    assert [(s.angle, s.length) for s in changed.stator] == [(0.0, 0.05), (1.0, 0.05)]
    one_apart = with_keys(twice, {"stator.1.angle": 1.0, "stator.angle": 0.5})  # in any order
    assert [s.angle for s in one_apart.stator] == [1.0, 0.5]


@pytest.mark.parametrize(
    ("key", "fix"),
    [
        ("stator.youngs_modulis", "stator.youngs_modulus?"),
        ("stator.2.angle", "stator.1.angle?"),
        ("stator.0.angle", "stator.1.angle?"),
        ("youngs_modulus", "youngs_modulus?"),
        ("stator", "is a table"),
        ("rotor.damping", "rotor.damping.alpha?"),
        ("name", "unknown key"),
        ("", "unknown key"),
        ("..", "unknown key"),
        ("__class__.__init__", "unknown key"),
        ("stator.__class__", "unknown key"),
    ],
)
def test_an_unknown_key_is_refused_with_the_nearest(rig, key, fix):
    with pytest.raises(InputError) as refused:
        with_keys(rig, {key: 1.0})
    assert fix in str(refused.value)


def test_setting_one_direction_of_a_bearing_leaves_the_other(rig):
    bearing = with_keys(rig, {"rotor.bearing.1.kyy": 3e6}).rotor.bearing
    assert bearing[0].stiffness_matrix == ((3e6, 0.0), (0.0, 1e6))
    assert bearing[1].stiffness_matrix == ((1e6, 0.0), (0.0, 1e6))
    back = with_keys(with_keys(rig, {"rotor.bearing.kyz": 5.0}), {"rotor.bearing.stiffness": 2e6})
    assert back.rotor.bearing[0].stiffness_matrix == ((2e6, 0.0), (0.0, 2e6))


def test_setting_the_mass_of_a_disc_keeps_its_inertias_and_rim(rig):
    before, after = rig.rotor.disc[0], with_keys(rig, {"rotor.disc.mass": "5 kg"}).rotor.disc[0]
    assert after.inertia == (5.0, *before.inertia[1:])
    assert after.diameter == before.diameter


def test_ways_of_holding_torsion_replace_each_other(rig):
    spring = with_keys(rig, {"rotor.torsion.stiffness": 100.0})
    assert spring.rotor.torsion == Torsion(stiffness=100.0, node=1)
    assert with_keys(spring, {"rotor.torsion.fixed_node": 2}).rotor.torsion == Torsion(fixed_node=2)
    assert with_keys(spring, {"rotor.torsion.free": True}).rotor.torsion == Torsion(free=True)


def test_damping_stated_in_ratios_is_not_stated_twice(rig):
    table = rig.as_dict()
    table["rotor"]["damping"] = {"ratios": {"31.56": 0.08}}
    with pytest.raises(InputError, match=r"rotor\.damping\.ratios: conflicts with alpha and beta"):
        with_keys(rig_from_dict(table), {"rotor.damping.alpha": 3.0})


def test_keys_set_together_need_only_make_sense_together(rig):
    wide = {"rotor.shaft.inner_diameter": "25 mm", "rotor.shaft.outer_diameter": "30 mm"}
    assert with_keys(rig, wide).rotor.shaft[0].outer_diameter == 0.03
    with pytest.raises(InputError, match=r"rotor\.shaft\.1\.inner_diameter: 0\.025 m must be below"):
        with_keys(rig, {"rotor.shaft.inner_diameter": "25 mm"})


def test_a_rig_survives_json(rig):
    changed = with_keys(rig, {"rotor.bearing.kyz": 1 / 3, "stator.1.angle": 0.1, "rotor.torsion.free": True})
    table = changed.as_dict()
    table["stator"][0]["damping"] = {"ratios": {repr(1 / 3): 0.1, "803": 0.05}}
    again = rig_from_dict(json.loads(json.dumps(table)))
    assert again.stator[0].damping == Damping(ratios=((1 / 3, 0.1), (803.0, 0.05)))
    assert again.rotor == changed.rotor
    assert rig_from_dict(json.loads(json.dumps(again.as_dict()))) == again
