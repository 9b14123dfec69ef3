"""Transients that end where the motion has settled."""

import numpy as np
import pytest

from rubhpc import simulate
from rubhpc.errors import InputError
from rubhpc.integrate.transient import has_settled
from rubhpc.schema import REGIME
from rubhpc.study.study import Recording

CASE = {"speed_ratio": 0.75, "friction": 0.3, "revolutions": 4}


@pytest.mark.parametrize(("clearance", "period"), [("84 um", 1), ("100 um", 2), ("1 mm", 1)])
def test_record_begins_where_a_long_transient_leads(clearance, period):
    """One of period 2 may begin with either of its cycles."""
    found = simulate("mokhtar2017", transient="auto", clearance=clearance, **CASE)
    settled = simulate("mokhtar2017", transient=400, clearance=clearance, **CASE)
    assert found.period == period
    assert found.transient_revolutions < 150
    distance = [
        np.sqrt(np.mean((np.roll(found.vertical, 256 * n) - settled.vertical) ** 2)) for n in range(period)
    ]
    assert min(distance) < 1e-4 * settled.vertical.std()


def test_tolerance_and_limit_are_kept():
    loose, tight, cut = (
        simulate("mokhtar2017", transient="auto", clearance="84 um", **extra, **CASE).transient_revolutions
        for extra in ({"transient_tolerance": 1e-2}, {"transient_tolerance": 1e-6}, {"transient_limit": 30})
    )
    assert loose < tight
    assert cut == 30
    assert simulate("mokhtar2017", transient=7, clearance="84 um", **CASE).transient_revolutions == 7


def test_central_difference_settles_too():
    found = simulate(
        "mokhtar2017",
        method="central-difference",
        step="2 us",
        transient="auto",
        clearance="84 um",
        speed_ratio=3.0,
        revolutions=1,
        overrides={"stator.youngs_modulus": "1 GPa", "stator.elements": 2},
        transient_tolerance=0.05,
    )
    assert 8 < found.transient_revolutions < 240
    assert (found.transient_revolutions - 1) % 12 in (8, 0)


def test_one_signal_that_changes_has_not_settled():
    cycle = np.array([[1.0, -2.0, 0.5], [1e-6, 3e-6, -1e-6], [0.0, 0.0, 0.0]])
    later = cycle.copy()
    later[1, 2] += 2e-9
    assert has_settled(later, cycle, 1e-3)
    assert not has_settled(later, cycle, 5e-4)


def test_a_signal_that_dies_out_has_settled():
    """Free ringing changes by the same share from cycle to cycle, however small it has become."""
    cycle, decay = np.array([[1.0, -1.0], [2e-5, -2e-5]]), np.array([[1.0], [0.5]])
    assert not has_settled(cycle * decay, cycle, 1e-3)
    assert not has_settled(cycle * decay, cycle, 1e-3, np.array([0.01, 1e-3]))
    assert has_settled(cycle * decay, cycle, 1e-3, np.array([0.01, 1e-2]))


def test_ringing_stators_do_not_prolong_the_transient():
    """After a knock without lasting contact tips and torsion ring down to nothing."""
    found = simulate(
        "mokhtar2017",
        transient="auto",
        clearance="300 um",
        initial={"from": "contact_free", "impulse": "0.1 N*s"},
        **(CASE | {"speed_ratio": 1.5, "friction": 0.1}),
    )
    assert REGIME[found.regime] == "no_contact"
    assert found.settled == 1
    assert 20 < found.transient_revolutions < 100


@pytest.mark.parametrize("key", ["transient_limit", "transient_tolerance"])
def test_keys_of_auto_go_with_it_alone(key):
    value = {"transient_limit": 50, "transient_tolerance": 1e-3}[key]
    with pytest.raises(InputError, match=f"{key}: it goes with transient"):
        Recording(transient=120, **{key: value})
    assert Recording(transient="auto", **{key: value}).is_transient_auto
    with pytest.raises(InputError, match="transient"):
        simulate("mokhtar2017", transient="long", clearance="84 um", **CASE)
