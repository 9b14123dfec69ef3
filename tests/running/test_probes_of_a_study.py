"""A study with probes: read, run, resumed, opened and drawn; one without them is what it was."""

import math

import numpy as np
import pytest

import rubhpc
from postproc.figures.orbit import orbit
from postproc.report.page import Page
from postproc.signals.places import moved_at, named_places
from postproc.signals.spectra import spectrum_data
from postproc.signals.waveforms import orbit_data, waveform_data
from postproc.store.attributes import table_of
from rubhpc.errors import InputError
from rubhpc.running.driver import run
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study

STUDY = """
rig = "mokhtar2017"
[grid]
speed_ratio = [0.6, 1.7]
clearance = "100 um"
friction = 0.3
[contact]
model = "mokhtar2017"
[record]
transient = 4
revolutions = 4
samples_per_revolution = 32
"""
PROBES = """
[[record.probe]]
name = "left"
node = 8
angle = "-45 deg"
[[record.probe]]
name = "aside"
node = 8
angle = "60 deg"
[[record.probe]]
name = "load"
node = 1
quantity = "bearing_force"
[[record.probe]]
name = "other"
node = 3
"""


def study(folder, text):
    (folder / "s.toml").write_text(STUDY + text)
    return read_study(folder / "s.toml", folder / "s.zarr")


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    folder = tmp_path_factory.mktemp("probes")
    assert run(study(folder, PROBES)).computed == 2
    assert run(study(folder, PROBES)).computed == 0
    return rubhpc.open(folder / "s.zarr")


def test_probes_are_stored_with_their_units(cases):
    assert cases["probe_load"].attrs["units"] == "N"
    assert cases["probe_left"].dims == ("speed_ratio", "clearance", "friction", "sample")
    assert cases["spectrum_probe_load"].dims[-1] == "order"
    extent = np.ptp(cases["probe_load"].values, axis=-1)
    assert cases["peak_to_peak_probe_load"].values == pytest.approx(extent, rel=1e-6)


def test_two_probes_give_the_orbit_whatever_their_angles(cases):
    one = cases.isel(speed_ratio=1)
    shown, disc = orbit_data(moved_at(one, ("left", "aside"))), orbit_data(one)
    for name in ("vertical", "horizontal"):
        assert shown[name].values == pytest.approx(disc[name].values, abs=1e-10)
    axes = orbit(one, probes=("left", "aside")).show(None)
    assert axes.get_xlabel().startswith("Horizontal displacement (")
    assert "motion at node 8" in axes.figure.get_suptitle()


def test_captions_name_the_places_of_signals(cases):
    named = named_places(cases)
    assert named["torsion"].attrs["place"] == "motion at node 8"
    assert named["spectrum_probe_left"].attrs["place"] == "left: node 8 at -45\N{DEGREE SIGN}"
    strange = cases.assign_attrs(rig={"rotor": "of another version"})
    assert named_places(strange) is strange
    with pytest.raises(InputError, match='run the study with "waveform"'):
        moved_at(cases.drop_vars("probe_left"), ("left", "aside"))


def test_a_place_is_chosen_by_its_node_or_stator(cases):
    one = cases.isel(speed_ratio=1)
    assert moved_at(one, node=8) is one
    assert moved_at(one, stator=1) is one
    with pytest.raises(InputError, match="not recorded; choose one of 8, or record two displacement probes"):
        moved_at(one, node=3)  # which one probe looks at
    with pytest.raises(InputError, match="there is no 2; give 1"):
        moved_at(one, stator=2)
    with pytest.raises(InputError, match="give one of them"):
        moved_at(one, node=8, stator=1)
    rig = table_of(one, "rig")
    waves = one.assign_attrs(rig=rig | {"stator": [rig["stator"][0] | {"node": 4, "radius": 0.06}]})
    shown = moved_at(waves, node=8)  # no longer the recorded one, seen by left and aside
    assert shown["vertical"].attrs["place"] == "motion at node 8"
    assert shown["vertical"].values == pytest.approx(one["vertical"].values, abs=1e-10)


@pytest.mark.parametrize(
    ("pair", "says"),
    [
        (("left", "load"), "measures bearing force, which has no orbit"),
        (("left", "other"), "differ in their node"),
        (("left", "left"), "look in one direction"),
        (("left", "right"), "no probe right; choose one of left, aside, load, other"),
    ],
)
def test_what_makes_no_orbit_is_refused(cases, pair, says):
    with pytest.raises(InputError, match=says):
        moved_at(cases.isel(speed_ratio=1), pair)


def test_a_probe_is_a_signal_of_figures_and_of_the_report(cases):
    one = cases.isel(speed_ratio=1)
    assert waveform_data(one, ["probe_load"])["probe_load"].sizes["sample"] == 4 * 32
    assert spectrum_data(one, "probe_load").sizes["order"] == 4 * 32 // 2 + 1
    page = Page(cases)
    assert page.measures.described_signals(cases)["probe_load"]["unit"] == "N"
    assert "peak_to_peak_probe_left" in page.measures.names


def test_without_probes_the_identity_of_a_study_is_what_it_was(tmp_path):
    parts = CaseGrid(study(tmp_path, "")).identity_parts
    assert "probe" not in parts["record"]
    with_them = CaseGrid(study(tmp_path, PROBES)).identity_parts
    assert with_them["record"]["probe"][0] == {
        "name": "left",
        "node": 8,
        "angle": pytest.approx(-math.pi / 4),
        "quantity": "displacement",
    }


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ('name = "a"\nnode = 40', r"probe a: node: 40 is not on the shaft"),
        ('name = "a"\nnode = 2\nangel = 3', r"\[record.probe.1\] angel: unknown key; did you mean angle\?"),
        (
            'name = "a"\nnode = 2\n[[record.probe]]\nname = "a"\nnode = 3',
            r"probe.2\] name: .a. is another probe",
        ),
    ],
)
def test_what_cannot_be_measured_is_refused_before_the_run(tmp_path, keys, says):
    with pytest.raises(InputError, match=says):
        study(tmp_path, f"[[record.probe]]\n{keys}")
