"""Events on a branch, located and named by the multipliers: folds, doublings, second frequencies."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.branches.point import REAL
from rubhpc.integrate.periodic_motions.shooting import NotConverged

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point

    Floats = NDArray[np.float64]

NARROW = 1e3  # share of a step, over the tolerance as a share of the range, in which two places are the same
ALONG = 0.9  # share of the parameter in a step above which it may be held
JUMP = 1e-3  # of the distance from the unit circle at both ends that is left at a crossing
MOST_SECANTS = 8


class Event(IntEnum):
    """What happens at a point of a branch."""

    NONE = 0
    FOLD = 1
    PERIOD_DOUBLING = 2
    NEIMARK_SACKER = 3
    GRAZING = 4
    END = 5
    BRANCH_POINT = 6


def crossings(branching: Branching, a: Point, b: Point) -> Iterator[tuple[Event, Point]]:
    """Locate where multipliers cross the unit circle between two points with as many contacts, in order.

    The m-th largest modulus is a continuous function along the branch; its distance from 1 vanishes there.
    """
    if a is b or len(a.sequence) != len(b.sequence):
        return
    change = -branching.difference(b, a)  # in the coordinates of the first
    length = float(np.linalg.norm(change))
    n_both = min(a.multipliers.size, b.multipliers.size)  # one may have further, well damped coordinates
    was, now = (np.abs(point.multipliers[:n_both]) - 1.0 for point in (a, b))
    has_left = (was * now < 0.0) & (np.minimum(np.abs(was), np.abs(now)) > a.case.tolerances.left)
    ranks: list[int] = np.flatnonzero(has_left).tolist()
    may_fold = any(_is_real(point.multipliers[rank]) for point in (a, b) for rank in ranks)
    is_free = may_fold or abs(change[-1]) < ALONG * length

    def at(share: float) -> Point:
        if share <= 0.0:
            return a
        if share >= 1.0:
            return b
        return branching.correct(a, share * change, change / length, is_free=is_free)

    from scipy.optimize import brentq  # takes 0.2 s to load; only branches need it

    found: list[tuple[float, Event, Point]] = []
    for rank in ranks:
        points: dict[float, Point] = {}

        def excess(share: float, rank: int = rank, points: dict[float, Point] = points) -> float:
            points[share] = at(share)
            return float(abs(points[share].multipliers[rank]) - 1.0)

        try:
            share = brentq(excess, 0.0, 1.0, xtol=tolerance_of(branching, a, b), rtol=1e-14)
            point = points[share] if share in points else at(share)
        except (NotConverged, ValueError):
            continue  # a multiplier that leaves through infinity: a contact grazes
        is_root = abs(abs(point.multipliers[rank]) - 1.0) < JUMP * (abs(was[rank]) + abs(now[rank]))
        if is_root and all(abs(share - other) > NARROW * a.case.tolerances.located for other, *_ in found):
            found.append((share, kind_of(point, rank, a, b), point))
    yield from ((event, point) for _, event, point in sorted(found, key=lambda one: one[0]))


def tolerance_of(branching: Branching, a: Point, b: Point) -> float:
    """Tolerance of an event, as a share of the way between two points; at a fold the value hardly changes."""
    change = max(abs(b.value - a.value), 1e-3 * branching.step)
    return float(min(branching.located(a) / change, NARROW * a.case.tolerances.located))


def _is_real(multiplier: complex) -> bool:
    """Whether a multiplier is real and positive, as at a fold."""
    return bool(abs(multiplier.imag) <= REAL and multiplier.real > 0.0)


def kind_of(point: Point, rank: int, a: Point, b: Point) -> Event:
    """Kind of event at a point between two others, where the multiplier of a rank crosses the unit circle."""
    multiplier = point.multipliers[rank]
    if abs(multiplier.imag) > REAL:
        return Event.NEIMARK_SACKER
    if multiplier.real < 0.0:
        return Event.PERIOD_DOUBLING
    is_extreme = (point.value - a.value) * (point.value - b.value) > 0.0
    return Event.FOLD if is_extreme else Event.BRANCH_POINT


def halving(branching: Branching, a: Point, b: Point) -> Point | None:
    """Locate the motion of half the period that a branch passes between two points; None if it is not found.

    It is sought on the branch of half the period, where a multiplier is -1: the problem is regular there.
    """
    change, was, now = branching.difference(a, b), half_change(a), half_change(b)
    share = float(was @ was / (was @ was - now @ was))
    held = a.parameter_axis
    try:
        points = [branching.correct(a, share * change, held, period=a.period // 2)]
        values = [_above_minus_one(points[0])]
        move = 0.1 * float(np.linalg.norm(change))
        for _ in range(MOST_SECANTS):
            points.append(branching.correct(points[-1], move * held, held))
            values.append(_above_minus_one(points[-1]))
            if values[-1] == values[-2] or abs(move) * branching.step < branching.located(a):
                break
            move *= -values[-1] / (values[-1] - values[-2])
    except NotConverged:
        return None
    return branching.repeated(points[-1], a.period // points[-1].period)


def _above_minus_one(point: Point) -> float:
    """Distance from -1 of the multiplier that is nearest to it."""
    return float(point.multipliers[np.argmin(np.abs(point.multipliers + 1.0))].real + 1.0)


def half_change(point: Point) -> Floats:
    """Change of a motion (2 n,) over half its period."""
    return np.asarray(point.revolutions[point.period // 2 - 1].end - point.motion)


def has_halved(point: Point) -> bool:
    """Whether a motion has half the period that it is followed with."""
    if point.period % 2:
        return False
    return bool(
        np.linalg.norm(half_change(point)) <= point.case.tolerances.same * point.case.size(point.motion)
    )
