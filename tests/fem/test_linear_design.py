"""The dataset of a linear design: what is in it, and that its parts agree with each other."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig
from trial_rig import trial_rig

from rubhpc import InputError, Rig, Unbalance, assemble
from rubhpc.fem.assemble import model_at
from rubhpc.fem.linear_design import linear_design
from rubhpc.fem.modes import modes
from rubhpc.fem.response import contact_free_amplitude
from rubhpc.rig.bearing_table import BearingTable

OPERATING = (350.0, 380.0)


def rig(**changed):
    found = trial_rig(1)
    return replace(found, rotor=replace(found.rotor, gravity=9.81, **changed))


@pytest.fixture(scope="module")
def design():
    return linear_design(rig(), (0.0, 600.0), operating=OPERATING, nodes=[3, 2], n_speed=13)


def test_dimensions_and_units(design):
    assert design.sizes["speed"] == 13
    assert design.sizes["node"] == 5
    assert design.sizes["mode"] == assemble(rig()).rotor.n_dof
    assert design.attrs["operating"] == [350.0, 380.0]
    for name, variable in design.variables.items():
        if variable.dtype.kind == "f" and name not in ("node", "part"):
            assert "units" in variable.attrs, name


def test_modes_are_those_of_each_speed(design):
    for speed in design.speed.values[::6]:
        known = sorted(mode.frequency for mode in modes(assemble(rig()).rotor, speed))
        assert sorted(design.frequency.sel(speed=speed).values) == pytest.approx(known)
    lateral = design.where(design.kind == "lateral", drop=True)
    ratio = lateral.damping_ratio
    assert lateral.logarithmic_decrement.values == pytest.approx(
        (2 * math.pi * ratio / np.sqrt(1 - ratio**2)).values, rel=1e-9
    )


def test_response_is_that_of_the_amplitude(design):
    model = assemble(rig())
    for speed in design.response_speed.values[1::40]:
        for node in (1, 3):
            known = contact_free_amplitude(model, speed, node)
            assert float(design.major_axis.sel(response_speed=speed, node=node)) == pytest.approx(known)


def test_peaks_lie_at_excited_critical_speeds(design):
    critical = design.critical_speed.values[design.is_excited.values]
    assert sorted(set(design.peak_node.values)) == [2, 3]
    for peak in design.peak_speed.values:
        assert np.abs(critical / peak - 1).min() < 0.01
    assert (design.separation_margin.values > 0).all()
    assert design.is_separated.dtype == bool


def test_shapes_are_of_unit_size(design):
    size = np.hypot(design.shape_vertical, design.shape_horizontal).max("node")
    assert np.sqrt((design.shape_vertical**2).sum("part")).max() <= 1.0 + 1e-12
    assert size.shape == (design.sizes["critical"], 2)


def test_sag_is_that_of_the_model(design):
    model = assemble(rig())
    known = [model.sag[model.rotor.index(node, "v")] for node in design.node.values]
    assert design.sag_vertical.isel(speed=4).values == pytest.approx(known)
    assert (design.sag_vertical < 0).all()
    assert not design.sag_horizontal.any()


def test_tables_set_the_range_and_the_sag():
    table = BearingTable(node=1, speed=[100.0, 150.0, 400.0], stiffness=[1e5, 3e5, 4e5], damping=50.0)
    given = rig(bearing=(table, rig().rotor.bearing[1]))
    found = linear_design(given, n_speed=7)
    assert found.attrs["speed_range"] == [100.0, 400.0]
    assert {100.0, 150.0, 400.0} <= set(found.speed.values)
    model = assemble(given)
    for speed in (100.0, 400.0):
        known = model_at(model, speed)
        row = known.rotor.index(3, "v")
        assert float(found.sag_vertical.sel(speed=speed, node=3)) == pytest.approx(known.sag[row])
    assert "separation_margin" not in found
    with pytest.raises(InputError, match=r"rotor.bearing.1: .* is outside its table"):
        linear_design(given, (0.0, 500.0), n_speed=5)


def test_a_rotor_without_an_unbalance_has_no_peak():
    found = linear_design(rig(unbalance=()), (0.0, 600.0), n_speed=7, operating=OPERATING)
    assert found.sizes["peak"] == 0
    assert found.sizes["critical"] > 0
    assert not found.major_axis.any()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"speed_range": (300.0, 100.0)}, "range: 300 to 100 rad/s is not a range"),
        ({"speed_range": (-1.0, 100.0)}, "give a lowest speed, at least 0"),
        ({"operating": (400.0, 300.0)}, "operating: 400 to 300 rad/s is not a range"),
        ({"nodes": [9]}, "node: 9 does not move sideways; nodes 1 to 5 do"),
    ],
)
def test_what_is_no_request_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        linear_design(rig(), **given)


def test_an_undamped_rotor_has_a_design():
    """Its resonance is met by a speed of the range, and by the critical speed that is solved for."""
    found = linear_design(
        Rig.from_matrices(
            2.0 * np.eye(2),
            None,
            2e4 * np.eye(2),
            degrees=[(1, "v"), (1, "w")],
            unbalance=[Unbalance(node=1, mass=1.0, radius=1e-5)],
        ),
        (0.0, 300.0),
        n_speed=7,
    )
    assert found.critical_speed.values == pytest.approx([100.0, 100.0])
    assert found.peak_speed.values == pytest.approx([100.0], rel=1e-7)
    assert np.isfinite(found.major_axis.values).all()


def test_backward_whirl_that_nothing_excites_has_no_peak():
    given = read_rig("mokhtar2017")
    rotor = replace(given.rotor, damping=replace(given.rotor.damping, alpha=0.0))
    found = linear_design(replace(given, rotor=rotor), (0.0, 2400.0), n_speed=5)
    excited = found.critical_speed.values[found.is_excited.values]
    assert found.peak_speed.values == pytest.approx(excited, rel=1e-7)
