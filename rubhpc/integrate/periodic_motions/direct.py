"""`transient = "direct"`: solves for the periodic motion that a case approaches, to shorten its transient."""

from __future__ import annotations

import math
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.marches.modal import Place
from rubhpc.integrate.measuring.orbit_measures import LONGEST_PERIOD
from rubhpc.integrate.periodic_motions.extrapolation import extrapolated
from rubhpc.integrate.periodic_motions.shooting import NotConverged, Orbit, shoot
from rubhpc.integrate.periodic_motions.transient_case import LEADING, Passed, TransientCase

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.modal import ModalMarch
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.collocated_motion import FollowedMotion
    from rubhpc.integrate.periodic_motions.solved_motion import SolvedMotion, SolvedMotions
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]

FIRST, LONGER = 64, 2.0  # revolutions before the first search, and by what those before the next are more
CLOSING = 0.3  # of its size, by which a motion may fail to close where a search begins
FURTHER = 4.0  # times the revolutions at which a motion was found, until which a case may draw near to it
WATCHED = 16  # revolutions, at least, in which a case must draw near
SHARE_MORE = 8  # in which part of its revolutions, if that is more, it goes on before it is looked at
NEARER = 0.3  # of its distance after one revolution: a return as near as that speaks for a longer period
PATIENCE = 16  # such periods that are simulated before it is sought: a search costs several times as much
MOST_ITERATIONS, LEAST_STEP = 10, 1 / 4  # of Newton's method
SHARE = 0.5  # of what the linear theory takes from its distance: the most that it strays from that
LINEAR = 0.1  # of its distance, by which it may stray from the theory from one look to the next
LOST = 3 / 4  # of what the linear theory takes from its distance, that it loses at least
FALLEN = 1 / 4  # of the square of its distance, to which that falls while the case obeys the theory
STRAYS = 0.3  # of its distance a period before: a case that strays less may follow the linear theory
LEFT = 1.0  # of that distance: a case that strays more knows nothing of the motion
THERE = 1e-8  # of the motion's size: a case as near as that has arrived
TICKS = 4  # times what a point of the orbit turns in the resolution of events: nearer no simulation comes
MOST_EVENTS = 24, 8  # in a revolution: of one pair, and more for each further one


def pass_directly(
    march: ModalMarch,
    motion_of: Callable[[ModalMarch], FollowedMotion],
    recording: Recording,
    motions: SolvedMotions,
) -> Passed:
    """March until a stable periodic motion is found that the case draws near to; go on from that motion.

    After 64, 128, 256, ... revolutions the periodic motion is solved for from where the last ones lead to
    (`extrapolation`), if that nearly closes. Where the case is seen to draw near to it, in these revolutions
    or in further ones (`draws_near`), it goes over; else it goes on, at the latest to the longest transient.

    Parameters
    ----------
    march : ModalMarch
        The case at its beginning.
    motion_of : callable
        Makes what follows its motions from where a march of the case has come.
    motions : SolvedMotions
        Of this operating point.
    """
    case, wanted = TransientCase(march, recording), FIRST
    followed: FollowedMotion | None = None
    missed: list[Candidate] = []  # motions that were found, and that the case did not draw near to
    while True:
        reason = case.simulate(wanted - case.n_revolution)
        if reason is not None or case.n_left <= 0:
            return case.ended(reason)
        wanted = int(LONGER * case.n_revolution)
        case.stay()
        try:
            followed = followed or motion_of(case.march)
        except NoClosedForm:
            continue
        for candidate in _candidates(followed, case, missed, motions):
            if candidate.strays(case.passed) > LEFT:
                candidate.n_missed += 1
                continue
            is_near, reason = draws_near(case, candidate, int(FURTHER * case.n_revolution))
            if is_near:
                orbit = candidate.solved.orbit
                force = followed.contact_force(orbit.states, orbit.motion)
                case.continue_at(followed.setup, Place(orbit.motion, followed.setup.model.sag, force))
                return case.ended(None, candidate.solved)
            if reason is not None:
                return case.ended(reason)
            candidate.n_missed += 1


class Candidate:
    """A periodic motion that a case may draw near to if it is stable.

    Attributes
    ----------
    there : float
        Distance at which a case has arrived.
    n_missed : int
        How often the case was seen not to draw near.
    """

    def __init__(self, followed: FollowedMotion, solved: SolvedMotion) -> None:
        """Take a motion that was found."""
        self.followed, self.solved = followed, solved
        self.there = _nothing(followed.setup) * followed.size(solved.orbit.motion)
        self.n_missed = 0

    def strays(self, passed: Floats) -> float:
        """Distance of the last motion from where the theory takes that a period before, over its distance.

        A case that has arrived does not stray: its distance is rounding.
        """
        orbit, size = self.solved.orbit, self.followed.size
        if len(passed) <= orbit.period:
            return math.inf
        before, apart = passed[-1 - orbit.period] - orbit.motion, passed[-1] - orbit.motion
        if size(apart) <= self.there:
            return 0.0
        return size(apart - orbit.monodromy @ before) / max(size(before), np.finfo(float).tiny)


def _candidates(
    followed: FollowedMotion, case: TransientCase, missed: list[Candidate], motions: SolvedMotions
) -> Iterator[Candidate]:
    """Motions that a case may draw near to now: one that was found too early, then what a search finds.

    Each that was found is taken up once more, if the last period is nearly what the linear theory about it
    makes of the one before.
    """
    again = (one for one in missed if one.n_missed == 1 and one.strays(case.passed) <= STRAYS)
    yield from islice(again, 1)
    case.stay()
    found = _search(followed, case, {one.solved.period for one in missed}, motions)
    if found is not None:
        missed.append(found)
        yield found


