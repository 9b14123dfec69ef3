"""Grazing on a branch: where a contact appears or vanishes, between two points or ahead of them."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.branches.branching import STEEP
from rubhpc.integrate.branches.events import Event, crossings, tolerance_of
from rubhpc.integrate.branches.weak_impact import DEPTH, weakly_impacting
from rubhpc.integrate.marches.collocation import code_of, states_of
from rubhpc.integrate.periodic_motions.revolution import least_of
from rubhpc.integrate.periodic_motions.shooting import NotConverged
from rubhpc.kernels.collocation.structures import FORWARD, OPEN

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point

    Floats = NDArray[np.float64]
    Predictor = Callable[[Branching, list[Point], float], tuple[Floats, Floats]]

APPROACH = 0.1  # of the distance to grazing that a trial leaves
LOOK = 0.05  # of the way to a motion beyond a grazing: first trial, for the slope of the gap
NEXT_TO = 0.01  # of the way, within which a motion beyond a grazing is next to it
HOPELESS, STILL = 0.01, 0.3  # of the way that is left, and of the gap: it falls smoothly
CERTAIN = 3.0  # times the error of a secant, by which a trial stays short of its root
MISPLACED = 1e-4  # of its length, allowed deviation of a trial
MOST_TRIALS = 40
CLOSE = 1e-4  # steps before a grazing at which its point may lie
BESIDE = 1e-3, 1e-2, 0.1  # shares of a step from a grazing, at which the motion with more contacts is sought
MISSED = 1e-4  # of a step, or of a gap, that may be left where it is taken to vanish
MEETING, NEIGHBOURS = 0.5, 2.0  # of a step, within which the motions on both sides of a grazing lie
SLOW = 1e-9  # of a whirl in the gap, speed of approach of a motion along the wall of a bore
OUTWARD = 1.001  # times a motion in a bore: surely pressed against it
WITHIN_REACH = 3.0  # steps, in which a distance to grazing would vanish


def passed(
    branching: Branching, a: Point, b: Point, *, is_last: bool = False
) -> list[tuple[Event, Point]] | None:
    """Events between two points of a branch, in order; None where b does not follow from a.

    A contact appears or vanishes at a grazing, where both motions coincide. Where several contacts change the
    points must be nearer, unless it `is_last`: by symmetry several may graze at once.
    """
    if a.sequence == b.sequence:
        return list(crossings(branching, a, b))
    was, now = touches(a), touches(b)
    n_changed = (was - now).total() + (now - was).total()
    if n_changed == 0:
        return list(crossings(branching, a, b))  # other contacts overlap than before
    if n_changed > 1 and not is_last:
        return None
    reach_of_sides = NEIGHBOURS if is_last else MEETING
    nearest = reach_of_sides * np.linalg.norm(branching.difference(a, b))
    for locate in (grazing_between, grazing_beside):
        graze = locate(branching, a, b)
        if graze is None:
            continue
        sides = [graze.point, graze.beyond]
        if touches(graze.point) != touches(a):
            sides.reverse()
        if np.linalg.norm(branching.difference(*sides)) <= nearest:
            return [
                *crossings(branching, a, sides[0]),
                (Event.GRAZING, graze.point),
                *crossings(branching, sides[1], b),
            ]
    return None


def touches(point: Point) -> Counter[int]:
    """Touches of each pair in a period; one of a bore that it fills."""
    found = Counter(pair for _, touching in point.sequence for pair in touching)
    found.update({i: 1 - found[i] for i in filled(point)})
    return found


def filled(point: Point) -> list[int]:
    """Bores that a motion touches all around: it never leaves their wall, or comes back without a speed."""
    bores = [i for i, stator in enumerate(point.case.setup.model.stators) if stator.is_bore]
    if not bores:
        return []
    is_closed = np.array([states_of(code, point.case.q) != OPEN for code, _ in point.sequence])
    leaves = np.any(is_closed[:-1] & ~is_closed[1:], axis=0)
    speed = np.zeros(point.case.q)
    for piece in point.pieces:
        speed[piece.touching] = np.maximum(speed[piece.touching], piece.approach)
    slow = SLOW * abs(point.case.setup.spin) * point.case.bodies.clearance
    return [i for i in bores if is_closed[:, i].any() and (not leaves[i] or speed[i] < slow[i])]


def closed_around(point: Point) -> list[Point]:
    """Starts of motions that press against a bore all around, one for each that this motion never touches."""
    q, touched = point.case.q, touches(point)
    free = [i for i, stator in enumerate(point.case.setup.model.stators) if stator.is_bore and not touched[i]]
    pressed = [point.states | code_of(FORWARD * (np.arange(q) == i)) for i in free]
    return [replace(point, motion=OUTWARD * point.motion, states=states) for states in pressed]


def distances(point: Point) -> Floats:
    """Distances to grazing: least gaps and speeds of approach over those of a whirl in the gap; forces, N."""
    gap, force = least_of(point.revolutions)
    approach = [speed for piece in point.pieces for speed in piece.approach.tolist()]
    clearance = np.maximum(point.case.bodies.clearance[: gap.size], np.finfo(float).tiny)
    whirl = abs(point.case.setup.spin) * float(clearance.max())
    return np.concatenate([gap / clearance, force, np.array(approach) / whirl])


def reach(branching: Branching, before: Point, point: Point) -> float:
    """Length, in steps, after which a distance to grazing vanishes, extrapolated from two points."""
    was, now = distances(before), distances(point)
    length = float(np.linalg.norm(branching.difference(before, point)))
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead = np.where(np.isfinite(was) & np.isfinite(now) & (now < was), now / (was - now), np.inf)
    return float(ahead.min()) * length


def grazing(branching: Branching, history: list[Point], predict: Predictor) -> Point | None:
    """Approach the grazing ahead of some points; returns the last motion before it, None where there is none.

    Every trial leaves a tenth of the remaining distance, extrapolated from the points before. The contacts
    must stay the same: the derivative is unbounded on the other side.
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
        if ahead < CLOSE and ahead * rate < branching.located(trial):
            return trial
        if not ahead < WITHIN_REACH:
            return None
        left = APPROACH
    return None


