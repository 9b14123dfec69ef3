"""Models on bearings that depend on the speed: taken at the speed of each case."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc import InputError, assemble, simulate
from rubhpc.fem.assemble import model_at
from rubhpc.fem.modes import modes
from rubhpc.fem.response import (
    contact_free_amplitude,
    first_lateral_frequency,
    steady_response,
    step_limit,
)
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Bearing, Damping
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
    return CaseGrid(Study(title="tables", rig=rig, axes=axes, output=Path("none.zarr")))


def test_a_study_takes_each_case_at_its_speed():
    cases = sweep([100.0, SPIN])
    for i, spin in enumerate((100.0, SPIN)):
        case = cases.case((i, 0, 0))
        known = contact_free_amplitude(assemble(frozen(spin)), spin)
        assert case.contact_free_amplitude == pytest.approx(known, rel=1e-9)
        assert case.clearance == pytest.approx(0.8 * known, rel=1e-9)


def test_a_study_beyond_the_table_is_refused():
    with pytest.raises(InputError, match=r"rotor.bearing.1: 3819.72 rpm is outside its table"):
        sweep([100.0, 400.0]).case((1, 0, 0))
