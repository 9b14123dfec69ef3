"""Bearings that let go of the shaft: the rotor falls into the bores that catch it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rubhpc import Bore, InputError, assemble, read_rig, run_up, simulate
from rubhpc.fem.response import contact_free_amplitude
from rubhpc.integrate.modal_setup import Release
from rubhpc.rig.reading import rig_from_dict, with_keys

PACKAGED = read_rig("mokhtar2017")
CATCHER = Bore(node=4, radius=0.02, mass=2.0, stiffness=5e6, damping=3000.0)
CLEARANCE = 0.25e-3
CASE = {"speed": "3000 rpm", "clearance": CLEARANCE, "friction": 0.05, "transient": 1}
SPRINGS = {"friction": 0.1, "law": "penalty", "stiffness": "1e7 N/m", "damping": "3000 N*s/m"}
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
        again = rig_from_dict(rig.as_dict())
        assert again == rig
        for one in (rig, again):
            assert Release(one.rotor.until, None).turn(0.02 * np.arange(6)) == turns
    with pytest.raises(InputError, match=r"until: no bore would catch the rotor; add \[\[stator\]\] kind"):
        replace(rig, stator=PACKAGED.stator)
    table = rig.as_dict()
    table["rotor"]["bearing"][0]["until"] = 2
    with pytest.raises(InputError, match=r"bearing.2\] until: is a time, that of bearing 1 is not"):
        rig_from_dict(table)


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


def test_drop_while_running_down():
    """The parabola of a free fall, whatever the speed does, and nothing jumps as the bearings let go."""
    law = {"start": "3000 rpm", "stop": "2700 rpm", "time": "0.08 s"}
    record = run_up(levitated(), **law, clearance=CLEARANCE, friction=0.05, samples_per_revolution=512)
    n, rate = 512, 300 * math.pi / 30 / 0.08
    turned = 2 * math.pi * record.turned.values
    time = (100 * math.pi - np.sqrt((100 * math.pi) ** 2 - 2 * rate * turned)) / rate
    vertical, time = record.vertical.values, time - time[n]
    first = np.flatnonzero(record.contact_force.values.any(axis=0))[0]
    assert time[first] == pytest.approx(math.sqrt(2 * CLEARANCE / 9.81), rel=2e-2)
    fallen = vertical[n:first] - vertical[0]
    assert fallen == pytest.approx(-0.5 * 9.81 * time[n:first] ** 2, rel=0, abs=6e-2 * CLEARANCE)
    assert np.ptp(vertical[: n + 1]) < 1e-12
    assert np.abs(np.diff(vertical[n : n + 4], 2)).max() < 1e-3 * np.abs(fallen).max()


@pytest.mark.parametrize("until", ["1 revolution", "0.03 s", 0])
def test_a_speed_that_hardly_changes_is_a_constant_one(until):
    rig = levitated(until, **{"rotor.unbalance.mass": 2e-3})
    case = {"clearance": CLEARANCE, "samples_per_revolution": 64, **SPRINGS}
    still = {"transient": 0, "revolutions": 3, "initial": {"from": "contact_free"}}
    constant = simulate(rig, speed="3000 rpm", **still, **case)
    drive = {"torque": 0.0, "start": "3000 rpm", "revolutions": 3, "inertia": "1000 kg m^2"}
    slow = run_up(rig, start="3000 rpm", stop="2999.9999 rpm", time="0.06001 s", **case)
    driven = run_up(rig, drive=drive, **case)
    for record in (slow, driven):
        assert record.vertical.values == pytest.approx(constant.vertical, abs=1e-7 * CLEARANCE)
        assert record.torsion.values == pytest.approx(constant.torsion, abs=1e-4 * np.ptp(constant.torsion))
        assert record.peak_contact_force.values.max(axis=0) == pytest.approx(constant.peak_contact_force)
    assert abs(driven.energy_residual) < 1e-7


def test_what_the_motion_gains_comes_from_the_spin():
    """The fall brakes a rotor that coasts; energies balance through the release."""
    drive = {"torque": 0.0, "start": "3000 rpm", "revolutions": 5, "inertia": "0.001 kg m^2"}
    record = run_up(
        levitated("0.03 s"), drive=drive, clearance=CLEARANCE, samples_per_revolution=64, **SPRINGS
    )
    assert not record.contact_fraction[:2].values.any()
    assert record.contact_fraction[2:].values.all()
    assert record.speed[4] < 0.999 * record.speed[0]
    assert abs(record.energy_residual) < 1e-6


def test_a_seal_with_a_table_may_stay():
    """It does not hold the shaft alone: the bores do."""
    table = levitated(1).as_dict()
    seal = {"node": 8, "speed": [100.0, 400.0], "kyy": [0.0, 1e3], "kzz": [0.0, 1e3], "cyy": [50.0, 60.0]}
    table["rotor"]["bearing"].append(seal | {"czz": [50.0, 60.0]})
    case = {"clearance": CLEARANCE, "samples_per_revolution": 64, **SPRINGS}
    start = {"transient": 0, "revolutions": 3, "initial": {"from": "contact_free"}}
    constant = simulate(rig_from_dict(table), speed="3000 rpm", **start, **case)
    assert constant.contact_fraction.all()
    law = {"start": "3000 rpm", "stop": "2999.9999 rpm", "time": "0.06001 s"}
    slow = run_up(rig_from_dict(table), **law, **case)
    assert slow.vertical.values == pytest.approx(constant.vertical, abs=1e-3 * CLEARANCE)


def test_a_bore_alone_holds_an_end_without_weight():
    """A journal that stays on the wall of a small bore moves the shaft as a stiff bearing there does."""
    hinge, loose = PACKAGED.rotor.bearing
    rotor = replace(PACKAGED.rotor, bearing=(hinge, replace(loose, stiffness=0.0)))
    rig = replace(PACKAGED, rotor=rotor, stator=(Bore(node=15, rigid=True, radius=0.01),))
    probe = {"name": "disc", "node": 8, "angle": 0.0}
    case = {"speed": 150.0, "friction": 0.0, "transient": 20, "revolutions": 2}
    record = simulate(rig, clearance="20 nm", probes=[probe], **case)
    assert record.contact_force[0].min() > 0.0
    held = assemble(rig).rotor
    stiffness = held.stiffness.copy()
    for name in ("v", "w"):
        stiffness[held.index(15, name), held.index(15, name)] += 1e12
    stiff = replace(assemble(PACKAGED), rotor=replace(held, stiffness=stiffness))
    known = contact_free_amplitude(stiff, 150.0)
    assert record.to_dataset()["probe_disc"].values.max() == pytest.approx(known, rel=1e-3)


def test_the_motion_before_a_release_is_not_that_of_the_record():
    """The shaft hangs in its bearings, on a periodic motion that is solved for, and falls."""
    case = {"revolutions": 4, "samples_per_revolution": 64} | CASE
    for _ in range(2):  # the second one would share the record of the first
        direct = simulate(levitated(), **case | {"transient": "direct"})
        plain = simulate(levitated(), **case)
        assert (direct.regime, direct.settled) == (plain.regime, plain.settled)
        assert direct.peak_contact_force == pytest.approx(plain.peak_contact_force, rel=1e-6)