def _nothing(setup: ModalSetup) -> float:
    """Distance of a case from a motion, over the size of that, at which it has arrived."""
    return max(THERE, TICKS * abs(setup.spin) * setup.tick)


def draws_near(case: TransientCase, candidate: Candidate, until: int) -> tuple[bool, str | None]:
    """Whether a case draws near to a stable motion, in its last revolutions or further ones.

    Returned with why it cannot go on. Its distance (`Approach`) is to fall from one look to the next, four
    revolutions or a period later, and for 16 revolutions or more to be at each look where the linear theory
    takes it from the one before, to a tenth of its distance; and what it has strayed from the theory in these
    looks (root of the sum of squares) is to be less than half of what it loses by it, of which three quarters
    are to be lost. Meanwhile it is to lose half of its distance. A motion that beats about another one, or
    only passes by, does not draw near so. It is watched until so many revolutions have passed, or it disobeys
    the theory in further ones.
    """
    followed, solved = candidate.followed, candidate.solved
    orbit, approach = solved.orbit, solved.approach
    span, to_next_look = solved.n_period * orbit.period, solved.to_next_look
    least = -(-WATCHED // span)
    looks: list[Look] = []
    is_further = candidate.n_missed > 0  # what was found before must lead the case at once
    seen = case.passed[::-1][::span][::-1] - orbit.motion  # its distances from one look to the next
    while True:
        foreseen = seen[:-1] @ to_next_look.T
        here, there = approach.squares(seen), approach.squares(foreseen)
        strays = approach.squares(seen[1:] - foreseen)
        for was, now, stray, less in zip(here[:-1], here[1:], strays, there, strict=True):
            if stray > LINEAR**2 * was or now >= was:
                looks = []
            else:
                looks.append(Look(was, now, stray / was, _fall(was, less)))
        if followed.size(seen[-1]) <= candidate.there or _agree(looks, least):
            return True, None
        if is_further and not looks:
            return False, None
        is_further = True
        n_look = -(-max(WATCHED, case.n_revolution // SHARE_MORE) // span)
        n_look = min(n_look, case.n_left // span)
        if case.n_revolution >= until or n_look < 1:
            return False, None
        if (reason := case.simulate(n_look * span)) is not None:
            return False, reason
        seen = case.passed[::-1][::span][: n_look + 1][::-1] - orbit.motion


class Look(NamedTuple):
    """From one look at a case to the next: squares of distances, and the logarithm of what is to be lost."""

    was: float
    now: float
    strays: float  # from where the theory takes it, of the first
    expected: float


def _fall(before: float, after: float) -> float:
    """Logarithm of a distance over a later one, from their squares; infinite where nothing is left."""
    return 0.5 * math.log(before / after) if after > 0.0 else math.inf


def _agree(looks: list[Look], least: int) -> bool:
    """Whether so many of the latest looks, or more, show what the linear theory says."""
    strayed = expected = lost = 0.0
    for n_look, look in enumerate(reversed(looks), 1):
        strayed, expected, lost = (
            strayed + look.strays,
            expected + look.expected,
            lost + _fall(look.was, look.now),
        )
        obeys = strayed <= (SHARE * expected) ** 2 and lost >= LOST * expected
        if n_look >= least and obeys and looks[-1].now <= FALLEN * look.was:
            return True
    return False


def _search(
    followed: FollowedMotion, case: TransientCase, missed: Collection[int], motions: SolvedMotions
) -> Candidate | None:
    """Return the stable periodic motion that the last ones lead to: as they return, or of one revolution.

    The first that they may follow to, else of two the nearer one. An unstable motion whose disturbances
    change sides in every period is followed to twice its period. Periods that were `missed` before come last.
    """
    passed, found = case.passed, list[tuple[float, Candidate]]()
    for period in sorted(_periods(followed, passed, case.n_revolution), key=missed.__contains__):
        one = _solved(followed, case, asked := period, motions)
        while one and one.is_doubled and (asked := 2 * asked) <= LONGEST_PERIOD:
            one = _solved(followed, case, asked, motions)
        if one and one.approach.is_stable:
            candidate = Candidate(followed, one)
            if candidate.strays(passed) <= STRAYS:
                return candidate
            found.append((followed.size(one.orbit.motion - passed[-1]), candidate))
    return min(found, key=lambda one: one[0])[1] if found else None


def _periods(followed: FollowedMotion, passed: Floats, n_revolution: int) -> list[int]:
    """The least number of revolutions after which the motion comes back far nearer than after one, and 1.

    The longer comes first: where the motion has the period 1, that is found by it as well.
    """
    longest = min(len(passed) - 1, n_revolution // PATIENCE, LONGEST_PERIOD)
    back = (passed[-1] - passed[::-1][1 : longest + 1]) ** 2 @ followed.energy
    return [*(np.flatnonzero(back[1:] <= NEARER**2 * back[:1]) + 2)[:1].tolist(), 1]


def _solved(
    followed: FollowedMotion, case: TransientCase, period: int, motions: SolvedMotions
) -> SolvedMotion | None:
    """Periodic motion that the last ones lead to, a period apart; None where none is found."""

    def shoot_from(motion: Floats, states: int, period: int) -> Orbit:
        return shoot(
            followed,
            motion,
            states,
            period,
            most_iterations=MOST_ITERATIONS,
            least_step=LEAST_STEP,
            most_events=MOST_EVENTS[0] + MOST_EVENTS[1] * (followed.q - 1),
            most_residual=CLOSING,
        )

    leading = extrapolated(case.passed[::-1][::period][: LEADING + 1][::-1], followed.energy)
    try:
        return motions.of(followed, shoot_from(leading, case.states, period), shoot_from)
    except (NoClosedForm, NotConverged):
        return None
