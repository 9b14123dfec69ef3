"""Bearings and seals with coefficients over the speed: reading, interpolation, refusals, identity."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from rubhpc import InputError, read_rig
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Bearing
from rubhpc.rig.reading import rig_from_dict, with_keys
from rubhpc.study.cases import identity_parts
from rubhpc.study.study import read_study

SPEEDS = [50.0, 100.0, 300.0, 400.0]
KYY = [4e6, 1e6, 2e6, 2.5e6]
TEXT = """
name = "turbine"
[[rotor.shaft]]
length = 0.6
outer_diameter = 0.03
elements = 4
youngs_modulus = 2.1e11
shear_modulus = 8e10
density = 7800.0
[[rotor.disc]]
node = 3
mass = 4.0
diametral_inertia = 0.01
polar_inertia = 0.02
diameter = 0.2
[[rotor.bearing]]
node = 1
speed = ["500 rpm", "1000 rpm", "4000 rpm"]
kyy = [4e6, 1e6, "2 MN/m"]
kzz = 3e6
kyz = [1e5, 2e5, 3e5]
kzy = [-1e5, -2e5, -3e5]
cyy = [100.0, 200.0, 300.0]
czz = [100.0, 200.0, 300.0]
[[rotor.bearing]]
node = 5
stiffness = 2e6
damping = 50.0
[[rotor.unbalance]]
node = 3
mass = 0.01
radius = 0.05
[[stator]]
node = 3
rigid = true
"""


@pytest.fixture
def rig_file(tmp_path):
    path = tmp_path / "turbine.toml"
    path.write_text(TEXT)
    return path


def table(**changed):
    given = {"node": 1, "speed": SPEEDS, "kyy": KYY, "kzz": 3e6, "kyz": [1e5, 2e5, 3e5, 4e5], "cyy": 50.0}
    return BearingTable(**(given | changed))


def test_tables_are_read_with_units(rig_file):
    bearing = read_rig(rig_file).rotor.bearing
    assert isinstance(bearing[0], BearingTable)
    assert bearing[0].speed == pytest.approx([500 * math.pi / 30, 1000 * math.pi / 30, 4000 * math.pi / 30])
    assert bearing[0].kyy == (4e6, 1e6, 2e6)
    assert bearing[0].kzz == (3e6,)
    assert bearing[1] == Bearing(node=5, stiffness=2e6, damping=50.0)


def test_tables_go_through_a_store(rig_file):
    rig = read_rig(rig_file)
    assert rig_from_dict(json.loads(json.dumps(rig.as_dict()))) == rig


def test_table_is_exact_at_its_speeds():
    for i, speed in enumerate(SPEEDS):
        stiffness, damping = table().at(speed)
        assert stiffness == pytest.approx(np.array([[KYY[i], 1e5 * (i + 1)], [0.0, 3e6]]), rel=1e-14)
        assert damping == pytest.approx(np.array([[50.0, 0.0], [0.0, 0.0]]))


def test_interpolation_is_monotone_between_speeds():
    """The stiffness falls, then rises, and never leaves the values on either side."""
    fine = np.linspace(50.0, 400.0, 701)
    found = np.array([table().at(speed)[0][0, 0] for speed in fine])
    assert found == pytest.approx(PchipInterpolator(SPEEDS, KYY)(fine))
    assert found.min() == pytest.approx(1e6)
    falls = np.diff(found) < 0.0
    assert falls[fine[1:] <= 100.0].all()
    assert not falls[fine[:-1] >= 100.0].any()
    straight = table(interpolation="linear").at(200.0)[0]
    assert straight == pytest.approx(np.array([[1.5e6, 2.5e5], [0.0, 3e6]]))


@pytest.mark.parametrize("spin", [49.9, 400.1, -100.0])
def test_nothing_is_extrapolated(spin):
    with pytest.raises(
        InputError, match=r"rotor.bearing.2: .* rpm is outside its table, 477.465 to 3819.72 rpm"
    ):
        table().at(spin, "rotor.bearing.2")


def test_standstill_has_the_coefficients_of_the_lowest_speed():
    assert table().at(0.0)[0][0, 0] == 4e6
    assert table(speed=[0.0, 1.0, 2.0, 3.0]).at(0.0)[0][0, 0] == 4e6
    assert table().at(400.0 * (1 + 1e-15))[0][0, 0] == 2.5e6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": [1.0]}, "speed: a table has at least two speeds"),
        ({"speed": [1.0, 3.0, 2.0, 4.0]}, "speed: the speeds do not rise"),
        ({"speed": [-1.0, 0.0, 2.0, 4.0]}, "speed: value 1: -1 rad/s is out of range"),
        ({"kyy": [1e6, 2e6]}, "kyy: 2 values for 4 speeds; give one for each speed"),
        ({"kyy": [1e6, 2e6, math.inf, 1e6]}, "kyy: value 3: inf is not finite"),
        ({"kzz": None}, "kzz: missing; a table has either stiffness, or kyy and kzz"),
        ({"stiffness": 1e6}, "kyy: conflicts with stiffness"),
        ({"damping": 1e6}, "cyy: conflicts with damping"),
        ({"interpolation": "spline"}, 'interpolation: "spline" is not available'),
    ],
)
def test_what_is_no_table_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        table(**change)


def test_errors_name_the_file_and_table(rig_file):
    rig_file.write_text(TEXT.replace("kyz = [1e5, 2e5, 3e5]", "kyz = [1e5, 2e5]"))
    with pytest.raises(InputError, match=r"turbine.toml: \[rotor.bearing.1\] kyz: 2 values for 3 speeds"):
        read_rig(rig_file)
    rig_file.write_text(TEXT.replace('"4000 rpm"', '"4000 kg"'))
    with pytest.raises(InputError, match=r"turbine.toml: \[rotor.bearing.1\] speed: value 3"):
        read_rig(rig_file)


def test_a_study_sets_the_constant_bearing_and_the_identity_covers_the_table(rig_file):
    rig = with_keys(read_rig(rig_file), {"rotor.bearing.2.stiffness": 5e6})
    assert rig.rotor.bearing[1].stiffness == 5e6
    study = rig_file.parent / "study.toml"
    grid = "[grid]\nspeed = 200.0\nclearance = 1e-4\nfriction = 0.1\n"
    study.write_text(f'rig = "turbine.toml"\noutput = "out.zarr"\n{grid}')
    one = identity_parts(read_study(study))
    rig_file.write_text(TEXT.replace("cyy = [100.0", "cyy = [101.0"))
    assert identity_parts(read_study(study)) != one


def test_rigs_without_tables_are_described_as_before():
    rig = read_rig("mokhtar2017")
    assert set(rig.as_dict()["rotor"]["bearing"][0]) == {"node", "stiffness", "kyz", "kzy", "cyz", "czy"}
    assert replace(rig) == rig
