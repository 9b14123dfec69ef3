"""Monitors of the model's range: their values from the recorded signals, and the limits that they have."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate

from rubhpc.rig.parts import Bearing
from rubhpc.rig.reading import with_keys
from rubhpc.validity import MONITORS, counted, words

CASE = {"speed_ratio": 1.7, "clearance_ratio": 0.8, "transient": 20, "revolutions": 4, "keep": ("waveform",)}
SAGGING = {"rotor.gravity": "40 m/s^2", "stator.angle": "90 deg", "stator.youngs_modulus": "30 GPa"}


def turned(record, stator, clearance, vertical, horizontal, i=0):
    """Largest angle from a stator's axis to the line from the disc's centre to the tip, at the contacts."""
    axis = np.array([np.cos(stator.angle), np.sin(stator.angle)])[:, None]
    along = np.array([-np.sin(stator.angle), np.cos(stator.angle)])[:, None]
    tip = (0.06 + clearance + record.stator_axial[i]) * axis + record.stator_lateral[i] * along
    line = tip - np.array([vertical, horizontal])
    angle = np.arctan2(np.abs((line * along).sum(axis=0)), (line * axis).sum(axis=0))
    return angle[record.contact_force[i] > 0.0].max()


def test_the_normal_angle_is_that_of_the_line_of_centres():
    rig = with_keys(read_rig("mokhtar2017"), SAGGING)
    record = simulate(rig, **CASE)
    expected = turned(record, rig.stator[0], record.clearance, record.vertical, record.horizontal)
    assert record.normal_angle == pytest.approx([expected], rel=1e-3)
    assert expected > MONITORS["normal_angle"].limit
    assert simulate(rig, normal="updated", **CASE).normal_angle == [0.0]


@pytest.mark.parametrize("method", ["modal", "central-difference"])
def test_the_normal_angle_of_a_stator_away_from_the_recorded_node(method):
    rig = with_keys(read_rig("mokhtar2017"), SAGGING)
    other = replace(rig.stator[0], node=7, angle=2.4, radius=0.06)
    rig = replace(rig, stator=(rig.stator[0], other))
    probes = [{"name": "v", "node": 7}, {"name": "w", "node": 7, "angle": "90 deg"}]
    case = CASE | {"method": method, "probes": probes, "transient": 2, "revolutions": 2}
    case |= {"step": "0.5 us"} if method == "central-difference" else {}
    record = simulate(rig, **case)
    expected = turned(
        record, other, record.clearance, record.signals["probe_v"], record.signals["probe_w"], 1
    )
    assert record.normal_angle[1] == pytest.approx(expected, rel=1e-3)


def test_the_displacement_in_a_bearing_is_compared_with_its_clearance():
    rig = with_keys(read_rig("mokhtar2017"), {"rotor.gravity": "9.81 m/s^2"})
    soft = Bearing(node=4, stiffness=1e5, clearance=50e-6)
    probes = [{"name": "v", "node": 4}, {"name": "w", "node": 4, "angle": "90 deg"}]
    with_clearance, without = (
        simulate(
            replace(rig, rotor=replace(rig.rotor, bearing=(*rig.rotor.bearing, bearing))),
            probes=probes,
            **CASE,
        )
        for bearing in (soft, replace(soft, clearance=None))
    )
    size = np.hypot(with_clearance.signals["probe_v"], with_clearance.signals["probe_w"]).max()
    assert with_clearance.bearing_clearance_ratio == pytest.approx(size / 50e-6, rel=1e-12)
    assert without.bearing_clearance_ratio == 0.0
    for name, values in without.signals.items():
        assert np.array_equal(with_clearance.signals[name], values)


def test_the_force_is_compared_with_the_strength():
    weak = simulate("mokhtar2017", overrides={"stator.strength": "20 N"}, **CASE)
    assert weak.force_over_strength == pytest.approx(weak.peak_contact_force / 20.0)
    assert simulate("mokhtar2017", **CASE).force_over_strength == [0.0]


def test_each_monitor_has_one_name():
    names = [monitor.name for monitor in MONITORS.values()]
    assert len(set(names)) == len(names)
    assert words(0) == ""
    assert words(0b1100) == "foreshortening, tip deflection"
    assert counted(np.array([0, 1, 5, 4])) == "slip (2), foreshortening (2)"
