"""Records of a periodic motion that was solved for: one period is marched, and repeated."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate

from rubhpc import LumpedStator
from rubhpc.integrate import case, marched_record
from rubhpc.recent import forget
from rubhpc.rig.reading import with_keys
from rubhpc.schema import REGIME

PACKAGED = read_rig("mokhtar2017")
NOT_COMPARED = ("wall_time", "steps", "energy_residual", "contact_residual", "lyapunov_exponent")
LIGHT = {"overrides": {"rotor.damping.alpha": 4.0}, "samples_per_revolution": 64}
ONCE = {"speed_ratio": 1.3, "clearance_ratio": 0.968, "friction": 0.269}
TWICE = {"speed_ratio": 3.0, "clearance_ratio": 0.5, "friction": 0.2}
THREE = {"speed_ratio": 2.0, "clearance_ratio": 0.637, "friction": 0.016}


def ring(count):
    stator = LumpedStator(node=8, radius=0.06, mass=0.1, stiffness=1e5, damping=5.0)
    stators = (replace(stator, angle=2.0 * math.pi * i / count) for i in range(count))
    return replace(PACKAGED, rotor=replace(PACKAGED.rotor, gravity=9.81), stator=tuple(stators))


def both(monkeypatch, rig, **given):
    """The record of a case, repeated and marched from end to end."""
    repeat, closed = case.repeat_period, []

    def noted(*args):
        found = repeat(*args)
        closed.append(found[0] is not None)
        return found

    with monkeypatch.context() as patch:
        patch.setattr(case, "repeat_period", noted)
        forget()  # records of before
        repeated = simulate(rig, transient="direct", **given)
        patch.setattr(case, "repeat_period", lambda *_: (None, 0))
        forget()
        marched = simulate(rig, transient="direct", **given)
    assert closed == [True]
    return repeated, marched


def assert_same(repeated, marched, rel):
    """Signals within a share of their largest value; all measures."""
    for name in (*marched.signals, *marched.sections, *marched.spectra):
        one, other = np.asarray(getattr(repeated, name)), np.asarray(getattr(marched, name))
        assert one.shape == other.shape
        assert np.abs(one - other).max() <= rel * max(np.abs(other).max(), 1e-30), name
    for name, value in marched.measures.items():
        if name not in NOT_COMPARED:
            assert repeated.measures[name] == pytest.approx(value, rel=rel, abs=1e-30, nan_ok=True), name
    assert repeated.energy_residual <= 1.5 * marched.energy_residual + 1e-10
    final = marched.final.packed()
    assert repeated.final.packed() == pytest.approx(final, rel=rel, abs=rel * np.abs(final).max())


@pytest.mark.parametrize(
    ("motion", "period", "revolutions"),
    [(ONCE, 1, 1), (ONCE, 1, 6), (TWICE, 2, 2), (TWICE, 2, 7), (THREE, 3, 8), (THREE, 3, 9)],
)
def test_a_repeated_record_is_the_one_that_is_marched(monkeypatch, motion, period, revolutions):
    repeated, marched = both(monkeypatch, "mokhtar2017", revolutions=revolutions, **LIGHT, **motion)
    assert repeated.period == period
    assert REGIME[repeated.regime] == "periodic"
    if revolutions < 2 * period:  # too short to show a period, or whether it has settled
        for name in ("period", "regime", "settled", "largest_multiplier", "multiplier_angle"):
            marched.measures[name] = repeated.measures[name]
    assert_same(repeated, marched, 1e-6)


@pytest.mark.parametrize(
    ("law", "clearance_ratio"),
    [({}, 0.7), ({"restitution": 0.3}, 0.7)],
)
def test_laws_rings_loads_and_probes(monkeypatch, law, clearance_ratio):
    probes = [
        {"name": "bearing", "node": 1, "quantity": "bearing_force"},
        {"name": "foundation", "stator": 3, "quantity": "foundation_force"},
    ]
    repeated, marched = both(
        monkeypatch, ring(3), speed_ratio=1.7, clearance_ratio=clearance_ratio, friction=0.1, revolutions=5,
        overrides={"rotor.damping.alpha": 20.0}, probes=probes, samples_per_revolution=64, **law,
    )  # fmt: skip
    assert REGIME[repeated.regime] == "periodic"
    assert_same(repeated, marched, 1e-5)


def test_a_record_shorter_than_the_period_is_known_to_be_periodic():
    found = simulate("mokhtar2017", transient="direct", revolutions=2, **LIGHT, **THREE)
    assert (REGIME[found.regime], found.period, found.settled) == ("periodic", 3, 1)
    assert 0.9 < found.largest_multiplier < 1.0


def test_means_of_a_force_go_on_from_one_period_to_the_next(monkeypatch):
    """Two of three contacts are under way where periods begin: their forces act before, and after."""
    given = {"speed_ratio": 1.7, "clearance_ratio": 0.7, "friction": 0.1, "samples_per_revolution": 2048}
    note, later = marched_record._note_peak_at_return, []

    def alone(march, setup, ended, passed):
        later.append(np.zeros_like(ended.peak_force))
        note(march, setup, ended._replace(peak_force=later[-1]), passed)

    monkeypatch.setattr(marched_record, "_note_peak_at_return", alone)
    rig = with_keys(ring(3), {"rotor.damping.alpha": 20.0})
    found = simulate(rig, transient="direct", revolutions=2, **given)
    before, after = found.contact_force[:, 2047], found.contact_force[:, 2048]
    assert (after > 1.0).tolist() == [False, True, True]
    assert later[0] == pytest.approx(0.5 * (before + after), rel=0.02)


def test_a_period_that_does_not_close_is_not_repeated(monkeypatch):
    """The case goes on from the motion as a simulation, and its record is judged like any other."""
    closed = simulate("mokhtar2017", transient="direct", revolutions=6, **LIGHT, **TWICE)
    monkeypatch.setattr(marched_record, "nothing", lambda _: 0.0)
    forget()
    marched = simulate("mokhtar2017", transient="direct", revolutions=6, **LIGHT, **TWICE)
    assert (marched.period, marched.settled, REGIME[marched.regime]) == (2, 1, "periodic")
    assert marched.steps > closed.steps
    assert marched.vertical == pytest.approx(closed.vertical, abs=1e-7 * np.ptp(closed.vertical))
    assert marched.largest_multiplier == pytest.approx(closed.largest_multiplier, rel=1e-6)