class Grazing(NamedTuple):
    """Motions on both sides of a grazing."""

    point: Point  # with fewer contacts
    beyond: Point  # with more contacts, as near as one was found


def grazing_between(branching: Branching, a: Point, b: Point) -> Grazing | None:
    """Locate the grazing between two points that differ by one contact.

    On the side with fewer contacts the least gap falls smoothly to zero, and secants are used; else
    bisection. None where that side ends before the gap vanishes, for example at a near fold.
    """
    change = branching.difference(a, b)
    n_touch = [touches(point).total() for point in (a, b)]
    if n_touch[0] == n_touch[1]:
        return None
    direction, is_first_free = change / np.linalg.norm(change), n_touch[0] < n_touch[1]
    tolerance, measure = tolerance_of(branching, a, b), change
    if abs(direction[-1]) > STEEP and not a.may_fold and not b.may_fold:
        measure = np.append(np.zeros(change.size - 1), change[-1])  # lengths are measured by the parameter
    first, other = (a, b) if is_first_free else (b, a)
    far = 1.0 if is_first_free else 0.0  # place of a motion with more contacts, or where none was found
    free: list[tuple[float, Point]] = [(1.0 - far, first)]
    impacts: list[tuple[float, Point]] = []
    root, error, missing = None, np.inf, np.inf

    def impacting(at: float) -> Point:
        """The motion with more contacts that is nearest to the grazing."""
        if impacts and abs(impacts[-1][0] - at) <= NEXT_TO:
            return impacts[-1][1]
        end, depth = 1.0 if is_first_free else 0.0, DEPTH
        most = MEETING * float(np.linalg.norm(branching.difference(free[-1][1], other)))
        shares = _shares(first, free[-1][1], more)
        is_gap = shares[0].min() <= shares.min()  # a gap vanishes: else both sides are alike
        with suppress(NotConverged):
            for _ in range(2 if is_gap else 0):
                found = weakly_impacting(branching, [point for _, point in free], depth)
                length = float(np.linalg.norm(branching.difference(free[-1][1], found)))
                if touches(found) == touches(other) and length <= most:
                    return found
                depth *= min(1.0, 0.5 * most / length) ** 2  # the distance goes with the root of the depth
        for part in BESIDE:
            for base, share in ((a, at + part * (end - at)), (free[-1][1], part * (end - at))):
                try:
                    found = branching.correct(base, share * change, direction, is_free=True)
                except NotConverged:
                    continue
                if touches(found) == touches(other):
                    return found
        return other

    more = list((touches(other) - touches(first)).keys())
    for _ in range(MOST_TRIALS):
        near = free[-1][0]
        shares = [_shares(first, point, more) for _, point in free[-2:]]
        kept = [float(share.min()) for share in shares]
        if root is not None and abs(root - near) < tolerance and kept[-1] >= kept[0]:
            return Grazing(free[-1][1], impacting(near))  # a gap within rounding is not detected
        ahead_of = _root(free[-2:], more)
        if _between(near, ahead_of, far) or (ahead_of is not None and not _between(near, root, far)):
            if root is not None and ahead_of is not None and len(free) > 2 and free[-3][0] != ahead_of:
                error = abs((ahead_of - root) * (near - ahead_of) / (free[-3][0] - ahead_of))
            root = ahead_of
        if root is not None:
            missing = min(missing, abs(root - near))
        if root is None or not _between(near, root, far):
            share = near + (LOOK if len(free) == 1 else 0.5) * (far - near)
        elif abs(root - near) < tolerance:
            return Grazing(free[-1][1], impacting(near))
        else:  # not beyond it, where the motion has the contact
            left = max(0.5 * tolerance, CERTAIN * error)
            share = root + np.sign(near - root) * min(left, APPROACH * abs(near - root))
        if abs(near - far) < HOPELESS and STILL < shares[-1][:2].min() < np.inf:
            return None  # it would have to fall suddenly
        if abs(near - far) < tolerance:
            is_missed = missing > MISSED and _is_apart(free[-1][1], other)
            return None if is_missed else Grazing(free[-1][1], impacting(near))
        try:
            ahead = _ahead(branching, free[-2:], change, measure)
            guess = (share - near) * ahead
            off = MISPLACED * float(np.linalg.norm(guess))
            trial = branching.correct(free[-1][1], guess, measure / np.linalg.norm(measure), in_plane=off)
        except NotConverged:
            trial = None
        if trial is not None and touches(trial) == touches(first):  # in any order
            free.append((share, trial))
        else:
            far = share
            if trial is not None and touches(trial) == touches(other):
                impacts.append((share, trial))
    return None


