"""Pairs of events within one step, on curves in a plane that stand for a branch and are known."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from rubhpc.integrate.branches import grazing
from rubhpc.integrate.branches.arclength import Track
from rubhpc.integrate.branches.events import Event
from rubhpc.integrate.branches.search import refined
from rubhpc.integrate.periodic_motions.shooting import NotConverged
from rubhpc.integrate.periodic_motions.tolerances import TO_ROUNDING


class Curve:
    """A branch of motions x at the parameter value(x), with one multiplier and one gap that closes or not."""

    step = 1.0

    def __init__(self, value, multiplier=lambda x: 0.5, gap=lambda x: np.inf):
        self._value, self._multiplier, self._gap = value, multiplier, gap
        self.family = SimpleNamespace(span=1.0)
        self.n_corrected = 0

    def point(self, x):
        gap, multiplier = self._gap(x), self._multiplier(x)
        events = ((0, (0,)), (1, ())) if gap < 0.0 else ((0, ()),)
        least = np.array([gap if gap > 0.0 else np.inf])
        return SimpleNamespace(
            value=float(self._value(x)), phase=0.0, period=1, motion=np.array([x]), sequence=events,
            multipliers=np.array([multiplier], dtype=complex), n_unstable=int(abs(multiplier) > 1.0),
            may_fold=False, staying_closed=np.full((2, 1), np.inf),
            revolutions=[SimpleNamespace(least_gap=least, least_force=np.array([np.inf]))],
            pieces=[],
            case=SimpleNamespace(
                q=1, bodies=SimpleNamespace(clearance=np.ones(1)),
                setup=SimpleNamespace(spin=1.0, model=SimpleNamespace(stators=())),
                tolerances=TO_ROUNDING,
            ),
        )  # fmt: skip

    def located(self, point):
        return point.case.tolerances.located

    def difference(self, a, b):
        return np.array([b.motion[0] - a.motion[0], b.value - a.value])

    def correct(self, base, guess, along, *, is_free=False, in_plane=0.0):
        self.n_corrected += 1
        at = base.motion[0]

        def apart(x):
            return along @ (np.array([x - at, self._value(x) - base.value]) - guess)

        reach = 1.5 * max(abs(guess[0]), 1e-9)
        try:
            return self.point(brentq(apart, at - reach, at + reach, xtol=1e-15))
        except ValueError:
            raise NotConverged("none") from None


def events_of(curve, xs):
    points = [curve.point(x) for x in xs]
    track = Track(points=points, events=[Event.NONE] * len(points), end="")
    found = refined(curve, track, most=200)
    assert len(found.points) == len(found.events)
    order = [point.motion[0] for point in found.points]
    assert order == sorted(order)
    return [(e.name, p.value) for e, p in zip(found.events, found.points, strict=True) if e]


def test_two_folds_within_a_step_are_found():
    """Of value = x^3 - 0.03 x, at x = -0.1 and 0.1, where the multiplier 1 - 0.8 dvalue/dx is 1."""
    curve = Curve(lambda x: x**3 - 0.03 * x, lambda x: 1.0 - 0.8 * (3.0 * x**2 - 0.03))
    events = events_of(curve, [-0.6, -0.4, 0.35, 0.6])
    assert events == [("FOLD", pytest.approx(0.002, rel=1e-6)), ("FOLD", pytest.approx(-0.002, rel=1e-6))]


def test_two_grazings_within_a_step_are_found(monkeypatch):
    """The gap x^2 - 0.01 closes from -0.1 to 0.1."""

    def none(*_):
        raise NotConverged

    monkeypatch.setattr(grazing, "weakly_impacting", none)  # these points have no flow
    curve = Curve(lambda x: x, gap=lambda x: x**2 - 0.01)
    events = events_of(curve, [-0.9, -0.5, 0.4, 0.8])
    assert events == [("GRAZING", pytest.approx(-0.1, abs=1e-8)), ("GRAZING", pytest.approx(0.1, abs=1e-8))]


def test_two_doublings_within_a_step_are_found():
    """The multiplier -1.05 + x^2 is beyond -1 between the roots of 0.05."""
    curve = Curve(lambda x: x, lambda x: -1.05 + x**2)
    events = events_of(curve, [-0.9, -0.6, 0.5, 0.8])
    assert Counter(name for name, _ in events) == {"PERIOD_DOUBLING": 2}
    assert [value for _, value in events] == pytest.approx([-(0.05**0.5), 0.05**0.5], abs=1e-8)


def test_a_step_that_hides_nothing_is_left():
    """A gap and a multiplier that turn well before anything happens cost no motion."""
    curve = Curve(lambda x: x, lambda x: -0.7 + 0.1 * x**2, lambda x: 0.5 + x**2)
    assert events_of(curve, [-0.9, -0.5, 0.5, 0.9]) == []
    assert curve.n_corrected == 0
