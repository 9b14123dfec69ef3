"""All branches that lead on from some motions: both ways, at doublings of the period and from halved ones."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.arclength import Track, follow
from rubhpc.integrate.branch_events import Event, half_change
from rubhpc.integrate.piecewise_motion import Unfollowed
from rubhpc.integrate.shooting import NotConverged

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.branch_point import Branching, Point

    Floats = NDArray[np.float64]

ASIDE = (0.3, 0.1, 0.03, 0.01)  # steps from a doubling at which the motion of twice the period is sought
SAME_MOTION = 1e-6  # of its size
SAME_VALUE = 1e-6  # of the range, between two doublings that are one


def search(
    branching: Branching, starts: Iterable[Point], *, low: float, high: float, most: int, doublings: int
) -> list[Track]:
    """Follow the branches of some motions, and what bifurcates from them.

    Parameters
    ----------
    starts : iterable of Point
        Motions; those on a branch that has been followed are passed over.
    low, high : float
        Range of the parameter.
    most : int
        Points of a branch.
    doublings : int
        How many times in a row the period may double.
    """
    tracks: list[Track] = []
    for start in starts:
        if any(lies_on(branching, track, start) for track in tracks):
            continue
        found = [_both_ways(branching, start, low, high, most)]
        while found:
            track = found.pop(0)
            tracks.append(track)
            if (half := _halved(branching, track)) and not any(
                lies_on(branching, other, half) for other in tracks + found
            ):
                found.append(_both_ways(branching, half, low, high, most))
            if track.doublings >= doublings:
                continue
            for point in _doublings(track):
                if _is_known(branching, tracks, point):
                    continue
                pair = _aside(branching, point)
                if pair is not None:
                    follower = follow(branching, pair, 1.0, low=low, high=high, most=most)
                    found.append(replace(follower, doublings=track.doublings + 1))
    return tracks


def lies_on(branching: Branching, track: Track, point: Point) -> bool:
    """Whether a motion is one of a track."""
    held = np.zeros(point.motion.size + 1)
    held[-1] = 1.0
    for a, b in zip(track.points, track.points[1:], strict=False):
        if (a.value - point.value) * (b.value - point.value) > 0.0 or a.period != point.period:
            continue
        near = a if abs(a.value - point.value) < abs(b.value - point.value) else b
        guess = np.zeros(near.motion.size + 1)
        if a.phase == b.phase and a.value != b.value and near is a:
            guess = branching.difference(a, b) * (point.value - a.value) / (b.value - a.value)
        guess[-1] = (point.value - near.value) / branching.step
        try:
            there = branching.correct(near, guess, held)
            if _is_same(branching, there, point):
                return True
        except (NotConverged, Unfollowed):
            continue
    return False


def _is_same(branching: Branching, there: Point, point: Point) -> bool:
    """Whether two motions of a case are one, but for a shift by revolutions."""
    if there.motion.size != point.motion.size:
        return False
    limit = SAME_MOTION * there.case.size(there.motion)
    for k in range(point.period):
        moved = branching.moved(point, (there.phase - point.phase) % 1.0 + k)
        if there.case.size(moved.motion - there.motion) <= limit:
            return True
    return False


def _both_ways(branching: Branching, start: Point, low: float, high: float, most: int) -> Track:
    """The branch through a motion, from its end in one sense to that in the other."""
    tracks = [
        follow(branching, [start], sense, low=low, high=high, most=most)
        for sense, limit in ((-1.0, low), (1.0, high))
        if start.value != limit
    ]
    if len(tracks) == 1:
        return tracks[0]
    back, on = tracks
    return Track(
        points=[*back.points[:0:-1], *on.points],
        events=[*back.events[:0:-1], *on.events],
        end=f"{back.end}; {on.end}",
        is_halved=back.is_halved or on.is_halved,
    )


def _doublings(track: Track) -> Iterator[Point]:
    """Where the period doubles, but for the end at which it halves."""
    for point, event in zip(track.points, track.events, strict=True):
        is_own = float(np.linalg.norm(half_change(point))) if point.period % 2 == 0 else 1.0
        if event is Event.PERIOD_DOUBLING and is_own > SAME_MOTION * point.case.size(point.motion):
            yield point


def _halved(branching: Branching, track: Track) -> Point | None:
    """The motion of half the period at which a track ends."""
    for k in (0, -1):
        point = track.points[k]
        at_end = track.events[k] in (Event.PERIOD_DOUBLING, Event.GRAZING)
        if track.is_halved and at_end and point.period % 2 == 0:
            half = replace(point, revolutions=point.revolutions[: point.period // 2])
            try:
                held = np.zeros(point.motion.size + 1)
                held[-1] = 1.0
                return branching.correct(half, 0.0 * held, held)
            except NotConverged:
                return None
    return None


def _is_known(branching: Branching, tracks: list[Track], point: Point) -> bool:
    """Whether the branch that leaves at a doubling has been followed to it from its other side."""
    within = SAME_VALUE * branching.family.span
    return any(
        event is Event.PERIOD_DOUBLING
        and other.period == 2 * point.period
        and abs(other.value - point.value) < within
        for track in tracks
        if track.is_halved
        for other, event in zip(track.points, track.events, strict=True)
    )


def _aside(branching: Branching, point: Point) -> list[Point] | None:
    """A motion of twice the period at its doubling, and one next to it on the branch that leaves."""
    base = branching.repeated(point, 2)
    values, vectors = np.linalg.eig(point.monodromy)
    direction = vectors[:, np.argmin(np.abs(values + 1.0))].real
    along = branching.direction(base, direction)
    for length in ASIDE:
        try:
            found = branching.correct(base, length * along, along)
        except NotConverged:
            continue
        moved = branching.difference(base, found)
        if np.linalg.norm(moved - length * along) < 0.5 * length:
            return [base, found]
    return None
