"""Motions of a damped oscillator with one impact in one, two and three periods, against closed forms.

Parameters other than those that Shaw and Holmes print: their windows of stability, doublings, folds, grazing.
"""

import math

import numpy as np
import pytest
from closed_form import Contact
from impact_orbit import amplitude, motions, quadratic
from lone_bodies import body, set_up_modal, tip
from scipy.optimize import brentq

from rubhpc import State
from rubhpc.integrate.branches.arclength import follow
from rubhpc.integrate.branches.branching import Branching
from rubhpc.integrate.branches.events import Event
from rubhpc.integrate.branches.search import search
from rubhpc.integrate.case import run_case
from rubhpc.integrate.periodic_motion import find_periodic_motion
from rubhpc.integrate.periodic_motions.family import Family
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.study.study import Recording

WALL_BODY = tip(body(1.0, 1.0, ((1, "axial"),)), 0.0, axial=-1)  # it is held
RECORDING = Recording(transient=0, samples_per_revolution=64, keep=())
SETTINGS = {1: (0.03, 0.0, 0.6), 2: (0.04, 0.02, 0.7), 3: (0.02, 0.0, 0.5)}  # damping, wall, restitution


def set_up(frequency, damping, restitution):
    oscillator = body(1.0, 1.0, ((1, "v"),), damping=2 * damping)
    return set_up_modal(
        oscillator, [WALL_BODY], frequency, 64, Contact(restitution=restitution), force=[1.0], step=1e-4
    )


def state_of(motion, offset=0.0):
    place, speed = motion.start
    return State(
        rotor_displacement=np.array([place + offset]), rotor_velocity=np.array([speed]),
        stator_displacement=(np.zeros(1),), stator_velocity=(np.zeros(1),), contact_force=np.zeros(1),
    )  # fmt: skip


class Oscillators(Family):
    """Over the frequency or the place of the wall."""

    def __init__(self, along, span, damping, wall, restitution, frequency=None):
        super().__init__(None, along, (0.0, span))
        self._rest, self._frequency, self._known = (damping, wall, restitution), frequency, {}

    def settings(self, value, *, is_measured=True):
        frequency = value if self.along == "speed" else self._frequency
        damping, wall, restitution = self._rest
        if frequency not in self._known:
            self._known[frequency] = set_up(frequency, damping, restitution)
        return self._known[frequency], wall if self.along == "speed" else value, 0.0

    def first(self, branching, value, motion, n):
        """The motion in closed form."""
        setup, clearance, friction = self.settings(value)
        piecewise = PiecewiseMotion(setup, clearance, friction, state_of(motion))
        return branching.begin(value, piecewise.start, piecewise.states, n)


def doubling(n):
    """Frequency above which the faster motion is unstable, with a multiplier of -1 there."""
    damping, wall, restitution = SETTINGS[n]

    def excess(frequency):
        found = motions(frequency, damping, wall, restitution, n)[0].multipliers
        return float(np.prod(1.0 + found).real)

    grid = np.arange(2 * n + 0.05, 2 * n + 2.0, 0.02)
    signs = np.sign([excess(w) for w in grid])
    i = int(np.flatnonzero(signs[1:] != signs[:-1])[0])
    return float(brentq(excess, grid[i], grid[i + 1], xtol=1e-13))


@pytest.mark.parametrize("n", SETTINGS)
@pytest.mark.parametrize("share", [0.5, 0.99, 1.01])
def test_motion_and_multipliers_are_those_of_the_closed_form(n, share):
    """Inside the window of stability, at its end, and beyond it."""
    damping, wall, restitution = SETTINGS[n]
    frequency = 2 * n + share * (doubling(n) - 2 * n)
    expected = motions(frequency, damping, wall, restitution, n)[0]
    assert expected.reach < wall
    found = find_periodic_motion(
        set_up(frequency, damping, restitution), clearance=wall, friction=0.0, period=n, repeat=1,
        recording=RECORDING, initial=state_of(expected),
    )  # fmt: skip
    assert found.period == n
    assert [event.kind for event in found.events] == ["touch"]
    assert found.events[0].approach == pytest.approx(expected.speed, abs=1e-8)
    assert found.events[0].time % (2 * math.pi / frequency) == pytest.approx(expected.time, abs=1e-8)
    moduli = [np.sort_complex(one) for one in (found.multipliers[:2], expected.multipliers)]
    assert moduli[0] == pytest.approx(moduli[1], abs=1e-6)
    assert found.is_stable == (share < 1.0)
    product = restitution**2 * math.exp(-2 * damping * 2 * math.pi * n / frequency)
    assert np.prod(expected.multipliers).real == pytest.approx(product, rel=1e-9)


