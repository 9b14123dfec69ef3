"""A case on its way to a periodic motion: its last revolutions, and known motions that it may reach."""

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
    from rubhpc.integrate.periodic_motions.known_motions import Found, KnownMotions
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]

AT_ONCE = 1024  # revolutions in one call
LEADING = 16  # periods before a search that determine its start
KEPT = LEADING * LONGEST_PERIOD  # revolutions whose ends are kept
LOOK, N_LOOK = 4, 2  # revolutions between comparisons with known motions; comparisons with the nearest


class Passed(NamedTuple):
    """A finished transient, or the end of the case in it."""

    march: EventDrivenMarch  # from which the case continues
    reason: str | None  # why it cannot continue
    n_revolution: int  # simulated
    n_step: int  # steps of other marches
    reached: int | None = None  # number of the place of a known motion that the case has reached
    found: Found | None = None  # the motion solved for, where none was known


class Walk:
    """A running case.

    Attributes
    ----------
    march : EventDrivenMarch
    n_revolution, n_step : int
        Revolutions simulated, and steps before the last restart of the march.
    passed : (k, 2 n)
        Motions at the ends of the last revolutions, the present one last.
    states : int
        Present states of the pairs.
    """

    def __init__(self, march: EventDrivenMarch, recording: Recording) -> None:
        """Start at the beginning of a march."""
        self.march, self._recording = march, recording
        self._idle = idle_of(march)
        self.n_revolution = self.n_step = 0
        self.states = march.mask
        self.passed = march.motion()[np.newaxis]
        self._place: tuple[ModalSetup, Place] | None = None  # where to begin before continuing

    @property
    def n_left(self) -> int:
        """Revolutions until the longest transient."""
        return self._recording.longest_transient - self.n_revolution

    def on(self, n_revolution: int) -> str | None:
        """Continue, at most to the longest transient; returns why the case cannot."""
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
        """Continue by a period: the motion then, or None where the transient ends before; why it cannot."""
        if period > self.n_left:
            return None, None
        reason = self.on(period)
        return (self.passed[-1] if reason is None else None), reason

    def begin_at(self, setup: ModalSetup, place: Place) -> None:
        """Continue with another motion, or with the same one and tables that may have been refilled."""
        self._place = setup, place

    def stand(self) -> None:
        """Continue from here later, whatever the march is used for in between."""
        if self._place is None:
            self.begin_at(self.march.setup, self.march.reached())

    def _begin(self) -> None:
        if self._place is not None:
            self.n_step += self.march.n_step
            self.march.begin(*self._place)
            self._place = None

    def arrive(self, known: KnownMotions, wanted: int) -> tuple[int | None, str | None]:
        """Continue to a known motion, or to a number of revolutions: its place; why the case cannot continue.

        Every four revolutions the case is compared with the nearest motion. It has arrived where it follows
        the linear theory about that motion (`Approach.obeys`) until the distance has halved, over four
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
        raise AssertionError  # the loop does not end otherwise

    def ended(
        self,
        reason: str | None,
        reached: int | None = None,
        found: Found | None = None,
    ) -> Passed:
        """The finished transient, with the march to continue from."""
        self._begin()
        return Passed(self.march, reason, self.n_revolution, self.n_step, reached, found)
