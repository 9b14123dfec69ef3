"""Branches of periodic motions against known answers: onset of whirl, rings of springs, grazing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import branch, periodic, read_rig
from set_ups import prepared

from rubhpc import LumpedStator, Rig, Unbalance
from rubhpc.integrate.branches.arclength import follow
from rubhpc.integrate.branches.branching import Branching
from rubhpc.integrate.branches.events import Event
from rubhpc.integrate.periodic_motions.family import Family
from rubhpc.rig.reading import with_keys


class CrossCoupled(Family):
    """A whirling mass with u'' + c u' + k u + cross (w, -v) = unbalance, over the cross-coupled stiffness."""

    def __init__(self, span):
        super().__init__(None, "cross", (0.0, span))
        self._known = {}

    def settings(self, value, *, is_measured=True):
        if value not in self._known:
            rig = Rig.from_matrices(
                np.eye(2), 0.08 * np.eye(2), [[1.69, value], [-value, 1.69]],
                degrees=[(1, "v"), (1, "w")],
                stators=[LumpedStator(node=1, rigid=True, radius=1.0)],
                unbalance=[Unbalance(node=1, mass=1.0, radius=1.0)],
            )  # fmt: skip
            self._known[value] = prepared(rig, 2.0, step=1e-3)
        return self._known[value], 100.0, 0.0


def test_whirl_becomes_unstable_where_cross_coupling_outweighs_damping():
    """At cross = c sqrt(k / m), with the angle of the multipliers that of a natural period a revolution."""
    branching = Branching(CrossCoupled(0.1), 0.02)
    case = branching.family.at(0.06)
    first = branching.begin(0.06, case.start, case.states, 1)
    track = follow(branching, [first], 1.0, low=0.06, high=0.16, most=40)
    (at,) = [k for k, event in enumerate(track.events) if event is Event.NEIMARK_SACKER]
    point = track.points[at]
    assert point.value == pytest.approx(0.08 * 1.3, rel=1e-8)
    pair = point.multipliers[np.abs(np.abs(point.multipliers) - 1.0) < 1e-6]
    assert np.abs(pair.imag) == pytest.approx(abs(math.sin(2 * math.pi * 1.3 / 2.0)), abs=1e-6)
    assert pair.size == 2
    assert [point.n_unstable for point in (track.points[0], track.points[-1])] == [0, 2]
    assert track.end == "the range ends"


def test_ring_of_springs_over_its_clearance():
    """A rub, an unstable rub and the motion without contact, which grazes at the contact-free amplitude."""
    springs = LumpedStator(node=8, radius=0.06, count=8, mass=1e-3, damping=2.0, stiffness=1e5)
    ring = replace(read_rig("mokhtar2017"), stator=(springs,))
    case = {"speed_ratio": 1.25, "friction": 0.0}
    (found,) = branch(
        ring, along="clearance", start="240 um", stop="420 um", largest_step="40 um", transient=40, **case
    )
    kinds = [name for name, _ in found.events() if name != "grazing"]
    free = periodic(ring, clearance=1e-3, keep=(), **case).record.contact_free_amplitude
    assert kinds == ["fold", "fold"]
    assert found.events()[-1][1] == pytest.approx(free, rel=3e-6)  # that of the full model
    assert [point.touches for point in (found.points[0], found.points[-1])] == [8, 0]
    lowest, highest = (found.values[[p.event == "fold" for p in found.points]][k] for k in (1, 0))
    assert lowest < free < highest


def overhung(rig):
    """The rig on three bearings, its disc beyond the last of them."""
    first, last = rig.rotor.bearing
    rotor = replace(
        rig.rotor,
        bearing=(first, replace(last, node=6), replace(last, node=11)),
        disc=(replace(rig.rotor.disc[0], node=15),),
        unbalance=(replace(rig.rotor.unbalance[0], node=15),),
    )
    return replace(rig, rotor=rotor, stator=(replace(rig.stator[0], node=15),))


def test_overhung_disc_on_three_bearings_grazes_at_its_contact_free_amplitude():
    """Before, the motion with one impact a revolution doubles its period."""
    (found,) = branch(
        overhung(read_rig("mokhtar2017")), along="clearance_ratio", start=0.9, stop=1.05, speed_ratio=0.8,
        friction=0.2, doublings=0, keep=(),
    )  # fmt: skip
    names = [name for name, _ in found.events()]
    assert names == ["period_doubling", "grazing"]
    assert found.events()[1][1] == pytest.approx(1.0, rel=1e-5)  # that of the full model
    assert [found.is_stable[0], found.is_stable[-1]] == [False, True]


def test_contact_free_motion_turns_at_its_grazing_into_an_unstable_one_with_an_impact():
    """Three bearings, gravity and six heavy segments: depth and 1 over the multiplier go with one another."""
    rig = with_keys(read_rig("mokhtar2017"), {"rotor.gravity": "9.81 m/s^2"})
    ring = LumpedStator(node=15, radius=0.06, count=6, mass=0.3, damping=300.0, stiffness=2e6)
    (found,) = branch(
        replace(overhung(rig), stator=(ring,)), along="clearance", start="0.612 mm", stop="0.53 mm",
        speed_ratio=1.25, friction=0.1, restitution=0.3, doublings=0, keep=(),
        initial={"from": "contact_free"}, most_points=40,
    )  # fmt: skip
    at = next(k for k, point in enumerate(found.points) if point.event == "grazing")
    behind = [point for point in found.points[at + 1 :] if point.touches == 1]
    assert len(behind) >= 2
    assert found.is_stable[: at + 1].all()
    past = np.array([point.value for point in behind]) - found.values[at]
    assert (past > 0.0).all()  # back to where nothing had to touch
    multipliers = np.array([abs(point.multipliers[0]) for point in behind])
    assert multipliers[0] > 10.0
    assert (np.diff(multipliers) < 0.0).all()
    assert multipliers[0] * past[0] == pytest.approx(multipliers[1] * past[1], rel=0.2)
