"""`transient = "direct"`: solves for the periodic motion that a case approaches, to shorten its transient."""

from __future__ import annotations

import math
from itertools import count, islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.marches.event_driven import EventDrivenMarch, NoClosedForm
from rubhpc.integrate.measuring.orbit_measures import LONGEST_PERIOD
from rubhpc.integrate.periodic_motions.extrapolation import extrapolated
from rubhpc.integrate.periodic_motions.known_motions import (
    HALF,
    LINEAR,
    SAME,
    SHARE,
    Approach,
    KnownMotions,
    nothing,
)
from rubhpc.integrate.periodic_motions.onward import Onward
from rubhpc.integrate.periodic_motions.shooting import NotConverged, Orbit, shoot
from rubhpc.integrate.transient import idle_of, pass_revolutions

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.record import State
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]

FIRST, LONGER = 24, 2.0  # revolutions before the first search, and by what those before the next are more
KEPT = 16  # revolutions before a search whose motions say where it begins
CLOSING = 0.3  # of its size, by which a motion may fail to close where a search begins
FURTHER = 2.0  # times the revolutions at which a motion was found, until which a case may draw near to it
WATCHED = 16  # revolutions, at least, in which a case must draw near
SLOWER = 2  # times the periods that the linear theory needs for that, in which it must have done so
NEARER = 0.3  # of its distance after one revolution: a return as near as that speaks for a longer period
PATIENCE = 16  # such periods that are simulated before it is sought: a search costs several times as much
MOST_ITERATIONS, LEAST_STEP = 10, 1 / 4  # of Newton's method
LOST = 3 / 4  # of what the linear theory takes from its distance, that it loses at least
FAR = 1e-2  # of the square of its distance, until which the linear theory must keep its contacts
AGAIN = 0.7  # of that square, at which they are looked at once more
MOST_EVENTS = 24, 8  # in a revolution: of one pair, and more for each further one
LOOK, N_LOOK = 4, 2  # revolutions after which a case is compared with known motions; looks at the nearest
FIRST_BESIDE = 64  # revolutions before the first search, where motions are known


class Passed(NamedTuple):
    """A transient that has been passed, or has ended the case."""

    march: EventDrivenMarch  # from which the case goes on
    reason: str | None  # why it cannot
    n_revolution: int  # simulated
    n_step: int  # taken by other marches than that one
    reached: int | None = None  # number of the place of a known motion, at which the case has arrived
    found: tuple[PiecewiseMotion, Orbit] | None = None  # the motion that was solved for, where none was known


class _Walk:
    """A case under way, with its motions (2 n,) at the ends of the last revolutions."""

    def __init__(
        self, march: EventDrivenMarch, start: Callable[[State], March], recording: Recording
    ) -> None:
        self.march, self._start, self._recording = march, start, recording
        self._idle = idle_of(march)
        self.n_revolution = self.n_step = 0
        self.passed: list[Floats] = []  # without a gap, the present one last

    def on(self, n_revolution: int) -> str | None:
        """Go on, at most to the longest transient, and keep the last motions; returns why the case cannot."""
        n_revolution = min(n_revolution, self._recording.longest_transient - self.n_revolution)
        singly = min(n_revolution, KEPT)
        if n_revolution > singly and (reason := self._pass(n_revolution - singly)) is not None:
            return reason
        passed = self.passed or [self.march.motion()]
        for _ in range(singly):
            if (reason := self._pass(1)) is not None:
                return reason
            passed.append(self.march.motion())
        self.passed = passed[-KEPT - 1 :]
        return None

    def repeat(self, period: int) -> tuple[Floats | None, str | None]:
        """Go on by a period: the motion then, None where the transient ends before, and why it cannot."""
        if self.n_revolution + period > self._recording.longest_transient:
            return None, None
        reason = self._pass(period)
        return (self.march.motion() if reason is None else None), reason

    def _pass(self, n_revolution: int) -> str | None:
        self.n_revolution += n_revolution
        self.passed = []
        return pass_revolutions(self.march, self._recording, n_revolution, self._idle)

    def begin_at(self, state: State) -> None:
        """Take another state, or the same with tables that may have been filled anew."""
        self.n_step += self.march.n_step
        march = self._start(state)
        assert isinstance(march, EventDrivenMarch)
        self.march = march

    def arrive(self, known: KnownMotions, wanted: int) -> tuple[int | None, str | None]:
        """Go on to a known motion, or to a number of revolutions: its place, and why the case cannot go on.

        Every four revolutions the case is compared with the nearest motion; it has arrived where it does as
        the linear theory about that says (`Approach.obeys`) until it has halved its distance, and over four
        revolutions or more.
        """
        while self.n_revolution + LOOK <= min(wanted, self._recording.longest_transient):
            if (reason := self._pass(LOOK)) is not None:
                return None, reason
            number, reason = self._falls_to(known)
            if number is not None or reason is not None:
                return number, reason
        return None, None

    def _falls_to(self, known: KnownMotions) -> tuple[int | None, str | None]:
        motion = self.march.motion()
        number = known.nearest(motion)
        if number is None:
            return None, None
        place = known.place(number)
        apart = motion - place.motion
        first = place.approach.square(apart)
        for n_look in count(1):
            if known.is_at(place, apart):
                return number, None
            reached, reason = self.repeat(place.n_period * place.period)
            if reached is None:
                return None, reason
            before, apart = apart, reached - place.motion
            if not place.approach.obeys(before, apart, place.n_period):
                return None, None
            if n_look >= N_LOOK and place.approach.square(apart) <= HALF * first:
                return number, None
        raise AssertionError  # the looks never end

    def ended(
        self,
        reason: str | None,
        reached: int | None = None,
        found: tuple[PiecewiseMotion, Orbit] | None = None,
    ) -> Passed:
        return Passed(self.march, reason, self.n_revolution, self.n_step, reached, found)


