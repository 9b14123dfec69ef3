"""Branches on the packaged rig: derivatives, events, points that are motions, and refusals."""

from dataclasses import replace

import closed_form
import numpy as np
import pytest
from closed_form import Contact, periodic, read_rig

import rubhpc
from rubhpc import LumpedStator
from rubhpc.errors import InputError
from rubhpc.integrate.branches.arclength import follow
from rubhpc.integrate.branches.branching import Branching
from rubhpc.integrate.periodic_motions import family as family_module
from rubhpc.integrate.periodic_motions.family import MOST_KEPT, Family, Operation
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.start import fit_to_gaps
from rubhpc.study.tables import Integrator

CASE = {"speed_ratio": 0.75, "friction": 0.3}
ALONG = {"along": "clearance", "start": "100 um", "stop": "124 um", "largest_step": "4 um", "keep": ()}


@pytest.fixture(scope="module")
def found():
    return closed_form.branch("mokhtar2017", period=2, **ALONG, **CASE)


def contact_free_amplitude():
    """Amplitude of the gap without contact, of the reduced model; cubics between steps err by 1.5e-8."""
    setup, *_ = family_of("clearance", (0.0, 1e-5)).settings(1e-3)
    bodies, spin = PiecewiseMotion(setup, 1e-3, 0.3, rubhpc.State.at_rest(setup.model)).bodies, setup.spin
    dynamic = bodies.stiffness - spin**2 * np.eye(len(bodies.stiffness)) + 1j * spin * bodies.damping
    phasor = np.linalg.solve(dynamic, bodies.force_cosine - 1j * bodies.force_sine)
    return abs((bodies.gap_jacobian @ phasor)[0])


def family_of(along, ends, contact=None):
    return Family(
        Operation(
            rig=read_rig("mokhtar2017"), friction=0.3, speed_ratio=0.75, clearance=1e-4,
            contact=contact or Contact(), integrator=Integrator(), samples_per_revolution=256,
        ),
        along, ends,
    )  # fmt: skip


def test_branches_end_where_the_contact_free_motion_grazes(found):
    twice, once, other = found
    assert [branch.period for branch in found] == [2, 1, 2]
    assert [name for name, _ in twice.events()] == ["grazing", "grazing", "period_doubling"]
    assert once.events()[-1] == ("grazing", pytest.approx(contact_free_amplitude(), rel=3e-8))
    assert all(type(value) is float for _, value in once.events())  # plain numbers, also in print
    doubled = [value for name, value in once.events() if name == "period_doubling"]
    assert [name for name, _ in other.events()] == ["period_doubling"]
    assert (other.values.max(), twice.values.max()) == pytest.approx(doubled, rel=1e-8)
    assert [branch.points[k].touches for branch, k in ((twice, 0), (once, 0), (once, -1))] == [2, 1, 0]


