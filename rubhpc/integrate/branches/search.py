"""All branches reached from some motions: in both senses, at period doublings and from halved periods."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.branches.arclength import Track, follow
from rubhpc.integrate.branches.events import Event, half_change, has_halved
from rubhpc.integrate.branches.refining import refined
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.shooting import NotConverged

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point

    Floats = NDArray[np.float64]

# Steps from a doubling at which the motion of twice the period is sought: it may exist, or have the same
# contacts, only in a narrow range.
ASIDE = (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4)
SAME_VALUE = 1e-6  # of the range, between two doublings that are the same
ASTRAY = 0.5  # of that length, allowed deviation from the direction of the multiplier -1


def search(
    branching: Branching, starts: Iterable[Point], *, low: float, high: float, most: int, doublings: int
) -> list[Track]:
    """Follow the branches of some motions, and those that bifurcate from them.

    Parameters
    ----------
    starts : iterable of Point
        Motions; those on a known branch are skipped.
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
            track = refined(branching, found.pop(0), most)
            tracks.append(track)
            for half in _halved(branching, track):
                if not any(lies_on(branching, other, half) for other in tracks + found):
                    found.append(_both_ways(branching, half, low, high, most))
            if track.doublings >= doublings:
                continue
            for point in _doublings(track):
                if _is_known(branching, tracks + found, point):
                    continue
                pair = _aside(branching, point)
                if pair and not any(lies_on(branching, other, pair[1]) for other in tracks + found):
                    follower = follow(branching, pair, 1.0, low=low, high=high, most=most)
                    events = [Event.PERIOD_DOUBLING, *follower.events[1:]]
                    found.append(replace(follower, events=events, doublings=track.doublings + 1))
    return tracks


def lies_on(branching: Branching, track: Track, point: Point) -> bool:
    """Whether a motion is one of a track."""
    held = point.parameter_axis
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
            if branching.is_same(there, point):
                return True
        except (NotConverged, Unfollowed):
            continue
    return False


def _both_ways(branching: Branching, start: Point, low: float, high: float, most: int) -> Track:
    """The branch through a motion, from its end in one sense to that in the other."""
    tracks: list[Track] = []
    for sense, limit in ((-1.0, low), (1.0, high)):
        if start.value != limit:
            tracks.append(follow(branching, [start], sense, low=low, high=high, most=most))
            if tracks[-1].is_closed:
                return tracks[-1]
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
    """Period doublings, except ends at which the period halves."""
    for point, event in zip(track.points, track.events, strict=True):
        if event is Event.PERIOD_DOUBLING and not has_halved(point):
            yield point


def _halved(branching: Branching, track: Track) -> Iterator[Point]:
    """The motions of half the period at which a track ends, except the one from which it branched off."""
    for k in (-1,) if track.doublings else (0, -1):
        point = track.points[k]
        if track.events[k] in (Event.PERIOD_DOUBLING, Event.GRAZING) and has_halved(point):
            half = replace(point, revolutions=point.revolutions[: point.period // 2])
            try:
                yield branching.correct(half, 0.0 * point.parameter_axis, point.parameter_axis)
            except NotConverged:
                continue


def _is_known(branching: Branching, tracks: list[Track], point: Point) -> bool:
    """Whether the branch that leaves at a doubling has been followed from its other end."""
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
    """A motion of twice the period at its doubling, and one next to it on the branch that leaves.

    It must have the same contacts, so that no event is skipped; where none has, the farthest is taken.
    """
    base = branching.repeated(point, 2)
    values, vectors = np.linalg.eig(point.monodromy)
    direction = vectors[:, np.argmin(np.abs(values + 1.0))].real
    along = branching.direction(base, direction)
    other: Point | None = None
    for length in ASIDE:
        try:
            found = branching.correct(base, length * along, along)
        except NotConverged:
            continue
        if branching.length_of(found, half_change(found)) < length:
            continue  # the motion that has not doubled
        moved = branching.difference(base, found)
        if found.sequence == base.sequence and np.linalg.norm(moved - length * along) < ASTRAY * length:
            return [base, found]
        other = other or found
    return None if other is None else [base, other]