def grazing_beside(branching: Branching, a: Point, b: Point) -> Grazing | None:
    """Locate the grazing next to two points that differ by one contact, where the branch has a corner.

    It need not lie between them: where an impact makes a motion unstable, the parameter may rise on both
    sides. From the side with fewer contacts the least gap is followed to zero along the parameter.
    """
    n_touch = [touches(point).total() for point in (a, b)]
    if n_touch[0] == n_touch[1]:
        return None
    free, other = (a, b) if n_touch[0] < n_touch[1] else (b, a)
    held = free.parameter_axis
    move = BESIDE[1] * max(abs(a.value - b.value) / branching.step, BESIDE[0])
    pair: list[tuple[float, Point]] = []
    try:
        for sense in (1.0, -1.0):
            pair = [(0.0, free), (sense * move, branching.correct(free, sense * move * held, held))]
            if (root := _root(pair)) is not None:
                break
        left = APPROACH
        for _ in range(MOST_TRIALS):
            near, point = pair[-1]
            if root is None or abs(root) > WITHIN_REACH or left > 0.99:
                return None
            if abs(root - near) * branching.step < branching.located(point):
                break
            there = root + left * (near - root)
            ahead = branching.difference(pair[-2][1], point) / (near - pair[-2][0])
            trial = branching.correct(point, (there - near) * ahead, held)
            if trial.sequence != free.sequence:  # on the way to it the other contact closes
                left = 0.5 * (1.0 + left)
                continue
            pair = [pair[-1], (there, trial)]
            root = _root(pair)
        else:
            return None
        toward = branching.difference(pair[-1][1], other)
        length = float(np.linalg.norm(toward))
        for part in BESIDE:
            beyond = branching.correct(pair[-1][1], part * toward, toward / length, is_free=True)
            if beyond.sequence == other.sequence:
                return Grazing(pair[-1][1], beyond)
    except NotConverged:
        if len(pair) < 2 or abs(pair[-1][0] - pair[-2][0]) * branching.step > branching.family.span:
            return None
    return Grazing(pair[-1][1], other)


def _between(one: float, place: float | None, other: float) -> bool:
    """Whether a place is known, and lies between two."""
    return place is not None and min(one, other) < place < max(one, other)


def _is_apart(free: Point, other: Point) -> bool:
    """Whether a motion clearly lacks the additional contacts of another one."""
    more = list((touches(other) - touches(free)).keys())
    gap, force = distances(free)[: 2 * free.case.q].reshape(2, -1)[:, more]
    return bool(np.isfinite(np.concatenate([gap, force])).any() and not np.any(gap <= MISSED))


def _ahead(branching: Branching, free: list[tuple[float, Point]], change: Floats, measure: Floats) -> Floats:
    """Direction of the side without the contact over a whole step, by its last two points; else `change`.

    A whole step is as long as `measure` (2 n + 1,) in its direction.
    """
    if len(free) < 2:
        return change
    ahead = branching.difference(free[0][1], free[1][1])
    along = float(ahead @ measure)
    return ahead * (measure @ measure / along) if along else change


def _root(free: list[tuple[float, Point]], pairs: list[int] | None = None) -> float | None:
    """Extrapolated place where the first falling least gap or force of some pairs vanishes."""
    if len(free) < 2:
        return None
    (x, before), (y, point) = free
    was, now = _turning(before, pairs), _turning(point, pairs)
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead = np.where(np.isfinite(was) & np.isfinite(now) & (now < was), now / (was - now), np.inf)
    return float(y + (y - x) * ahead.min()) if np.isfinite(ahead.min()) else None


def _shares(first: Point, point: Point, pairs: list[int]) -> Floats:
    """Distances (4, k) of some pairs over those of a first point; 0 where one is new."""
    was, now = (_turning(one, pairs).reshape(4, -1) for one in (first, point))
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(np.isfinite(was) & (was > 0.0), now / was, 0.0)
    return np.where(np.isfinite(now), share, np.inf)


def _turning(point: Point, pairs: list[int] | None) -> Floats:
    """Least gaps and forces, and distances from parting at a touch, of some pairs or of all."""
    found = np.concatenate([distances(point)[: 2 * point.case.q].reshape(2, -1), point.staying_closed])
    return found.ravel() if pairs is None else found[:, pairs].ravel()