def pass_directly(
    march: EventDrivenMarch,
    start: Callable[[State], March],
    solve_from: Callable[[State], PiecewiseMotion],
    recording: Recording,
    known: KnownMotions | None = None,
) -> Passed:
    """March until a stable periodic motion is found that the case draws near to; go on from that motion.

    After 24, 48, 96, ... revolutions the periodic motion is solved for from where the last 16 lead to
    (`extrapolation`), if that nearly closes. Where the case is seen to draw near to it, in these revolutions
    or in further ones (`draws_near`), it goes over; else it goes on, at the latest to the longest transient.
    Where motions are known, the case is compared with them first (`_Walk.arrive`), and the first one is
    solved for after 64 revolutions.

    Parameters
    ----------
    march : EventDrivenMarch
        The case at its beginning.
    start : callable
        Makes the case's march from a state.
    solve_from : callable
        Makes its piecewise motion from a state.
    known : KnownMotions, optional
        Motions that the case may reach.
    """
    walk, wanted = _Walk(march, start, recording), FIRST_BESIDE if known else FIRST
    while True:
        if known is not None:
            reached, reason = walk.arrive(known, wanted - KEPT)
            if reached is not None or reason is not None:
                return walk.ended(reason, reached)
        reason = walk.on(wanted - walk.n_revolution)
        if reason is not None or walk.n_revolution >= recording.longest_transient:
            return walk.ended(reason)
        wanted = int(LONGER * walk.n_revolution)
        state, passed = walk.march.final(), walk.passed
        found = _search(solve_from, state, passed, walk.n_revolution)
        walk.begin_at(state)
        if found is None:
            walk.passed = passed
            continue
        piecewise, orbit = found
        force = piecewise.contact_force(orbit.states, orbit.motion)
        aim = piecewise.march.state_of(orbit.motion, force)
        until = int(FURTHER * walk.n_revolution)
        is_near, reason = draws_near(walk, piecewise, orbit, passed, until)
        if is_near and known is not None and (same := known.nearest(orbit.motion, SAME)) is not None:
            return walk.ended(reason, same)
        if is_near:
            walk.begin_at(aim)
        if is_near or reason is not None:
            return walk.ended(reason, found=found if is_near else None)
        wanted = max(wanted, walk.n_revolution + FIRST)


