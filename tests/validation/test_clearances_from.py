"""Stators set about the lying shaft, and stators that press it at rest."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, run_up, simulate

from rubhpc import InputError, LumpedStator, Rig, assemble
from rubhpc.fem.assemble import model_at
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.reading import rig_from_dict, with_keys
from rubhpc.study.axis_reading import make_axis

RPM = math.pi / 30
SHAFT, BEAM = 143343.35, 3e9 * 25e-6 / 0.04  # N/m, of the disc and of a stator of the packaged rig
LIGHT = read_rig("mokhtar2017")
CASE = {"speed_ratio": 0.75, "clearance": "100 um", "friction": 0.1, "transient": 0, "revolutions": 4}
SHORT = {"method": "central-difference", "step": "1 us"}


def around(rig, *angles):
    return replace(rig, stator=tuple(replace(rig.stator[0], angle=angle) for angle in angles))


RING = around(with_keys(LIGHT, {"rotor.gravity": 9.81}), *(0.3 + np.arange(4) * math.pi / 2))
ALIGNED = with_keys(RING, {"rotor.clearance_from": "standstill"})
DOWN = assemble(RING).sag[assemble(RING).rotor.index(8, "v")]
BY_HAND = replace(
    RING, stator=tuple(replace(s, clearance_offset=math.cos(s.angle) * DOWN) for s in RING.stator)
)


@pytest.mark.parametrize("scheme", [{}, {"friction_law": "coulomb"}, SHORT])
def test_stators_about_the_lying_shaft_are_those_moved_by_hand(scheme):
    found, known = (simulate(rig, **CASE, **scheme) for rig in (ALIGNED, BY_HAND))
    assert (found.peak_contact_force > 0.0).all()
    assert found.contact_force == pytest.approx(known.contact_force, rel=1e-9)
    assert found.vertical == pytest.approx(known.vertical, rel=1e-12)


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_about_the_lying_shaft_gravity_is_not_felt(normal):
    """Bodies are linear: what moves about the sag in clearances about the sag is the unloaded machine."""
    found = simulate(ALIGNED, **CASE, normal=normal)
    known = simulate(ALIGNED, **CASE, normal=normal, overrides={"rotor.gravity": 0.0})
    assert (known.peak_contact_force > 0.0).all()
    assert found.vertical - DOWN == pytest.approx(known.vertical, abs=1e-12)
    assert found.contact_force == pytest.approx(known.contact_force, rel=1e-6)


def test_an_offset_adds_to_the_lying_shaft_and_a_run_up_keeps_it():
    passage = {"start": "900 rpm", "stop": "1500 rpm", "time": "0.3 s", "clearance": "80 um"}
    far = {"stator.1.clearance_offset": "30 um"}
    found = run_up(ALIGNED, **passage, overrides=far)
    known = {"stator.1.clearance_offset": BY_HAND.stator[0].clearance_offset + 30e-6}
    other = run_up(BY_HAND, **passage, overrides=known)
    assert float(found.contact_force.max()) > 1.0
    assert np.allclose(found.vertical, other.vertical, rtol=1e-9, atol=0.0)


def in_films(**keys):
    """Journals that rise by 50 um from 500 to 3000 rpm; stators set about the shaft at standstill."""
    rise = {"speed": [500 * RPM, 3000 * RPM], "eccentricity_y": [-60e-6, -10e-6], "eccentricity_z": 2e-5}
    table = {"stiffness": 1e6, "damping": 500.0} | rise
    bearings = tuple(BearingTable(node=node, **table) for node in (1, 15))
    rig = replace(ALIGNED, rotor=replace(ALIGNED.rotor, bearing=bearings, unbalance=()))
    return with_keys(around(rig, 0.0, math.pi / 2, math.pi, -math.pi / 2), keys)


def test_a_rising_shaft_meets_the_upper_stator_where_the_table_says():
    """The shaft rises by 30 um at 2000 rpm, as its journals do, and by 34 um at 2200 rpm."""
    model = assemble(in_films())
    assert [stator.centre for stator in model.stators] == [model.rotor.at_node(8, model.sag)] * 4
    case = {"clearance": "30 um", "transient": 0, "revolutions": 2}
    assert not simulate(in_films(), speed="1999 rpm", **case).contact_force.any()
    pressed = simulate(in_films(), speed="2200 rpm", **case)
    row = model.rotor.index(8, "v")
    force = 4e-6 / (np.linalg.inv(model.rotor.stiffness)[row, row] + 1 / BEAM)
    assert pressed.contact_force[:, -1] == pytest.approx([force, 0, 0, 0], rel=1e-3)
    passage = run_up(in_films(), start="1500 rpm", stop="2500 rpm", time="2 s", clearance="30 um")
    touched = passage.contact_force.values.reshape(4, -1, 256).any(axis=2)
    assert not touched[1:].any()
    assert float(passage.speed[touched[0].argmax()]) / RPM == pytest.approx(2000, abs=15)
    before = passage.vertical.values[: 256 * touched[0].argmax()]
    assert np.abs(np.diff(before)).max() < 5e-9  # it creeps


def test_a_driven_rotor_rises_too():
    rig, drive = in_films(), {"start": "1500 rpm", "torque": 2.0, "inertia": 0.01, "revolutions": 12}
    passage = run_up(rig, clearance="25 um", drive=drive)
    model, speeds = assemble(rig), passage.speed.values
    n_free = int(passage.contact_fraction.any("stator").values.argmax())
    assert speeds[n_free] / RPM == pytest.approx(1750, abs=40)
    known = [model.rotor.at_node(8, model_at(model, speed).sag)[0] for speed in speeds[:n_free]]
    mean = passage.vertical.values.reshape(len(speeds), -1).mean(axis=1)[:n_free]
    assert mean == pytest.approx(known, abs=0.05 * np.ptp(known))


def test_a_speed_of_alignment_is_that_of_the_tables():
    model = assemble(in_films(**{"rotor.clearance_from": "2000 rpm"}))
    there = model_at(model, 2000 * RPM)
    assert [stator.centre for stator in there.stators] == [there.rotor.at_node(8, there.sag)] * 4
    with pytest.raises(InputError, match=r"\[rotor\] clearance_from: rotor\.bearing\.1: 4000 rpm is outside"):
        assemble(in_films(**{"rotor.clearance_from": "4000 rpm"}))


def test_where_stators_are_set_is_written_and_read():
    assert "clearance_from" not in RING.as_dict()["rotor"]  # as in older stores
    for rig in (ALIGNED, in_films(**{"rotor.clearance_from": "2000 rpm"})):
        assert rig_from_dict(rig.as_dict()).rotor.clearance_from == rig.rotor.clearance_from
    with pytest.raises(InputError, match=r'"running" is not a number .*, or "unloaded", "standstill"'):
        with_keys(RING, {"rotor.clearance_from": "running"})
    assert make_axis("rotor.clearance_from", ["0 rpm", "60 rpm"], RING).values == (0.0, 2 * math.pi)
    with pytest.raises(InputError, match=r'clearance_from: "standstill" is a word; an axis has numbers'):
        make_axis("rotor.clearance_from", "standstill", RING)
    given = {"degrees": [(1, "v")], "stators": LumpedStator(node=1, rigid=True, radius=1.0), "gravity": 9.81}
    lying = Rig.from_matrices([[2.0]], K=[[1e5]], **given, clearance_from="standstill")
    assert assemble(lying).stators[0].centre == (-2.0 * 9.81 / 1e5, 0.0)


STILL = with_keys(LIGHT, {"rotor.unbalance.mass": 0.0})
INTERFERENCE = 50e-6


@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"normal": "updated"},
        {"friction_law": "coulomb"},
        {"restitution": 0.5},
        {"law": "penalty", "stiffness": 5e6},
        SHORT,
    ],
)
@pytest.mark.parametrize("angles", [(0.0,), (0.0, math.pi)])
def test_an_interference_is_shared_as_by_springs_in_series(angles, keys):
    rig = around(STILL, *angles)
    case = CASE | {"clearance": -INTERFERENCE, "friction": 0.0, "revolutions": 1}
    record = simulate(rig, **case, **keys)
    shaft = 1 / SHAFT if len(angles) == 1 else 0.0
    soft = 1 / keys["stiffness"] if "law" in keys else 0.0
    force = np.full(len(angles), INTERFERENCE / (1 / BEAM + shaft + soft))
    assert record.contact_force[:, 0] == pytest.approx(force, rel=1e-6)
    assert record.contact_force[:, -1] == pytest.approx(force, rel=1e-5)


def test_an_interference_pushes_the_shaft_onto_another_stator():
    """50 um against a stator that is 10 um away: three springs."""
    rig = with_keys(around(STILL, 0.0, math.pi), {"stator.2.clearance_offset": 60e-6})
    record = simulate(rig, **CASE | {"clearance": -INTERFERENCE, "friction": 0.0, "revolutions": 1})
    up = np.linalg.solve([[SHAFT + 2 * BEAM]], [-BEAM * INTERFERENCE - BEAM * 10e-6])[0]
    known = [BEAM * (INTERFERENCE + up), BEAM * (-up - 10e-6)]
    assert record.contact_force[:, 0] == pytest.approx(known, rel=1e-4)
    assert record.contact_force[:, -1] == pytest.approx(known, rel=1e-4)


def test_an_interference_with_a_wall_or_of_a_ratio_is_refused_in_one_line():
    wall = replace(LIGHT, stator=(LumpedStator(node=8, rigid=True),))
    with pytest.raises(
        InputError, match=r"simulate: clearance: -20 um and .* leave no gap at a rigid stator; "
    ):
        simulate(wall, **CASE | {"clearance": "-20 um"})
    shut = {"stator.clearance_offset": "-1 mm"}
    given = CASE | {"clearance": None, "clearance_ratio": 0.7, "overrides": shut}
    with pytest.raises(InputError, match=r"clearance_ratio: .* leave no gap; give clearance instead"):
        simulate(LIGHT, **given)
