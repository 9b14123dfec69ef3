"""A case under way to a periodic motion: its last revolutions, and the known motions that it may reach."""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.measuring.orbit_measures import LONGEST_PERIOD
from rubhpc.integrate.periodic_motions.known_motions import HALF
from rubhpc.integrate.transient import idle_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.marches.event_driven import EventDrivenMarch
    from rubhpc.integrate.marches.modal import Place
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.known_motions import KnownMotions
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.shooting import Orbit
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]

AT_ONCE = 1024  # revolutions in one call
LEADING = 16  # periods before a search whose motions say where it begins
KEPT = LEADING * LONGEST_PERIOD  # revolutions whose ends are kept
LOOK, N_LOOK = 4, 2  # revolutions after which a case is compared with known motions; looks at the nearest


class Passed(NamedTuple):
    """A transient that has been passed, or has ended the case."""

    march: EventDrivenMarch  # from which the case goes on
    reason: str | None  # why it cannot
    n_revolution: int  # simulated
    n_step: int  # taken by other marches than that one
    reached: int | None = None  # number of the place of a known motion, at which the case has arrived
    found: tuple[PiecewiseMotion, Orbit] | None = None  # the motion that was solved for, where none was known


class Walk:
    """A case under way.

    Attributes
    ----------
    march : EventDrivenMarch
    n_revolution, n_step : int
        Revolutions simulated, and steps taken before the march was last begun again.
    passed : (k, 2 n)
        Motions at the ends of the last revolutions, the present one last.
    states : int
        Those of the pairs now.
    """

    def __init__(self, march: EventDrivenMarch, recording: Recording) -> None:
        """Stand where a march begins."""
        self.march, self._recording = march, recording
        self._idle = idle_of(march)
        self.n_revolution = self.n_step = 0
        self.states = march.mask
        self.passed = march.motion()[np.newaxis]
        self._place: tuple[ModalSetup, Place] | None = None  # where to begin before going on

    @property
    def n_left(self) -> int:
        """Revolutions until the longest transient."""
        return self._recording.longest_transient - self.n_revolution

    def on(self, n_revolution: int) -> str | None:
        """Go on, at most to the longest transient; returns why the case cannot."""
        left = min(n_revolution, self.n_left)
        while left > 0:
            now = min(left, AT_ONCE)
            self._begin()
            sections, reason = self.march.pass_sections(now, *self._idle)
            self.n_revolution, left = self.n_revolution + now, left - now
            if reason is not None:
                return reason
            self.passed, self.states = np.concatenate([self.passed, sections])[-KEPT - 1 :], self.march.mask
        return None

    def repeat(self, period: int) -> tuple[Floats | None, str | None]:
        """Go on by a period: the motion then, None where the transient ends before, and why it cannot."""
        if period > self.n_left:
            return None, None
        reason = self.on(period)
        return (self.passed[-1] if reason is None else None), reason

    def begin_at(self, setup: ModalSetup, place: Place) -> None:
        """Go on with another motion, or with the same and tables that may have been filled again."""
        self._place = setup, place

    def stand(self) -> None:
        """Go on from here, whatever else the march is used for meanwhile."""
        if self._place is None:
            self.begin_at(self.march.setup, self.march.reached())

    def _begin(self) -> None:
        if self._place is not None:
            self.n_step += self.march.n_step
            self.march.begin(*self._place)
            self._place = None

    def arrive(self, known: KnownMotions, wanted: int) -> tuple[int | None, str | None]:
        """Go on to a known motion, or to a number of revolutions: its place, and why the case cannot go on.

        Every four revolutions the case is compared with the nearest motion; it has arrived where it does as
        the linear theory about that says (`Approach.obeys`) until it has halved its distance, and over four
        revolutions or more.
        """
        while min(wanted - self.n_revolution, self.n_left) >= LOOK:
            if (reason := self.on(LOOK)) is not None:
                return None, reason
            number, reason = self._falls_to(known)
            if number is not None or reason is not None:
                return number, reason
        return None, None

    def _falls_to(self, known: KnownMotions) -> tuple[int | None, str | None]:
        motion = self.passed[-1]
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
        """What has been passed, with the march where the case goes on."""
        self._begin()
        return Passed(self.march, reason, self.n_revolution, self.n_step, reached, found)
