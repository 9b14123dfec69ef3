"""Pseudo-arclength continuation: a branch followed from point to point, through folds, to its end."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.integrate.branches.events import Event, half_change, halving
from rubhpc.integrate.branches.grazing import (
    closed_around,
    filled,
    grazing,
    grazing_beside,
    grazing_between,
    passed,
    touches,
)
from rubhpc.integrate.branches.point import away_from_events
from rubhpc.integrate.branches.weak_impact import weakly_impacting
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.shooting import NotConverged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point

    Floats = NDArray[np.float64]

FIRST, LEAST, LONGEST = 0.1, 1e-4, 1.0  # lengths of a step
GOOD, POOR = 0.03, 0.15  # distance from a prediction over the step's length: lengthen below, shorten above
STRAIGHT = 0.75  # cosine of the angle between two steps, at least
MOST_OFF = 3  # motions off a prediction by the last steps, after which the tangent is used
SHORT = 0.02  # length of a step that may pass a motion of half the period
FEWEST = 6  # points of a closed branch
ANYWHERE = 1e-3  # of a step, accuracy of where it ends
SHORTEST = 1e-3  # length of a step in which several contacts may appear and vanish at once
NEARBY = 1e-2  # length within which a branch is lost at a grazing
BEYOND = (0.02, 0.1, 0.5)  # steps past a grazing at which the branch is sought again


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """Points of a branch in order, with the event at each, and the reason of its end.

    `is_halved`: it ends at a motion of half its period; `is_closed`: it ends where it began; `doublings`:
    number of period doublings that lead to it.
    """

    points: list[Point]
    events: list[Event]
    end: str
    is_halved: bool = False
    is_closed: bool = False
    doublings: int = 0


def follow(
    branching: Branching,
    start: list[Point],
    sense: float,
    *,
    low: float,
    high: float,
    most: int,
) -> Track:
    """Follow a branch until it leaves a range of the parameter, closes, or is lost.

    Parameters
    ----------
    start : list of Point
        One point, or two from the first of which the branch goes through the second.
    sense : float
        From a single point: 1 where the parameter rises at first, else -1.
    most : int
        Points, at most.
    """
    points, events = list(start), [Event.NONE] * len(start)
    history, end = list(start), f"{most} points"
    length = FIRST if len(start) == 1 else float(np.linalg.norm(branching.difference(*start)))
    length = min(FIRST, length)
    is_halved = is_closed = False
    heading, has_turned = None, False  # direction from a single point; whether its contacts are new

    def add(event: Event, point: Point) -> None:
        points.append(point.note_state())
        events.append(event)

    try:
        while len(points) < most:
            if ahead := away_from_events(history[-1]):
                history = [branching.moved(point, ahead) for point in history[-3:]]
            base = history[-1]
            if has_turned or len(history) == 1:
                toward = sense * base.parameter_axis
                if len(history) > 1:
                    toward = branching.difference(*history[-2:])
                heading, history, has_turned = branching.tangent(base, toward), [base], False
            edge, found, guess, happened, n_off = 0.0, None, None, [], 0
            while length >= LEAST:
                if heading is not None:
                    guess, along = length * heading, heading
                else:
                    guess, along = predict(branching, history, length)
                value = base.value + guess[-1] * branching.step
                edge = low if value <= low else high if value >= high else 0.0
                if value <= low or value >= high:
                    guess = guess * (edge - base.value) / (guess[-1] * branching.step)
                    along = base.parameter_axis
                try:
                    trial = branching.correct(base, guess, along, in_plane=ANYWHERE * length)
                except NotConverged:
                    length *= 0.5
                    continue
                is_back = _is_half(trial) or (trial.sequence == base.sequence and _is_back(trial, base))
                is_last = length <= SHORTEST
                is_near = _is_near(branching, history, guess, trial)
                n_off += not is_near
                if n_off == MOST_OFF and heading is None:  # the last step ended behind a fold
                    heading = branching.tangent(base, branching.difference(*history[-2:]))
                    length = FIRST
                    continue
                if is_near and (length <= SHORT or not is_back):
                    events_between = passed(branching, base, trial, is_last=is_last)
                    is_misled = _is_misled(branching, base, guess, trial, events_between or [])
                    if (events_between is not None or is_last) and not is_misled:
                        found, happened = trial, events_between or []
                        break
                length *= 0.5
            if found is None:
                point, follower = grazing(branching, history, predict), None
                if point is not None:
                    follower = _beyond(branching, history[-2:], base, point)
                elif len(history) > 1 and (other := _beyond(branching, history[-2:], base, base)):
                    corner_there = grazing_beside(branching, base, other)  # behind a sharp corner
                    if corner_there is None and any(closed_around(base)):  # an orbit that fills a bore
                        corner_there = grazing_between(branching, base, other)
                    if corner_there and _is_close(branching, base, corner_there.point):
                        point, follower = corner_there.point, other
                if point is None:
                    end = "no neighbouring motion is found, so the branch ends here"
                    break
                add(Event.GRAZING, point)
                if follower is None:
                    end = "a contact grazes"
                    break
                add(Event.NONE, follower)
                history, length, has_turned = [point, follower], FIRST, True
                continue
            is_same = found.sequence == base.sequence
            has_halved = _is_half(found) or (is_same and _is_back(found, base))
            for event, point in happened:
                if not has_halved or event not in (Event.FOLD, Event.BRANCH_POINT):
                    add(event, point)  # where the period halves, a multiplier of 1 is no further event
            if has_halved:
                if half := halving(branching, base, found):
                    add(Event.PERIOD_DOUBLING, half)
                end, is_halved = "it meets a motion of half the period", True
                break
            if closing := _closing(branching, points, base, found):
                add(Event.END, closing)
                end, is_closed = "the branch is closed", True
                break
            is_at_edge = found.value in (low, high)
            add(Event.END if is_at_edge else Event.NONE, found)
            if is_at_edge:
                end = "the range ends"
                break
            assert guess is not None
            miss = _miss(branching, base, guess, found) / length
            corner = [point for event, point in happened if event is Event.GRAZING][-1:]
            history, heading, has_turned = [*(corner or history[-2:]), found], None, not is_same
            length = min(LONGEST, 1.5 * length) if miss < GOOD else (0.6 * length if miss > POOR else length)
            if corner:
                length = max(length, FIRST)  # it was short because of the grazing
    except (Unfollowed, InputError, NotConverged, np.linalg.LinAlgError) as problem:
        end = str(problem)
    if events[-1] is Event.NONE and len(points) < most:
        events[-1] = Event.END
    return Track(points=points, events=events, end=end, is_halved=is_halved, is_closed=is_closed)


def predict(branching: Branching, history: list[Point], length: float) -> tuple[Floats, Floats]:
    """Predicted motion at a length ahead of two or three points, in steps from the last; direction there."""
    ahead = branching.difference(*history[-2:])
    first = float(np.linalg.norm(ahead))
    slope, bend = ahead / first, np.zeros_like(ahead)
    if len(history) > 2:
        earlier = branching.difference(*history[-3:-1])
        second = float(np.linalg.norm(earlier))
        if earlier.size == ahead.size and second > 0.0:
            bend = (slope - earlier / second) / (first + second)
    guess = length * slope + length * (length + first) * bend
    along = slope + (2.0 * length + first) * bend
    return guess, along / np.linalg.norm(along)


def _miss(branching: Branching, base: Point, guess: Floats, found: Point) -> float:
    change = branching.difference(base, found)
    return float(np.linalg.norm(change - guess)) if change.size == guess.size else 0.0


def _is_near(branching: Branching, history: list[Point], guess: Floats, found: Point) -> bool:
    """Whether a motion lies on the branch as predicted, not on another one."""
    change = branching.difference(history[-1], found)
    length = float(np.linalg.norm(guess))
    if change.size != guess.size:
        return True
    moved = float(np.linalg.norm(change))
    return bool(moved > 0.0 and change @ guess > STRAIGHT * moved * length and moved < 2.0 * length)


def _is_misled(
    branching: Branching, base: Point, guess: Floats, trial: Point, happened: list[tuple[Event, Point]]
) -> bool:
    """Whether a grazing lies behind, where the branch has come from, or next to a motion that fills a bore.

    On the wrong side of the grazing such a motion seems to be there, with forces within their error.
    """
    for event, point in happened:
        if event is Event.GRAZING:
            away = branching.difference(base, point)
            is_behind = away.size == guess.size and away @ guess < 0.0
            if is_behind or (filled(trial) and _is_close(branching, trial, point)):
                return True
    return False


def _beyond(branching: Branching, history: list[Point], base: Point, grazing_point: Point) -> Point | None:
    """A motion with other contacts next to a grazing: by a weak impact, or along the parameter."""

    def follows(found: Point) -> bool:
        away = np.linalg.norm(branching.difference(grazing_point, found))
        is_sure = away > NEARBY or not filled(found)
        return bool(touches(found) != touches(base) and away < 1.0 and is_sure)

    with suppress(NotConverged):
        if follows(found := weakly_impacting(branching, history)):
            return found
    sense = np.sign(grazing_point.value - history[0].value)
    along = grazing_point.parameter_axis
    for steps in BEYOND:
        for start in (grazing_point, *closed_around(grazing_point)):
            for direction in (sense, -sense):
                with suppress(NotConverged):
                    found = branching.correct(start, direction * steps * along, along, most=12)
                    if follows(found):
                        return found
    return None


def _is_close(branching: Branching, base: Point, point: Point) -> bool:
    """Whether a motion with other contacts is as near as some last short steps."""
    return bool(np.linalg.norm(branching.difference(base, point)) < NEARBY)


def _is_back(found: Point, base: Point) -> bool:
    """Whether the branch has passed a motion of half its period, and returns half a period later."""
    if found.period % 2:
        return False
    now, before = half_change(found), half_change(base)
    return bool(now.size == before.size and now @ before < 0.0)


def _is_half(point: Point) -> bool:
    """Whether a motion has half the period with which it is followed."""
    if point.period % 2:
        return False
    case = point.case
    return bool(case.size(half_change(point)) < case.tolerances.half * case.size(point.motion))


def _closing(branching: Branching, points: list[Point], base: Point, found: Point) -> Point | None:
    """The first motion of a branch, where the branch passes it again between two points in the same sense."""
    first, step = points[0], found.value - base.value
    if len(points) < FEWEST or step * (points[1].value - first.value) <= 0.0:
        return None
    share = (first.value - base.value) / step
    if not 0.0 <= share <= 1.0 or found.motion.size != first.motion.size:
        return None
    change = branching.difference(base, found)
    try:
        there = branching.correct(base, share * change, base.parameter_axis)
    except NotConverged:
        return None
    return there if branching.is_same(there, first) else None
