"""Events on a branch, located and named: folds, doublings of the period, second frequencies, grazing."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.shooting import NotConverged

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.branch_point import Branching, Point

    Floats = NDArray[np.float64]
    Predictor = Callable[[Branching, list[Point], float], tuple[Floats, Floats]]

LOCATED = 1e-9  # of the range: how near to an event its point is
REAL = 1e-6  # imaginary part of a multiplier that is taken for a real one
SAME_PLACE = 1e-6  # share of a step within which two multipliers leave together
APPROACH = 0.1  # of its distance to grazing that a trial leaves
MOST_TRIALS, MOST_SECANTS = 40, 8
CLOSE = 1e-4  # steps before a grazing at which its point may lie
BESIDE = (
    1e-3,
    1e-2,
    0.1,
)  # shares of a step from a grazing, at which the motion with more contacts is sought
WITHIN_REACH = 3.0  # steps, in which a distance to grazing would vanish


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
    """Locate where multipliers cross the unit circle between two points with the same contacts, in order.

    The m-th largest modulus is a continuous function along the branch; its distance from 1 vanishes there.
    """
    if a is b or a.sequence != b.sequence:
        return
    change = branching.difference(a, b)
    length = float(np.linalg.norm(change))

    def at(share: float) -> Point:
        if share <= 0.0:
            return a
        if share >= 1.0:
            return b
        return branching.correct(a, share * change, change / length)

    from scipy.optimize import brentq  # 0.2 s to load, and a run without branches needs it nowhere

    found: list[tuple[float, Event, Point]] = []
    for rank in range(*sorted((a.n_unstable, b.n_unstable))):
        points: dict[float, Point] = {}

        def excess(share: float, rank: int = rank, points: dict[float, Point] = points) -> float:
            points[share] = at(share)
            return float(abs(points[share].multipliers[rank]) - 1.0)

        tolerance = _share(branching, a, b)
        try:
            share = brentq(excess, 0.0, 1.0, xtol=tolerance, rtol=1e-14)
        except (NotConverged, ValueError):
            continue  # a multiplier that leaves through infinity: a contact grazes
        point = points[share] if share in points else at(share)
        if all(abs(share - other) > SAME_PLACE for other, *_ in found):
            found.append((share, _kind(point, rank, a, b), point))
    yield from ((event, point) for _, event, point in sorted(found, key=lambda one: one[0]))


def _share(branching: Branching, a: Point, b: Point) -> float:
    """How much of the way between two points an event may be off; at a fold the value hardly changes."""
    change = max(abs(b.value - a.value), 1e-3 * branching.step)
    return float(min(LOCATED * branching.family.span / change, 1e-6))


def _kind(point: Point, rank: int, a: Point, b: Point) -> Event:
    multiplier = point.multipliers[rank]
    if abs(multiplier.imag) > REAL:
        return Event.NEIMARK_SACKER
    if multiplier.real < 0.0:
        return Event.PERIOD_DOUBLING
    is_extreme = (point.value - a.value) * (point.value - b.value) > 0.0
    return Event.FOLD if is_extreme else Event.BRANCH_POINT


def distances(point: Point) -> Floats:
    """Distances to grazing: least gaps and speeds of approach over those of a whirl in the gap; forces, N."""
    gap = np.min([revolution.least_gap for revolution in point.revolutions], axis=0)
    force = np.min([revolution.least_force for revolution in point.revolutions], axis=0)
    approach = [speed for r in point.revolutions for piece in r.pieces for speed in piece.approach.tolist()]
    clearance = np.maximum(point.case.bodies.clearance, np.finfo(float).tiny)
    whirl = abs(point.case.setup.spin) * float(clearance.max())
    return np.concatenate([gap / clearance, force, np.array(approach) / whirl])


def reach(branching: Branching, before: Point, point: Point) -> float:
    """Length, in steps, after which a distance to grazing vanishes if all go on as between two points."""
    was, now = distances(before), distances(point)
    length = float(np.linalg.norm(branching.difference(before, point)))
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead = np.where(np.isfinite(was) & np.isfinite(now) & (now < was), now / (was - now), np.inf)
    return float(ahead.min()) * length


def grazing(branching: Branching, history: list[Point], predict: Predictor) -> Point | None:
    """Approach the grazing ahead of some points; returns the last motion before it, None where there is none.

    Every trial leaves a tenth of the distance that is left, as the points before have it. The contacts must
    stay as they are: the derivative is unbounded on the other side.
    """
    if len(history) < 2 or history[-2].sequence != history[-1].sequence:
        return None
    ahead = reach(branching, *history[-2:])
    if ahead > WITHIN_REACH:
        return None
    left = APPROACH
    for _ in range(MOST_TRIALS):
        guess, along = predict(branching, history[-3:], (1.0 - left) * ahead)
        try:
            trial = branching.correct(history[-1], guess, along)
        except NotConverged:
            trial = None
        if trial is None or trial.sequence != history[-1].sequence:
            left = 0.5 * (1.0 + left)
            if left > 0.99:
                return None
            continue
        change = branching.difference(history[-1], trial)
        rate = abs(change[-1]) * branching.step / float(np.linalg.norm(change))
        history = [*history[-2:], trial]
        ahead = reach(branching, *history[-2:])
        if ahead < CLOSE and ahead * rate < LOCATED * branching.family.span:
            return trial
        if not ahead < WITHIN_REACH:
            return None
        left = APPROACH
    return None


def halving(branching: Branching, a: Point, b: Point) -> Point | None:
    """Locate the motion of half the period that a branch passes between two points; None where it is lost.

    It is followed on the branch of that motion to where a multiplier is -1: there it is regular.
    """
    change, was, now = branching.difference(a, b), half_change(a), half_change(b)
    share = float(was @ was / (was @ was - now @ was))
    held = np.zeros(change.size)
    held[-1] = 1.0
    try:
        points = [branching.correct(a, share * change, held, period=a.period // 2)]
        values = [_above_minus_one(points[0])]
        move = 0.1 * float(np.linalg.norm(change))
        for _ in range(MOST_SECANTS):
            points.append(branching.correct(points[-1], move * held, held))
            values.append(_above_minus_one(points[-1]))
            if values[-1] == values[-2] or abs(move) * branching.step < LOCATED * branching.family.span:
                break
            move *= -values[-1] / (values[-1] - values[-2])
    except NotConverged:
        return None
    return branching.repeated(points[-1], a.period // points[-1].period)


def _above_minus_one(point: Point) -> float:
    """Distance from -1 of the multiplier that is nearest to it."""
    return float(point.multipliers[np.argmin(np.abs(point.multipliers + 1.0))].real + 1.0)


def half_change(point: Point) -> Floats:
    """What half its period changes in a motion (2 n,)."""
    return np.asarray(point.revolutions[point.period // 2 - 1].end - point.motion)


class Grazing(NamedTuple):
    """Motions on both sides of a grazing."""

    point: Point  # with fewer contacts
    beyond: Point  # with more, as near as it was found


def grazing_between(branching: Branching, a: Point, b: Point) -> Grazing | None:
    """Locate the grazing between two points with one contact more or less.

    On the side with fewer contacts the least gap falls linearly to zero, along which it is sought; else the
    place is halved.
    """
    change = branching.difference(a, b)
    if len(a.sequence) == len(b.sequence):
        return None  # other contacts overlap than before
    direction, is_first_free = change / np.linalg.norm(change), len(a.sequence) < len(b.sequence)
    tolerance = _share(branching, a, b)
    ends = {a.sequence: 0.0, b.sequence: 1.0}
    free: list[tuple[float, Point]] = [(0.0, a) if is_first_free else (1.0, b)]
    root = None

    def impacting(at: float) -> Point:
        """The motion with more contacts that is nearest to the grazing."""
        end, other = (1.0, b) if is_first_free else (0.0, a)
        for part in BESIDE:
            try:
                found = branching.correct(a, (at + part * (end - at)) * change, direction)
            except NotConverged:
                continue
            if found.sequence == other.sequence:
                return found
        return other

    for _ in range(MOST_TRIALS):
        near, far = free[-1][0], ends[b.sequence if is_first_free else a.sequence]
        root = _root(free) or root  # a gap of rounding is not seen any more
        if root is None or not min(near, far) < root < max(near, far):
            share = 0.5 * (near + far)
        elif abs(root - near) < tolerance:
            return Grazing(free[-1][1], impacting(near))
        else:
            share = root + APPROACH * (near - root)
        if abs(near - far) < tolerance:
            return Grazing(free[-1][1], impacting(near))
        try:
            trial = branching.correct(a, share * change, direction)
        except NotConverged:
            trial = None
        if trial is not None and trial.sequence == free[0][1].sequence:
            free = [free[-1], (share, trial)]
        else:
            ends[b.sequence if is_first_free else a.sequence] = share
    return None


def _root(free: list[tuple[float, Point]]) -> float | None:
    """Where the first least gap or force vanishes that falls from one point to the next."""
    if len(free) < 2:
        return None
    (x, before), (y, point) = free
    n = 2 * point.case.q
    was, now = distances(before)[:n], distances(point)[:n]
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead = np.where(np.isfinite(was) & np.isfinite(now) & (now < was), now / (was - now), np.inf)
    return float(y + (y - x) * ahead.min()) if np.isfinite(ahead.min()) else None
