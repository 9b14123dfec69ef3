"""The proof of a record that begins on a motion that was solved for, or looks like another one."""

import pytest
from closed_form import periodic, simulate
from overhung_pump import pump
from set_ups import prepared
from trial_rig import trial_rig

from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.periodic_motions import proof
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.schema import REGIME

TWICE = {
    "speed_ratio": 3.0, "clearance_ratio": 0.5, "friction": 0.2, "overrides": {"rotor.damping.alpha": 4.0},
    "samples_per_revolution": 64, "keep": (),
}  # fmt: skip


@pytest.mark.parametrize("revolutions", [4, 5])
def test_motion_that_was_solved_for_is_not_solved_for_again(monkeypatch, revolutions):
    """A record of period 2, that ends at its first section or at its second one."""
    again = simulate("mokhtar2017", transient=900, revolutions=revolutions, **TWICE)
    monkeypatch.delattr(proof, "shoot")
    found = simulate("mokhtar2017", transient="direct", revolutions=revolutions, **TWICE)
    assert found.period == again.period == 2
    assert found.settled == 1
    assert found.largest_multiplier == pytest.approx(again.largest_multiplier, rel=1e-6)


@pytest.mark.parametrize("ratio", [0.948, 0.94798])
def test_period_four_beside_a_second_frequency_does_not_pass_for_one(ratio):
    """Just below 0.94801, where period 1 becomes unstable at nearly a quarter of a turn."""
    case = {
        "clearance": "400 um",
        "friction": 0.1,
        "restitution": 0.5,
        "samples_per_revolution": 64,
        "keep": (),
    }
    record = simulate(pump(), speed_ratio=ratio, transient=600, revolutions=16, **case)
    assert REGIME[record.regime] == "periodic"
    assert (record.period, record.settled) == (4, 1)
    solved = periodic(pump(), speed_ratio=ratio, period=4, initial=record.final, **case)
    assert solved.period == 4
    assert record.largest_multiplier == pytest.approx(abs(solved.multipliers[0]), rel=1e-5)
    inside = periodic(pump(), speed_ratio=ratio, period=1, initial=record.final, **case)
    assert inside.period == 1
    assert not inside.is_stable


@pytest.mark.parametrize("revolutions", [16, 64, 128])
def test_chaos_that_dies_out_has_not_settled(revolutions):
    """Whatever the record's length, it is the motion that a long simulation comes to."""
    stiff = {
        "speed_ratio": 6.0, "clearance_ratio": 0.85, "friction": 0.5,
        "overrides": {"stator.youngs_modulus": "30 GPa"}, "samples_per_revolution": 64, "keep": (),
    }  # fmt: skip
    record = simulate("mokhtar2017", transient=120, revolutions=revolutions, **stiff)
    reached = simulate("mokhtar2017", transient=3000, revolutions=12, **stiff)
    assert (REGIME[reached.regime], reached.period, reached.settled) == ("periodic", 3, 1)
    assert (REGIME[record.regime], record.period, record.settled) == ("periodic", 3, 0)
    assert record.largest_multiplier == pytest.approx(reached.largest_multiplier, rel=1e-5)
    if revolutions < 128:  # it dies out soon after the others end
        assert record.lyapunov_exponent > 0.05
    assert record.peak_contact_force[0] > 2.0 * reached.peak_contact_force[0]


@pytest.mark.parametrize(
    ("count", "many", "looks", "expected"),
    [
        (2, 6, (False, False), 512),
        (2, 6, (False, True), 1536),
        (3, 6, (False, False), 128),
        (3, 6, (False, True), 512),
        (3, 3, (False, False), 0),
        (3, 3, (False, True), 128),
        (3, 3, (True, False), 512),
    ],
)
def test_revolutions_of_many_pairs_are_followed_less_far(monkeypatch, count, many, looks, expected):
    given = {"clearance": 80e-6, "friction": 0.2, "samples_per_revolution": 64}
    record = simulate(trial_rig(count), speed=170.0, transient=2, revolutions=1, keep=(), **given)
    setup = prepared(trial_rig(count), 170.0)
    passed, on = [], EventDrivenMarch.pass_sections

    def counted(march, n_revolution, *args):
        passed.append(n_revolution)
        return on(march, n_revolution, *args)

    monkeypatch.setattr(EventDrivenMarch, "pass_sections", counted)
    monkeypatch.setattr(proof, "MANY_PAIRS", many)

    def motion_of(state, march):
        return PiecewiseMotion(setup, 80e-6, 0.2, state, march)

    solver = proof.Solver(motion_of, record.final)
    list(solver.later(*looks))
    assert sum(passed) == expected
    assert (0 if solver.followed is None else solver.followed[0].size) == expected
