"""Branches of periodic motions against answers in closed form.

The impact oscillator x'' + x = cos w t with a wall at s and restitution e (Shaw and Holmes 1983): a motion
with one impact of speed V a period T satisfies

    (s + k V)^2 + (h V)^2 = 1 / (1 - w^2)^2,    k = (1 + e) / (2 tan(T / 2)),    h = (1 - e) / (2 w),

so that over s two motions meet at a fold at s^2 = (1 + (k / h)^2) / (1 - w^2)^2.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from lone_bodies import body, set_up_modal, tip

import rubhpc
from rubhpc import LumpedStator, Rig, Unbalance, read_rig
from rubhpc.integrate.branches.arclength import follow
from rubhpc.integrate.branches.branching import Branching
from rubhpc.integrate.branches.events import Event
from rubhpc.integrate.branches.search import search
from rubhpc.integrate.periodic_motion import find_periodic_motion
from rubhpc.integrate.periodic_motions.family import Family
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.setup import prepare
from rubhpc.study.initial import Initial
from rubhpc.study.study import Contact, Integrator, Recording

WALL = tip(body(1.0, 1.0, ((1, "axial"),)), 0.0, axial=-1)  # it is held


class Oscillators(Family):
    """Of one frequency or one wall, and a restitution."""

    def __init__(self, along, span, frequency, restitution):
        super().__init__(None, along, (0.0, span))
        self._frequency, self._restitution, self._known = frequency, restitution, {}

    def settings(self, value, *, is_measured=True):
        frequency = value if self.along == "speed" else self._frequency
        if frequency not in self._known:
            self._known[frequency] = set_up_modal(
                body(1.0, 1.0, ((1, "v"),)), [WALL], frequency, 64, Contact(restitution=self._restitution),
                force=[1.0], step=1e-4,
            )  # fmt: skip
        return self._known[frequency], value if self.along == "clearance" else 0.0, 0.0

    def first(self, branching, value):
        """The motion that a simulation from rest leads to."""
        setup, clearance, friction = self.settings(value)
        recording = Recording(transient=30, samples_per_revolution=64, keep=())
        found = find_periodic_motion(
            setup, clearance=clearance, friction=friction, period=1, repeat=1, recording=recording,
            initial=Initial(),
        )  # fmt: skip
        piecewise = PiecewiseMotion(setup, clearance, friction, found.state)
        return branching.begin(value, piecewise.start, piecewise.states, 1)


def events(track):
    return [(Event(e).name, p) for p, e in zip(track.points, track.events, strict=True) if e]


def impacts(point):
    return [speed for r in point.revolutions for piece in r.pieces for speed in piece.approach]


def test_period_doubles_where_the_closed_form_has_it_and_the_branch_is_switched():
    """At w = 2.65334773 for e = 0.8 the multipliers are -1 and -e^2; two impacts a period lead on."""
    family = Oscillators("speed", 0.7, None, 0.8)
    branching = Branching(family, 0.05)
    once, twice = search(branching, [family.first(branching, 2.2)], low=2.1, high=2.7, most=100, doublings=1)
    (name, point) = next(one for one in events(once) if one[0] != "END")
    assert name == "PERIOD_DOUBLING"
    assert point.value == pytest.approx(2.65334773, abs=1e-8)
    assert point.multipliers == pytest.approx(np.array([-1.0, -0.64]), abs=1e-8)
    assert next(p.n_unstable for p in once.points if p.value > 2.66) == 1
    assert twice.points[0].value == pytest.approx(point.value, abs=1e-12)
    assert {p.period for p in twice.points} == {2}
    assert twice.points[3].n_unstable == 0
    approach = [
        piece.approach[0] for r in twice.points[3].revolutions for piece in r.pieces if piece.crossing
    ]
    assert len(approach) == 2
    assert abs(approach[0] - approach[1]) > 1e-3


def test_two_motions_meet_at_the_fold_of_the_closed_form():
    w, e = 1.7, 0.7
    family = Oscillators("clearance", 2.0, w, e)
    branching = Branching(family, 0.1)
    track = follow(branching, [family.first(branching, 0.0)], 1.0, low=-0.1, high=2.0, most=100)
    k, h = (1 + e) / (2 * math.tan(math.pi / w)), (1 - e) / (2 * w)
    name, point = events(track)[0]
    assert name == "FOLD"
    assert point.value == pytest.approx(math.hypot(1, k / h) / (w**2 - 1), rel=1e-9)
    with_one = [found for found in track.points if len(impacts(found)) == 1]
    for found in with_one:
        (speed,) = impacts(found)
        assert (found.value + k * speed) ** 2 + (h * speed) ** 2 == pytest.approx((1 - w**2) ** -2, rel=1e-9)
        # Each number of the matrix is right to some roundings; those grow as 1/speed, and the determinant is
        # a difference of their products: nothing else is lost, up to 7e-5 m/s from grazing.
        a, b, c, d = found.monodromy.ravel()
        rounding = 16 * np.finfo(float).eps * (abs(a * d) + abs(b * c))
        assert a * d - b * c == pytest.approx(e**2, abs=rounding, rel=0.0)
    assert [with_one[0].n_unstable, with_one[-1].n_unstable] == [0, 1]
    # Then it grazes at the contact-free amplitude, a corner from which both sides rise.
    assert [name for name, _ in events(track)] == ["FOLD", "GRAZING", "END"]
    assert events(track)[1][1].value == pytest.approx(1 / (w**2 - 1), rel=1e-8)
    assert track.end == "the range ends"


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
            self._known[value] = prepare(
                rig, 2.0, contact=Contact(), integrator=Integrator(step=1e-3), samples_per_revolution=64
            )
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
    (found,) = rubhpc.branch(
        ring, along="clearance", start="240 um", stop="420 um", largest_step="40 um", transient=40, **case
    )
    kinds = [name for name, _ in found.events() if name != "grazing"]
    free = rubhpc.periodic(ring, clearance=1e-3, keep=(), **case).record.contact_free_amplitude
    assert kinds == ["fold", "fold"]
    assert found.events()[-1][1] == pytest.approx(free, rel=3e-6)  # that of the full model
    assert [point.touches for point in (found.points[0], found.points[-1])] == [8, 0]
    lowest, highest = (found.values[[p.event == "fold" for p in found.points]][k] for k in (1, 0))
    assert lowest < free < highest


@pytest.mark.long
def test_ring_of_springs_over_its_speed():
    """In closed form the rub ends at a fold at r 1.343, and the motion without contact grazes at 1.195."""
    springs = LumpedStator(node=8, radius=0.06, count=8, mass=1e-3, damping=2.0, stiffness=1e5)
    ring = replace(read_rig("mokhtar2017"), stator=(springs,))
    (whole,) = rubhpc.branch(
        ring, along="speed_ratio", start=1.17, stop=1.4, clearance="300 um", friction=0.0, keep=()
    )
    folds = [value for name, value in whole.events() if name == "fold"]
    assert max(folds) == pytest.approx(1.343, rel=6e-3)  # eight springs, not a ring: 1.337
    assert whole.events()[-1][0] == "grazing"
    assert whole.events()[-1][1] == pytest.approx(1.195, abs=1e-3)


@pytest.mark.long
@pytest.mark.parametrize(
    ("count", "along", "start", "stop", "largest", "case", "step"),
    [
        (5, "clearance", 200e-6, 300e-6, 10e-6, {"friction": 0.05}, 2e-7),
        (16, "clearance", 300e-6, 900e-6, 60e-6, {"friction": 0.0}, 1e-6),
        (5, "friction", 0.0, 0.2, 0.02, {"clearance": 240e-6}, 5e-4),
    ],
)
def test_rub_on_a_ring_ends_in_a_sweep_where_its_branch_folds(count, along, start, stop, largest, case, step):
    """Up in steps across the first fold: the same motion up to it, another one from there on."""
    springs = LumpedStator(node=8, radius=0.06, count=count, mass=1e-3, damping=2.0, stiffness=1e5)
    ring = replace(read_rig("mokhtar2017"), stator=(springs,))
    case = {"speed_ratio": 1.25, **case}
    found = rubhpc.branch(
        ring, along=along, start=start, stop=stop, largest_step=largest, transient=40, doublings=0, keep=(),
        **case,
    )[0]  # fmt: skip
    at = next(k for k, point in enumerate(found.points) if point.event == "fold")
    assert found.is_stable[:at].all()
    final, orbits = found.points[at - 1].state, []
    for value in found.values[at] + step * np.array([-2.5, -1.5, -0.5, 0.5]):
        record = rubhpc.simulate(
            ring, transient=2000, revolutions=1, initial=final, keep=("waveform",),
            **(case | {along: float(value)}),
        )  # fmt: skip
        final = record.final
        orbits.append([record.vertical, record.horizontal])
    changes = np.linalg.norm(np.diff(orbits, axis=0), axis=(1, 2))
    assert changes[2] > 4 * changes[:2].max()


def test_overhung_disc_on_three_bearings_grazes_at_its_contact_free_amplitude():
    """Before, the motion with one impact a revolution doubles its period."""
    rig = read_rig("mokhtar2017")
    first, last = rig.rotor.bearing
    rotor = replace(
        rig.rotor,
        bearing=(first, replace(last, node=6), replace(last, node=11)),
        disc=(replace(rig.rotor.disc[0], node=15),),
        unbalance=(replace(rig.rotor.unbalance[0], node=15),),
    )
    overhung = replace(rig, rotor=rotor, stator=(replace(rig.stator[0], node=15),))
    (found,) = rubhpc.branch(
        overhung, along="clearance_ratio", start=0.9, stop=1.05, speed_ratio=0.8, friction=0.2, doublings=0,
        keep=(),
    )  # fmt: skip
    names = [name for name, _ in found.events()]
    assert names == ["period_doubling", "grazing"]
    assert found.events()[1][1] == pytest.approx(1.0, rel=1e-5)  # that of the full model
    assert [found.is_stable[0], found.is_stable[-1]] == [False, True]
