"""Models on bearings that depend on the speed: taken at the speed of each case."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closed_form import Contact, run_up, simulate
from trial_rig import trial_rig

from rubhpc import InputError, assemble
from rubhpc.fem.assemble import model_at
from rubhpc.fem.modes import modes
from rubhpc.fem.response import (
    contact_free_amplitude,
    first_lateral_frequency,
    steady_response,
    step_limit,
)
from rubhpc.fem.statics import sag_remark
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Bearing, Damping
from rubhpc.rig.reading import rig_from_dict
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import Study, make_axis

SPEEDS = (80.0, 150.0, 320.0)
FACTOR = (1.0, 1.7, 2.9)
SPIN = 210.0
CONSTANT = {"kyy": 1e6, "kzz": 7e5, "kyz": 2e4, "kzy": -3e4, "cyy": 60.0, "czz": 90.0}


def rig_on(bearing, gravity=9.81):
    rig = trial_rig()
    rotor = replace(rig.rotor, bearing=(bearing, rig.rotor.bearing[1]), gravity=gravity)
    return replace(rig, rotor=replace(rotor, damping=Damping(alpha=25.0, beta=1e-5)))


TABLE = BearingTable(node=1, speed=SPEEDS, **{k: np.array(FACTOR) * v for k, v in CONSTANT.items()})


def frozen(spin):
    """The same rig, with constant bearings of the coefficients at a spin."""
    (kyy, kyz), (kzy, kzz) = TABLE.at(spin)[0]
    (cyy, cyz), (czy, czz) = TABLE.at(spin)[1]
    return rig_on(Bearing(node=1, kyy=kyy, kyz=kyz, kzy=kzy, kzz=kzz, cyy=cyy, cyz=cyz, czy=czy, czz=czz))


@pytest.mark.parametrize("spin", [80.0, 150.0, SPIN, 320.0])
def test_model_at_a_speed_is_that_of_constant_bearings(spin):
    found, known = model_at(assemble(rig_on(TABLE)), spin), assemble(frozen(spin))
    assert found.rotor.stiffness == pytest.approx(known.rotor.stiffness, rel=1e-12, abs=1e-6)
    assert found.rotor.damping == pytest.approx(known.rotor.damping, rel=1e-12, abs=1e-9)
    assert found.sag == pytest.approx(known.sag, rel=1e-9, abs=1e-15)
    assert found.sag.any()


def test_linear_answers_take_the_bearing_at_the_speed():
    model, known = assemble(rig_on(TABLE)), assemble(frozen(SPIN))
    assert steady_response(model, SPIN) == pytest.approx(steady_response(known, SPIN), rel=1e-9)
    assert contact_free_amplitude(model, SPIN) == pytest.approx(contact_free_amplitude(known, SPIN), rel=1e-9)
    for one, other in zip(modes(model.rotor, SPIN), modes(known.rotor, SPIN), strict=True):
        assert one.frequency == pytest.approx(other.frequency, rel=1e-9)
    # a model already at a speed is moved to another
    again = model_at(model_at(model, 100.0), SPIN)
    assert np.array_equal(again.rotor.stiffness, model_at(model, SPIN).rotor.stiffness)


def test_speed_ratio_counts_from_the_lowest_speed_of_the_table():
    found = first_lateral_frequency(assemble(rig_on(TABLE)))
    assert found == pytest.approx(first_lateral_frequency(assemble(frozen(SPEEDS[0]))), rel=1e-12)


def test_step_limit_holds_at_every_speed():
    known = min(step_limit(assemble(frozen(speed))) for speed in SPEEDS)
    assert step_limit(assemble(rig_on(TABLE))) == pytest.approx(known, rel=1e-9)


@pytest.mark.parametrize("method", ["modal", "central-difference"])
def test_a_case_is_that_of_constant_bearings(method):
    case = {"speed": SPIN, "clearance": "50 um", "transient": 2, "revolutions": 2, "method": method}
    found, known = simulate(rig_on(TABLE), **case), simulate(frozen(SPIN), **case)
    assert known.contact_impulse[0] > 0.0
    for name in ("vertical", "horizontal", "contact_force"):
        one, other = getattr(found, name), getattr(known, name)
        assert one == pytest.approx(other, abs=1e-7 * np.abs(other).max()), name
    assert abs(found.energy_residual) < 1e-4


def test_a_speed_outside_the_table_is_refused():
    with pytest.raises(InputError, match=r"rotor.bearing.1: 3342.25 rpm is outside its table"):
        simulate(rig_on(TABLE), speed=350.0, clearance="50 um")


def test_tables_without_a_common_speed_are_refused():
    rig = rig_on(TABLE)
    late = BearingTable(node=5, speed=[400.0, 500.0], stiffness=1e6)
    body = assemble(replace(rig, rotor=replace(rig.rotor, bearing=(TABLE, late)))).rotor
    with pytest.raises(InputError, match="no speed is common to them"):
        body.tabulated_speeds  # noqa: B018


def sweep(speeds):
    rig = rig_on(TABLE)
    axes = [("speed", speeds), ("clearance_ratio", [0.8]), ("friction", [0.1])]
    axes = tuple(make_axis(name, values, rig) for name, values in axes)
    return CaseGrid(Study(title="tables", rig=rig, axes=axes, contact=Contact(), output=Path("none.zarr")))


def test_a_study_takes_each_case_at_its_speed():
    cases = sweep([100.0, SPIN])
    for i, spin in enumerate((100.0, SPIN)):
        case = cases.case((i, 0, 0))
        known = contact_free_amplitude(assemble(frozen(spin)), spin)
        assert case.contact_free_amplitude == pytest.approx(known, rel=1e-9)
        assert case.clearance == pytest.approx(0.8 * known, rel=1e-9)


EAST, WEST = (-40e-6, -25e-6, -10e-6), (12e-6, 20e-6, 16e-6)
FILM = replace(TABLE, eccentricity_y=EAST, eccentricity_z=WEST)


def pinned(gravity=9.81):
    """A rig on two films; in the right one the journal stays at (-20, 5) um."""
    rig = rig_on(FILM, gravity)
    right = replace(TABLE, node=5, eccentricity_y=-20e-6, eccentricity_z=5e-6)
    return replace(rig, rotor=replace(rig.rotor, bearing=(FILM, right)))


@pytest.mark.parametrize("spin", [80.0, 150.0, SPIN, 320.0])
def test_journals_rest_where_their_table_has_them(spin):
    """The shaft is the line through its journals, and bends about it as on pins."""
    model = model_at(assemble(pinned()), spin)
    left = FILM.eccentricity(spin)
    assert [model.rotor.at_node(node, model.sag) for node in (1, 5)] == [
        pytest.approx(tuple(left), rel=1e-9),
        pytest.approx((-20e-6, 5e-6), rel=1e-9),
    ]
    stiff = tuple(Bearing(node=node, stiffness=1e13) for node in (1, 5))
    pins = assemble(replace(pinned(), rotor=replace(pinned().rotor, bearing=stiff)))
    bent = pins.rotor.at_node(3, pins.sag)
    line = 0.5 * (left + np.array([-20e-6, 5e-6]))
    assert model.rotor.at_node(3, model.sag) == pytest.approx(tuple(line + bent), rel=1e-5)
    assert model.sag == pytest.approx(
        np.linalg.solve(model.rotor.stiffness, model.load + model.film), rel=1e-9
    )


@pytest.mark.parametrize("method", ["modal", "central-difference"])
def test_probes_feel_the_weight_on_journals_in_films(method):
    """At rest the shaft stays in its static position, and each journal bears half of the weight."""
    probes = [{"name": f"at_{node}", "node": node, "quantity": "bearing_force"} for node in (1, 5)]
    rig = replace(pinned(), rotor=replace(pinned().rotor, unbalance=()))
    case = {"speed": SPIN, "clearance": "5 mm", "transient": 0, "revolutions": 1, "method": method}
    record = simulate(rig, **case, probes=probes)
    model = model_at(assemble(rig), SPIN)
    up, across = model.rotor.at_node(3, model.sag)
    assert record.vertical == pytest.approx(np.full(256, up), rel=1e-9)
    assert record.horizontal == pytest.approx(np.full(256, across), rel=1e-9)
    weight = model.load[[name == "v" for _, name in model.rotor.degrees]].sum()
    for probe in (record.probe_at_1, record.probe_at_5):
        assert probe == pytest.approx(np.full(256, 0.5 * weight), rel=1e-5)


def test_a_run_up_follows_the_journals():
    rig = replace(pinned(), rotor=replace(pinned().rotor, unbalance=()))
    probe = {"name": "at_1", "node": 1, "quantity": "bearing_force"}
    passage = run_up(rig, start=90.0, stop=300.0, time="4 s", clearance="5 mm", probes=[probe])
    speeds, model = passage.speed.values, assemble(rig)
    known = np.array([model.rotor.at_node(3, model_at(model, speed).sag) for speed in speeds])
    for name, at in zip(("vertical", "horizontal"), known.T, strict=True):
        mean = passage[name].values.reshape(len(speeds), -1).mean(axis=1)
        assert mean == pytest.approx(at, abs=0.01 * np.ptp(at)), name
    assert passage.probe_at_1.values == pytest.approx(passage.probe_at_1.values.mean(), rel=1e-3)


def test_journals_of_tables_are_checked():
    assert BearingTable(node=1, speed=SPEEDS, stiffness=1e6).eccentricity(SPIN) is None
    assert FILM.eccentricity(0.0) == pytest.approx([EAST[0], WEST[0]])
    assert replace(FILM, eccentricity_z=None).eccentricity(SPIN)[1] == 0.0
    with pytest.raises(InputError, match="eccentricity_y: 2 values for 3 speeds; give one for each speed"):
        replace(FILM, eccentricity_y=(0.0, 1e-5))
    twice = replace(
        pinned(), rotor=replace(pinned().rotor, bearing=(FILM, FILM, rig_on(TABLE).rotor.bearing[1]))
    )
    with pytest.raises(InputError, match=r"rotor\.bearing\.2: .* another table at node 1 gives the position"):
        assemble(twice)


def test_the_sag_of_dynamic_coefficients_is_remarked_on():
    for rig in (rig_on(TABLE), rig_on(replace(frozen(SPIN).rotor.bearing[0]))):
        assert "is that of the dynamic coefficients" in sag_remark(assemble(rig))
    for rig in (rig_on(TABLE, gravity=0.0), pinned(), rig_on(Bearing(node=1, stiffness=1e6))):
        assert sag_remark(assemble(rig)) == ""
    assert [line for line in sweep([100.0, SPIN]).warnings() if "dynamic coefficients" in line]


def test_a_journal_is_placed_relative_to_its_pedestal():
    film = {
        "speed": [10.0, 900.0],
        "stiffness": [1e7, 1e7],
        "eccentricity_y": [-2e-5] * 2,
        "eccentricity_z": [1e-5] * 2,
    }
    shaft = {"length": 1.0, "outer_diameter": 0.05, "elements": 2, "density": 7800.0}
    shaft |= {"youngs_modulus": 2.1e11, "shear_modulus": 8e10}
    rotor = {"gravity": 9.81, "shaft": [shaft], "torsion": {"fixed_node": 1}}
    seen = []
    for pedestal in ({}, {"pedestal": {"stiffness": 1e7, "mass": 1.0}}):
        rotor["bearing"] = [{"node": node, **film, **pedestal} for node in (1, 3)]
        rig = rig_from_dict({"name": "journals", "rotor": rotor, "stator": []}, "journals")
        model = model_at(assemble(rig), 300.0)
        seen.append(model.rotor.at_node(1, model.sag))
    weight = (7800.0 * np.pi / 4 * 0.05**2 + 2.0) * 9.81  # with the pedestals
    assert seen[0] == pytest.approx((-2e-5, 1e-5))
    assert seen[1] == pytest.approx((-2e-5 - weight / 2 / 1e7, 1e-5), rel=1e-6)