@pytest.mark.parametrize("n", SETTINGS)
def test_period_doubles_where_the_closed_form_has_it(n):
    """The branch places it to 1e-8; simulations have n periods before it and 2 n behind it."""
    damping, wall, restitution = SETTINGS[n]
    there = doubling(n)
    start = there - 0.1
    family = Oscillators("speed", 0.2, damping, wall, restitution)
    branching = Branching(family, 0.02)
    first = family.first(branching, start, motions(start, damping, wall, restitution, n)[0], n)
    track = follow(branching, [first], 1.0, low=start, high=there + 0.1, most=40)
    (at,) = [k for k, event in enumerate(track.events) if event is Event.PERIOD_DOUBLING]
    assert track.points[at].value == pytest.approx(there, abs=2e-9)
    periods = []
    for beside in (-5e-3, 5e-3):
        frequency = there + beside
        motion = motions(frequency, damping, wall, restitution, n)[0]
        record = run_case(
            set_up(frequency, damping, restitution), clearance=wall, friction=0.0,
            initial=state_of(motion, 1e-3),
            recording=Recording(transient=1500, revolutions=32, samples_per_revolution=64, keep=()),
        )  # fmt: skip
        periods.append(record.measures["period"])
    assert periods == [n, 2 * n]


def test_a_branch_is_switched_at_the_doubling_of_shaw_and_holmes():
    """At w = 2.65334773 for e = 0.8 the multipliers are -1 and -e^2; two impacts a period lead on."""
    family = Oscillators("speed", 0.7, 0.0, 0.0, 0.8)
    branching = Branching(family, 0.05)
    first = family.first(branching, 2.2, motions(2.2, 0.0, 0.0, 0.8, 1)[0], 1)
    once, twice = search(branching, [first], low=2.1, high=2.7, most=100, doublings=1)
    (at,) = [k for k, event in enumerate(once.events) if event is Event.PERIOD_DOUBLING]
    point = once.points[at]
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


@pytest.mark.parametrize(("damping", "restitution", "frequency"), [(0.05, 0.6, 1.6), (0.02, 0.8, 1.8)])
def test_fold_and_grazing_over_the_wall_are_where_the_closed_form_has_them(damping, restitution, frequency):
    """The fold is where both roots are one; the slower motion ends where its speed vanishes."""
    free = amplitude(frequency, damping)

    def discriminant(wall):
        (a, b, c), _ = quadratic(frequency, damping, wall, restitution, 1)
        return b * b - 4 * a * c

    fold = brentq(discriminant, free, 10 * free, xtol=1e-14)
    family = Oscillators("clearance", 2 * fold, damping, None, restitution, frequency)
    branching = Branching(family, 0.05)
    first = family.first(branching, 0.5 * free, motions(frequency, damping, 0.5 * free, restitution, 1)[0], 1)
    track = follow(branching, [first], 1.0, low=0.4 * free, high=2 * fold, most=200)
    found = [
        (event.name, point.value) for event, point in zip(track.events, track.points, strict=True) if event
    ]
    assert [name for name, _ in found[:2]] == ["FOLD", "GRAZING"]
    assert found[0][1] == pytest.approx(fold, rel=1e-9)
    assert found[1][1] == pytest.approx(free, rel=1e-8)


def test_two_motions_meet_at_the_fold_and_graze_at_a_corner():
    """Without damping, in longer steps: the contact-free motion follows behind the corner."""
    w, e = 1.7, 0.7
    family = Oscillators("clearance", 2.0, 0.0, None, e, w)
    branching = Branching(family, 0.1)
    first = family.first(branching, 0.0, motions(w, 0.0, 0.0, e, 1)[0], 1)
    track = follow(branching, [first], 1.0, low=-0.1, high=2.0, most=100)
    events = [(event.name, point) for event, point in zip(track.events, track.points, strict=True) if event]
    assert [name for name, _ in events] == ["FOLD", "GRAZING", "END"]
    k, h = (1 + e) / (2 * math.tan(math.pi / w)), (1 - e) / (2 * w)
    assert events[0][1].value == pytest.approx(math.hypot(1, k / h) / (w**2 - 1), rel=1e-9)
    assert events[1][1].value == pytest.approx(1 / (w**2 - 1), rel=1e-8)
    assert track.end == "the range ends"
    for found in track.points:
        speeds = [speed for r in found.revolutions for piece in r.pieces for speed in piece.approach]
        if len(speeds) == 1:
            assert (found.value + k * speeds[0]) ** 2 + (h * speeds[0]) ** 2 == pytest.approx(
                (1 - w**2) ** -2
            )
            # Entries of the matrix are right to some roundings, which grow as 1 / speed.
            a, b, c, d = found.monodromy.ravel()
            rounding = 16 * np.finfo(float).eps * (abs(a * d) + abs(b * c))
            assert a * d - b * c == pytest.approx(e**2, abs=rounding, rel=0.0)