def test_points_are_periodic_motions(found):
    for branch in found[:2]:
        # at an event a multiplier is on the unit circle
        points = [point for point in branch.points if point.event == "none"]
        for point in points[:: len(points) // 3]:
            motion = periodic(
                "mokhtar2017",
                clearance=point.value,
                period=branch.period,
                initial=point.state,
                keep=(),
                **CASE,
            )
            assert (motion.iterations, motion.is_stable) == (0, point.is_stable)
            assert motion.multipliers[0] == pytest.approx(point.multipliers[0], abs=1e-6)


def test_points_let_go_of_the_tables_of_their_cases(monkeypatch):
    """Without room some cases are kept, whatever the length of a branch; others are set up again, alike."""
    monkeypatch.setattr(family_module, "ROOM", 0)
    family = family_of("clearance", (1.05e-4, 1.2e-4))
    motion = periodic("mokhtar2017", clearance=1.06e-4, period=2, keep=(), **CASE)
    setup, clearance, friction = family.settings(1.06e-4)
    case = PiecewiseMotion(setup, clearance, friction, fit_to_gaps(motion.state, setup, clearance))
    first = Branching(family, 3e-7).begin(1.06e-4, case.start, case.states, 2)
    track = follow(Branching(family, 3e-7), [first], 1.0, low=1.05e-4, high=1.2e-4, most=30)
    assert len(track.points) == 30
    assert len(family._cases) == MOST_KEPT
    point = track.points[3]
    assert point.value not in family._cases
    again = point.case.follow(point.motion, point.states, 2, phase=point.phase)
    assert np.array_equal(again[-1].end, point.revolutions[-1].end)


def test_stability_changes_at_events_alone(found):
    for branch in found:
        changes = np.flatnonzero(np.diff(branch.is_stable))
        for k in changes:
            assert {branch.points[k].event, branch.points[k + 1].event} != {"none"}


@pytest.mark.long
def test_a_branch_between_two_doublings_is_followed_once():
    """P2 begins at a doubling right behind a grazing, has a fold and meets P1 at another doubling."""
    once, twice = closed_form.branch(
        "mokhtar2017", along="speed_ratio", start=0.713, stop=0.752, clearance="100 um", friction=0.3,
        largest_step=0.008, keep=(),
    )  # fmt: skip
    doubled = [value for name, value in once.events() if name == "period_doubling"]
    assert len(doubled) == 2
    names, values = zip(*twice.events(), strict=True)
    assert names == ("period_doubling", "grazing", "grazing", "fold", "period_doubling")
    assert values[::4] == pytest.approx(doubled, rel=1e-8)
    assert values[3] == max(twice.values)


def test_dataset_has_a_value_a_point(found):
    data = found[1].to_dataset()
    assert dict(data.sizes)["point"] == len(found[1].points)
    assert np.array_equal(data.stability.values.astype(bool), found[1].is_stable)
    assert data.clearance.values == pytest.approx(found[1].values)
    moduli = np.hypot(data.multiplier_real, data.multiplier_imag)
    assert data.largest_multiplier.values == pytest.approx(moduli[:, 0].values)
    assert data.event.values.max() == 5


@pytest.mark.parametrize("along", ["clearance", "clearance_ratio"])
def test_derivative_by_the_clearance_is_that_of_two_flows(along):
    family = family_of(along, (0.0, 0.1 if along == "clearance_ratio" else 1e-5))
    motion = periodic("mokhtar2017", clearance="100 um", period=2, keep=(), **CASE)
    unit = motion.record.contact_free_amplitude if along == "clearance_ratio" else 1.0
    value = 1e-4 / unit
    setup, clearance, friction = family.settings(value)
    state = fit_to_gaps(motion.state, setup, clearance)
    begun = PiecewiseMotion(setup, clearance, friction, state)
    point = Branching(family, 1.0).begin(value, begun.start, begun.states, 2)
    found, _ = family.derivative(value, point.motion, point.states, point.revolutions, point.phase)
    step = 1e-10 / unit
    up, down = (
        family.at(value + sign * step).follow(point.motion, point.states, 2, phase=point.phase)[-1].end
        for sign in (1, -1)
    )
    expected = (up - down) / (2 * step)
    assert found == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_cases_along_a_speed_share_a_basis_and_are_followed_as_they_are_recorded():
    family = family_of("speed_ratio", (0.7, 0.8), Contact())
    here, there = family.at(0.75), family.at(0.76)
    motion = np.concatenate([np.full(here.n, 1e-5), np.full(here.n, 1e-3)])
    assert np.array_equal(family.carry(motion, here, there), motion)
    setup, clearance, friction = family.settings(0.75)
    recorded = PiecewiseMotion(setup, clearance, friction, rubhpc.State.at_rest(setup.model))
    begun = recorded.start, recorded.states
    ends = [case.revolve(*begun) for case in (here, recorded)]
    assert len(ends[0].pieces) > 1
    assert np.array_equal(ends[0].end, ends[1].end)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"sweeps": 1.5}, "branch: sweeps: 1.5 is not a whole number"),
        ({"along": "contact.restitution"}, "branch: along: contact.restitution cannot be followed"),
        ({"sweeps": -1}, "sweeps: -1 is out of range; it must be at least 0"),
        ({"along": "speed", "start": -1.0, "stop": 1.0}, "contains 0, which is not a valid speed"),
        ({"along": "frction"}, "along: .*unknown axis; did you mean friction"),
        ({"stop": "100 um"}, "stop: 100 um equals start"),
        ({"largest_step": "-1 um"}, "largest_step: -1 um is out of range"),
        ({"clearance": 1e-4}, "clearance: varies along the branch"),
        ({"start": "1 kg"}, "branch: start: "),
        ({"along": "clearance_ratio", "start": 0.9, "stop": -0.2}, "clearance_ratio must be at least 0"),
        ({"along": 3}, 'branch: along: 3 is not the name of an axis; give one, such as "friction"'),
    ],
)
def test_bad_arguments_are_refused(arguments, text):
    with pytest.raises(InputError, match=text) as caught:
        closed_form.branch("mokhtar2017", **CASE | ALONG | arguments)
    assert "\n" not in str(caught.value)


def test_a_range_of_negative_friction_is_refused():
    with pytest.raises(InputError, match=r"stop: -0\.2 is out of range; friction must be at least 0"):
        closed_form.branch(
            "mokhtar2017", along="friction", start=0.3, stop=-0.2, speed_ratio=0.75, clearance="84 um"
        )


@pytest.mark.parametrize("keeps_those_of_both_ends", [True, False])
def test_a_stiffness_may_ask_for_other_modes_at_either_end(monkeypatch, keeps_those_of_both_ends):
    """The stiffer stator needs more modes; one that is coupled otherwise keeps each value's own."""
    if not keeps_those_of_both_ends:
        monkeypatch.setattr(Family, "_reduced", lambda *_: None)
    spring = LumpedStator(node=8, radius=0.06, mass=1e-3, damping=2.0, stiffness=1e5)
    (found,) = closed_form.branch(
        replace(read_rig("mokhtar2017"), stator=(spring,)), along="stator.stiffness", start="20 kN/m",
        stop="2 MN/m", speed_ratio=1.42, clearance="150 um", friction=0.05, transient=60,
        samples_per_revolution=64, keep=(),
    )  # fmt: skip
    assert (found.end, found.values[-1]) == ("the range ends", 2e6)
    sizes = {point.multipliers.size for point in found.points}
    assert (len(sizes) == 1) == keeps_those_of_both_ends


@pytest.mark.parametrize("step", [0.01, 0.001])
def test_stretch_far_narrower_than_a_step_is_not_lost(step):
    """Stable for 7.6e-5: two multipliers come in as a pair, meet on the real axis, and one leaves by -1."""
    (found,) = closed_form.branch(
        "mokhtar2017", along="clearance_ratio", start=0.93, stop=0.95, largest_step=step, period=1,
        speed_ratio=2.1, friction=0.3, overrides={"stator.youngs_modulus": "30 GPa"}, doublings=0, keep=(),
    )  # fmt: skip
    (inwards, entered), (doubling, left) = found.events()
    assert (inwards, doubling) == ("neimark_sacker", "period_doubling")
    assert entered == pytest.approx(0.944376651, abs=1e-8)
    assert left == pytest.approx(0.944452970, abs=1e-8)
    between = (found.values > entered) & (found.values < left)
    assert between.any()
    assert found.is_stable[between].all()
    outside = (found.values < entered - 1e-6) | (found.values > left + 1e-6)
    assert not found.is_stable[outside].any()
