"""All branches reached from some motions: in both senses, at period doublings and from halved periods."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.integrate.branches.arclength import Track, follow
from rubhpc.integrate.branches.events import NARROW, Event, half_change, has_halved, kind_of
from rubhpc.integrate.branches.grazing import distances, passed
from rubhpc.integrate.branches.point import REAL
from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.periodic_motions.collocated_motion import followed_motion
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.shooting import NotConverged
from rubhpc.integrate.start import fit_to_gaps, start_of
from rubhpc.integrate.transient import pass_revolutions
from rubhpc.study.initial import Initial

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point
    from rubhpc.integrate.periodic_motions.family import Motion
    from rubhpc.integrate.record import State
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]


SEED = 1  # of the disturbances: the same in every run

MOST_HALVINGS = 6  # of a step
MOST_KNOWN = 20  # where an event certainly lies between its ends
FAR = 1e-3  # of a step: a nearer neighbour shows no trend
TURNED = 0.3  # between the direction of a step and the mean of those around it, of length 1
ASTRAY = 0.5  # of a step, allowed deviation of its middle

# Steps from a doubling at which the motion of twice the period is sought: it may exist, or have the same
# contacts, only in a narrow range.
ASIDE = (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4)
OFF_SIDE = 0.5  # of that length, allowed deviation from the direction of the multiplier -1


def starts(
    branching: Branching, values: Sequence[float], periods: Sequence[int], recording: Recording
) -> Iterator[Point]:
    """Yield motions at some values of the parameter, for each requested period.

    The case is simulated with rising parameter, each time from the final state of the one before, then with
    falling parameter, then from rest with a random lateral velocity of up to that of a whirl in the gap.
    """
    rising = sorted(values)
    for order in (rising, rising[::-1]):
        state: State | Initial = Initial()
        for value in order:
            ended = simulated(branching, value, state, recording)
            if ended is None:
                state = Initial()
                continue
            state, followed = ended
            yield from _of_each_period(branching, value, followed, periods)
    random = np.random.default_rng(SEED)
    for value in rising:
        setup, clearance, _ = branching.family.settings(value)
        speed, angle = random.random() * abs(setup.spin) * clearance, 2 * np.pi * random.random()
        disturbed = Initial(
            vertical_velocity=float(speed * np.cos(angle)), horizontal_velocity=float(speed * np.sin(angle))
        )
        ended = simulated(branching, value, disturbed, recording)
        if ended:
            yield from _of_each_period(branching, value, ended[1], periods)


def _of_each_period(
    branching: Branching, value: float, followed: Motion, periods: Sequence[int]
) -> Iterator[Point]:
    """Motions with exactly these periods that Newton's method finds from a start."""
    for period in periods:
        point = shot(branching, value, followed, (period,))
        if point is not None and point.period == period:
            yield point


def simulated(
    branching: Branching, value: float, initial: State | Initial, recording: Recording
) -> tuple[State, Motion] | None:
    """State of a case after the transient; None where it cannot be followed."""
    setup, clearance, friction = branching.family.settings(value)
    try:
        state = (
            start_of(initial, setup, clearance)
            if isinstance(initial, Initial)
            else fit_to_gaps(initial, setup, clearance)
        )
        begin = partial(followed_motion(setup.scheme), setup, clearance, friction)
        march = begin(state).march
        if pass_revolutions(march, recording, recording.longest_transient) is not None:
            return None
        state = fit_to_gaps(march.final(), setup, clearance)
        return state, begin(state)
    except (NoClosedForm, InputError):
        return None


def shot(branching: Branching, value: float, followed: Motion, periods: Sequence[int]) -> Point | None:
    """The first motion found from a start, among some periods."""
    for period in periods:
        try:
            return branching.begin(value, followed.start, followed.states, period)
        except (NotConverged, Unfollowed):
            continue
    return None


def refined(branching: Branching, track: Track, most: int) -> Track:
    """Add points in the middle of steps that may hide a pair of events, and the events between them.

    Two events of one kind are not visible at the ends of a step: a multiplier leaves the unit circle and
    enters it again, or a gap closes once more and opens. Neighbouring points show this. The middle of a step
    is computed where the distance of a multiplier from the unit circle, or of a motion from grazing, falls
    towards the step from both sides such that the two tangents meet below zero. It is also computed where the
    branch turns aside within the step and back.
    """
    points, events = list(track.points), list(track.events)
    for i in range(1, len(points) - 1):
        if events[i] is Event.NONE:
            events[i] = _event_at(*points[i - 1 : i + 2])  # a branch may begin at one
    halvings = [0] * len(points)  # of the step behind each point
    k = 0
    while k < len(points) - 1:
        most_halvings = MOST_HALVINGS if _outside(points[k]) & _outside(points[k + 1]) else MOST_KNOWN
        if halvings[k] >= most_halvings or len(points) >= most or not _may_hide(branching, points, k):
            k += 1
            continue
        a, b = _aligned(branching, points[k], points[k + 1]), points[k + 1]
        change = branching.difference(a, b)
        length = float(np.linalg.norm(change))
        halvings[k] += 1
        try:
            middle = branching.correct(a, 0.5 * change, change / length, is_free=True)
        except NotConverged:
            halvings[k] = MOST_KNOWN
            continue
        off = np.linalg.norm(branching.difference(a, middle) - 0.5 * change)
        before, behind = passed(branching, a, middle), passed(branching, middle, b)
        if off > ASTRAY * length or before is None or behind is None:
            halvings[k] = MOST_KNOWN
            continue
        found = [*before, (Event.NONE, middle), *behind]
        events[k + 1 : k + 1] = [event for event, _ in found]
        points[k + 1 : k + 1] = [point for _, point in found]
        halvings[k + 1 : k + 1] = [halvings[k]] * len(found)
        k = max(k - 1, 0)  # the step before has a nearer neighbour now
    return replace(track, points=points, events=events)