def draws_near(
    walk: _Walk, piecewise: PiecewiseMotion, orbit: Orbit, passed: list[Floats], until: int
) -> tuple[bool, str | None]:
    """Whether a case draws near to a stable motion, in its last revolutions or further ones.

    Returned with why it cannot go on. Its distance (`Approach`) is to fall from one look to the next, four
    revolutions or a period later, and for 16 revolutions or more to be at each look where the linear theory
    takes it from the one before, to a tenth of its distance; and what it has strayed from the theory in these
    looks (root of the sum of squares) is to be less than half of what it loses by it, of which three quarters
    are to be lost. Then the theory is believed if it keeps the contacts: until a tenth of the distance is
    left, none may come or go that the motion has not (`Onward`). A motion that beats about another one, or
    only passes by, does not draw near so. Where the distance does not fall it is watched anew, until so many
    revolutions have passed.
    """
    approach = Approach(orbit.monodromy, np.repeat([piecewise.setup.spin**2, 1.0], piecewise.n))
    stride = max(1, LOOK // orbit.period)  # periods from one look to the next
    onward = np.linalg.matrix_power(orbit.monodromy, stride)
    least = -(-WATCHED // (stride * orbit.period))
    there = nothing(piecewise.setup) * piecewise.size(orbit.motion)
    theory: Onward | None = None
    span = stride * orbit.period
    past = passed[::-1][::span][::-1]  # one at each look
    apart = past.pop(0) - orbit.motion
    untried = math.inf  # square of the distance at which contacts are looked at next
    while past or walk.n_revolution < until:
        last = approach.square(apart)
        most = max(least, -(-SLOWER * approach.periods_to(HALF, apart) // stride))
        looks: list[tuple[float, float, float]] = []  # what it strays, is to lose and loses, as shares
        for _ in range(most):
            if piecewise.size(apart) <= there:
                return True, None
            reached, reason = (past.pop(0), None) if past else walk.repeat(span)
            if reached is None:
                return False, reason
            foreseen, apart = onward @ apart, reached - orbit.motion
            was, last = last, approach.square(apart)
            stray = approach.square(apart - foreseen) / was
            expected = 0.5 * math.log(was / approach.square(foreseen))
            looks = [*looks, (stray, expected, 0.5 * math.log(was / last))] if stray <= LINEAR**2 else []
            if last <= untried and _agree(looks, least):
                theory = theory or Onward(piecewise, orbit)
                if theory.keeps_contacts(apart, approach.periods_to(FAR, apart)):
                    return True, None
                untried = AGAIN * last
            if last >= was:
                break
    return False, None


def _agree(looks: list[tuple[float, float, float]], least: int) -> bool:
    """Whether so many of the latest looks, or more, show what the linear theory says."""
    if len(looks) < least:
        return False
    strayed, expected, lost = np.cumsum(looks[::-1], axis=0)[least - 1 :].T
    return bool(np.any((strayed <= (SHARE * expected) ** 2) & (lost >= LOST * expected)))


def _search(
    solve_from: Callable[[State], PiecewiseMotion], state: State, passed: list[Floats], n_revolution: int
) -> tuple[PiecewiseMotion, Orbit] | None:
    """Return the stable periodic motion that the last ones lead to: of one revolution, or as they return.

    The first that they follow to, else of two the nearer one. An unstable motion whose disturbances change
    sides in every period is followed to twice its period.
    """
    try:
        piecewise = solve_from(state)
    except NoClosedForm:
        return None
    found: list[tuple[float, Orbit]] = []
    for period in _periods(piecewise, passed, n_revolution):
        orbit = _solved(piecewise, passed, asked := period)
        while orbit and orbit.multipliers[0].real < -1.0 and (asked := 2 * asked) <= LONGEST_PERIOD:
            orbit = _solved(piecewise, passed, asked)
        if orbit and abs(orbit.multipliers[0]) < 1.0:
            if _follows(piecewise, orbit, passed):
                return piecewise, orbit
            found.append((piecewise.size(orbit.motion - passed[-1]), orbit))
    return (piecewise, min(found, key=lambda one: one[0])[1]) if found else None


def _periods(piecewise: PiecewiseMotion, passed: list[Floats], n_revolution: int) -> list[int]:
    """1, and the least number of revolutions after which the motion comes back far nearer than after one."""
    back = [piecewise.size(passed[-1] - motion) for motion in passed[-2::-1]]
    longest = min(len(back), n_revolution // PATIENCE)
    nearer = (n for n in range(2, longest + 1) if back[n - 1] <= NEARER * back[0])
    return [1, *islice(nearer, 1)]


def _follows(piecewise: PiecewiseMotion, orbit: Orbit, passed: list[Floats]) -> bool:
    """Whether the last period is what the linear theory about a periodic motion makes of the one before."""
    if len(passed) <= orbit.period:
        return False
    before, apart = passed[-1 - orbit.period] - orbit.motion, passed[-1] - orbit.motion
    return piecewise.size(apart - orbit.monodromy @ before) <= LINEAR * piecewise.size(before)


def _solved(piecewise: PiecewiseMotion, passed: list[Floats], period: int) -> Orbit | None:
    """Periodic motion that the last ones lead to, a period apart; None where none is found."""
    energy = np.repeat([piecewise.setup.spin**2, 1.0], piecewise.n)
    try:
        return shoot(
            piecewise,
            extrapolated(np.array(passed[::-1][::period][::-1]), energy),
            piecewise.states,
            period,
            most_iterations=MOST_ITERATIONS,
            least_step=LEAST_STEP,
            most_events=MOST_EVENTS[0] + MOST_EVENTS[1] * (piecewise.q - 1),
            most_residual=CLOSING,
        )
    except (NoClosedForm, NotConverged):
        return None
