"""Bearings that let go of the shaft: the rotor falls into the bores that catch it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rubhpc import Bore, InputError, read_rig, run_up, simulate
from rubhpc.rig.reading import rig_from_dict, with_keys

PACKAGED = read_rig("mokhtar2017")
CATCHER = Bore(node=4, radius=0.02, mass=2.0, stiffness=5e6, damping=3000.0)
CLEARANCE = 0.25e-3
CASE = {"speed": "3000 rpm", "clearance": CLEARANCE, "friction": 0.05, "transient": 1}
STIFF = {
    "rotor.shaft.youngs_modulus": "2100 GPa"
}  # so that it falls as one, but for the bending that its bearings have caused


def levitated(until="1 revolution", bores=(4, 12), **keys):
    table = PACKAGED.as_dict()
    table["rotor"]["bearing"] = [bearing | {"until": until} for bearing in table["rotor"]["bearing"]]
    any_bore = {"kind": "bore", "node": 1, "rigid": True, "radius": 1.0}
    rig = rig_from_dict(table | {"stator": [any_bore]})
    rig = replace(rig, stator=tuple(replace(CATCHER, node=node) for node in bores))
    weight = {"rotor.gravity": 9.81, "rotor.clearance_from": "standstill", "rotor.unbalance.mass": 0.0}
    return with_keys(rig, STIFF | weight | keys)


def test_it_is_read_and_goes_through_a_store():
    for until, turns in (("2 revolutions", 2.0), (2, 2.0), ("0.05 s", 3.0)):
        rig = levitated(until)
        assert rig.rotor.let_go_at(100 * math.pi) == turns
        again = rig_from_dict(rig.as_dict())
        assert again == rig
        assert again.rotor.let_go_at(100 * math.pi) == turns
    with pytest.raises(InputError, match=r"until: no bore would catch the rotor; add \[\[stator\]\] kind"):
        replace(rig, stator=PACKAGED.stator)
    with pytest.raises(InputError, match="let go at a constant speed"):
        run_up(rig, start="1000 rpm", stop="2000 rpm", time="1 s", clearance=CLEARANCE)


def test_drop():
    """First touch after the root of 2 c / g, at the root of 2 g c."""
    record = simulate(levitated(), revolutions=4, samples_per_revolution=1024, **CASE)
    n, interval = 1024, 0.02 / 1024
    assert np.ptp(record.vertical[:n]) < 1e-12
    first = np.flatnonzero(record.contact_force.any(axis=0))[0] - n
    assert first * interval == pytest.approx(math.sqrt(2 * CLEARANCE / 9.81), rel=2e-2)
    fallen = record.vertical[n : n + first] - record.vertical[0]
    time = interval * np.arange(first)
    assert fallen == pytest.approx(-0.5 * 9.81 * time**2, rel=0, abs=6e-2 * CLEARANCE)
    speed = (fallen[-1] - fallen[-101]) / (100 * interval) - 9.81 * 50 * interval
    assert speed == pytest.approx(-math.sqrt(2 * 9.81 * CLEARANCE), rel=4e-2)
    assert abs(record.energy_residual) < 1e-4


def test_it_comes_to_rest_at_the_bottom():
    rig = levitated(**{"rotor.damping.alpha": 31.7})
    record = simulate(rig, revolutions=60, **CASE | {"friction": 0.0})
    weight = 9.81 * (0.8 * math.pi * 0.01**2 * 7800 + 2.646)  # N, of shaft and disc
    bottom = record.contact_force_vertical[:, -256:].mean(axis=1)
    assert bottom.sum() == pytest.approx(weight, rel=5e-3)
    assert bottom[0] == pytest.approx(bottom[1], rel=0.05)
    assert abs(record.horizontal[-256:]).max() < 1e-9


def test_a_bearing_that_keeps_hold_holds():
    """One that lets go of two: the shaft swings about the other one, and the bore next to it is met."""
    table = levitated().as_dict()
    del table["rotor"]["bearing"][0]["until"]
    record = simulate(rig_from_dict(table), revolutions=3, **CASE)
    assert record.contact_force[1].any()
    first = [np.flatnonzero(force)[:1] for force in record.contact_force]
    assert not first[0].size or first[1][0] < first[0][0]