def _event_at(before: Point, point: Point, behind: Point) -> Event:
    """What happens at a point, where a multiplier on the unit circle leaves it there."""
    if has_halved(before) or has_halved(behind):
        return Event.NONE  # nearly there; the multiplier is that of the doubling
    (on,) = np.nonzero(np.abs(np.abs(point.multipliers) - 1.0) <= point.case.tolerances.left)
    if on.size and before.n_unstable != behind.n_unstable:
        return kind_of(point, int(on[0]), before, behind)
    return Event.NONE


def _aligned(branching: Branching, a: Point, b: Point) -> Point:
    """The first of two neighbours in the section of the second, in the revolution that is nearest."""
    if a.phase == b.phase:
        return a
    turned = [branching.moved(a, (b.phase - a.phase) % 1.0 + whole) for whole in range(a.period)]
    return min(turned, key=lambda one: float(np.linalg.norm(branching.difference(one, b))))


def _may_hide(branching: Branching, points: list[Point], k: int) -> bool:
    """Whether a pair of events may lie between two points."""
    a, b = points[k], points[k + 1]
    if a.sequence != b.sequence or a.value == b.value or has_halved(a) or has_halved(b):
        return False  # next to a motion of half the period the error of points exceeds the step
    common = _outside(a) & _outside(b)
    if not common:
        return True  # one event is known, and there is another
    n_outside = min(common)
    here = abs(b.value - a.value)
    before = _neighbour(points, k, -1, FAR * here, n_outside)
    behind = _neighbour(points, k + 1, 1, FAR * here, n_outside)
    ends = [one for one in (before, a, b, behind) if one is not None]
    tests = [_tests(one, n_outside) for one in ends]
    if any(test.size != tests[0].size for test in tests):
        return False
    lengths = [_length(branching, one, other) for one, other in pairwise(ends)]
    i = 1 if before else 0
    with np.errstate(invalid="ignore"):
        left = (tests[i] - tests[0]) / lengths[0] if before else None
        right = (tests[-1] - tests[-2]) / lengths[-1] if behind else None
    if _meet_below(tests[i], tests[i + 1], lengths[i], left, right, a.case.tolerances.left):
        return True
    return before is not None and behind is not None and _turns_aside(branching, [before, a, b, behind])


def _outside(point: Point) -> set[int]:
    """Possible numbers of multipliers outside the unit circle: at an event one or a pair is on it."""
    modulus = np.abs(point.multipliers)
    left = point.case.tolerances.left
    n_outside, is_on = int((modulus > 1.0 + left).sum()), np.abs(modulus - 1.0) <= left
    n_real = int((is_on & (np.abs(point.multipliers.imag) <= REAL)).sum())
    n_pair = (int(is_on.sum()) - n_real) // 2
    return {n_outside + i + 2 * j for i in range(n_real + 1) for j in range(n_pair + 1)}


def _neighbour(points: list[Point], k: int, sense: int, least: float, n_outside: int) -> Point | None:
    """The next point on one side with the same contacts and as many multipliers outside the unit circle."""
    here = points[k]
    j = k + sense
    while 0 <= j < len(points):
        other = points[j]
        if other.sequence != here.sequence:
            return None
        if abs(other.value - here.value) > least:
            return other if n_outside in _outside(other) else None
        j += sense
    return None


def _tests(point: Point, n_unstable: int) -> Floats:
    """Test functions of events: distances to grazing, and of two multipliers from the unit circle."""
    modulus, apart = np.abs(point.multipliers), distances(point)
    n = 2 * point.case.q  # the speeds of approach after them are in the order of the section
    inside = 1.0 - modulus[n_unstable] if n_unstable < modulus.size else np.inf
    outside = modulus[n_unstable - 1] - 1.0 if n_unstable else np.inf
    return np.append(apart[:n], [apart[n:].min(initial=np.inf), inside, outside])


def _meet_below(
    a: Floats, b: Floats, length: float, left: Floats | None, right: Floats | None, least_seen: float
) -> bool:
    """Whether the tangents of a test on both sides of a step meet below zero within it."""
    with np.errstate(invalid="ignore", divide="ignore"):
        is_positive = (a > least_seen) & (b > least_seen) & np.isfinite(a) & np.isfinite(b)
        chord = (b - a) / length
        falling = chord if left is None else left
        rising = chord if right is None else right
        is_bent = (falling < 0.0) & (rising > 0.0)
        place = (b - a - rising * length) / (falling - rising)
        least = a + falling * place
    return bool((is_positive & is_bent & (place > 0.0) & (place < length) & (least < 0.0)).any())


def _turns_aside(branching: Branching, points: list[Point]) -> bool:
    """Whether the second of three steps leaves the direction of those around it."""
    steps = []
    for one, other in pairwise(points):
        change = branching.difference(_aligned(branching, one, other), other)
        steps.append(change / np.linalg.norm(change))
    if len({step.size for step in steps}) > 1:
        return False
    return bool(np.linalg.norm(steps[1] - 0.5 * (steps[0] + steps[2])) > TURNED)


def _length(branching: Branching, a: Point, b: Point) -> float:
    return float(np.linalg.norm(branching.difference(_aligned(branching, a, b), b)))


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
    within = NARROW * branching.located(point)
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
        if np.linalg.norm(found.scale * half_change(found)) < length:
            continue  # the motion that has not doubled
        moved = branching.difference(base, found)
        if found.sequence == base.sequence and np.linalg.norm(moved - length * along) < OFF_SIDE * length:
            return [base, found]
        other = other or found
    return None if other is None else [base, other]
