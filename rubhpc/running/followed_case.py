"""A case that `rubhpc plan` runs part by part, as far as there is time, and the forecast of its time."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from rubhpc.integrate.case import run_case
from rubhpc.integrate.following import n_followed
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.running.forecast import Forecast, lengths_behind, n_motion
from rubhpc.running.modes_to_come import ModesToCome

if TYPE_CHECKING:
    from rubhpc.integrate.record import Record, State
    from rubhpc.integrate.setup import Setup
    from rubhpc.running.stopwatch import Stopwatch
    from rubhpc.study.cases import Case
    from rubhpc.study.study import Recording

_LONG = 0.25  # s: cases that take less are run twice
_PATIENCE = 15.0  # s that a part may always take: a whip that begins meets 300 contact modes
_LITTLE = 0.5  # of the time taken: so much more is spent for a better forecast
_FIRST, _FIRST_STEPS = 1 / 16, 50_000  # first part: share of a case, and predicted steps
_LATE = 0.25  # least time of a part without its contact modes, over that with them
_PROBED = 8  # most revolutions that are timed for the rest of a case


class FollowedCase:
    """A case, run part by part.

    Attributes
    ----------
    setup : Setup
        The set-up that it shares with other cases.
    seconds : float, s
        Time of its parts, including contact modes.
    modes : float, s
        Part of it for contact modes, with one stator.
    a_mode : float, s
        Approximate time of a contact mode.
    is_whole, is_irregular : bool
        Whether it was run to its end, and whether it still met new contact modes when it was stopped.
    n_behind : int
        Revolutions that were followed after the record.
    record : Record or None
        Of the latest part.
    """

    def __init__(self, setup: Setup, case: Case, recording: Recording, stopwatch: Stopwatch) -> None:
        self.setup, self._case, self._recording, self._stopwatch = setup, case, recording, stopwatch
        self.seconds = self.modes = self.a_mode = 0.0
        self.is_whole = self.is_irregular = False
        self.n_behind = 0
        self.record: Record | None = None
        self._state: State | None = None
        self._n_motion = n_motion(setup)
        self._n_passed = 0  # revolutions of the transient
        self._pace = 0.0  # s per revolution of the latest part, without its contact modes
        self._met = ModesToCome()
        self._part = 1  # revolutions of the first part
        self._cut = 0.0  # s, after which the next part was stopped, without its contact modes
        self._cut_behind = 0  # revolutions after the record by then

    @property
    def is_in_ring(self) -> bool:
        """Whether it meets many sets of contacts."""
        return is_ring(self.setup)

    @property
    def n_solved(self) -> int:
        """Contact modes that cases of this friction have had solved so far."""
        return n_solved(self.setup, self._case)

    def follow(self, steps: float, n_behind: float, limit: float) -> None:
        """Run part by part, each as long as all before, to the end or while `limit` s allow.

        A whip may begin late in the transient, and then takes twenty times as long.

        Parameters
        ----------
        steps : float
            Predicted, of the whole case.
        n_behind : float
            Likely revolutions after the record.
        limit : float, s
        """
        recording, most = self._recording, max(_PATIENCE, limit)
        self._part = max(1, round(min(_FIRST, _FIRST_STEPS / steps) * recording.longest_transient))
        while n := self._next:
            if not self._is_worth(n, limit) or not self._pass(n, most):
                return
        if self._is_worth(recording.revolutions + self._n_motion * n_behind, limit):
            self.finish(most)

    @property
    def _next(self) -> int:
        """Revolutions of the next part; 0 after the transient."""
        return min(max(self._part, self._n_passed), self._recording.longest_transient - self._n_passed)

    def _is_worth(self, n: float, limit: float) -> bool:
        """Whether so many more revolutions are within a limit, s, or cost little compared with the past."""
        more = self._seconds_of(n)
        return self.seconds + more <= limit or more <= _LITTLE * self.seconds

    def _seconds_of(self, n: float) -> float:
        """Approximate time of so many more revolutions, including the contact modes that they meet."""
        further = max(self._n_passed + n - self._met.revolutions, 0.0)
        return n * self._pace + self.a_mode * self._met.to_come(further)

    @property
    def seconds_of_next(self) -> float:
        """Approximate time of `go_on`."""
        return self._seconds_of(self._next or self._recording.revolutions)

    def go_on(self, limit: float) -> bool:
        """Run the next part, as long as all before, or the rest; False where that took over `limit` s."""
        if n := self._next:
            return self._pass(n, limit)
        self.finish(limit)
        return self.is_whole

    def run_at_once(self) -> None:
        """Run it whole; a second time if it is short, to find the time of contact modes."""
        self.finish(math.inf)
        if self.seconds < _LONG and not self.is_in_ring:
            again, _ = self._timed(self._recording, math.inf)
            self.modes = max(self.seconds - again, 0.0)

    def forecast(self) -> Forecast:
        """Forecast of its time, from where it was stopped."""
        if self.is_whole:
            return Forecast(self.seconds)
        recording = self._recording
        n_left = recording.longest_transient - self._n_passed + recording.revolutions
        least = self.seconds + self._cut
        if self._cut_behind:  # it was stopped there
            behind = self._n_motion * self._cut_behind
            pace = self._cut / (n_left + behind)
            return Forecast(
                least - behind * pace,
                self._n_motion * pace,
                least,
                n_behind=self._cut_behind,
                lengths=lengths_behind(self.setup, recording),
            )
        pace = self._probe()
        return Forecast(
            seconds=self.seconds + n_left * pace,
            per_revolution=self._n_motion * pace if recording.revolutions >= LEAST_REVOLUTIONS else 0.0,
            least=least,
            modes=self._met.n_new * self.a_mode,
            fading=self._met.fading,
            before=self._met.revolutions,
            n_left=n_left + self._n_passed - self._met.revolutions,
        )

    def _pass(self, n: int, most: float) -> bool:
        """Pass some revolutions of the transient; False where that was stopped."""
        part = _passing(self._recording, n)
        before, is_first = self.n_solved, self._n_passed == 0
        taken, record = self._timed(part, most)
        if record is None:
            self._leave(taken, before)
            return False
        n_new = self.n_solved - before
        pace = taken / n
        if is_first:
            again, _ = self._timed(part, math.inf)
            pace = min(pace, again / n)
            if self.is_in_ring:
                self.a_mode = max(taken - again, 0.0) / max(n_new, 1)
            else:
                self.modes = max(taken - again, 0.0)
        else:
            pace = max(taken - n_new * self.a_mode, _LATE * taken) / n
        self._pace, self._state, self.record = pace, record.final, record
        self.seconds += taken
        self._n_passed += n
        self._meet(self._n_passed, n_new)
        return True

    def _meet(self, revolutions: float, n_new: int) -> None:
        """Count new contact modes up to these revolutions."""
        self._met.enter(revolutions, n_new)
        self.is_irregular = self._met.is_growing

    def _leave(self, taken: float, before: int) -> None:
        """Count a part that was stopped, with so many contact modes solved before: they stay solved."""
        n_new = self.n_solved - before
        self._meet(2 * max(self._n_passed, 1), n_new)
        modes = min(n_new * self.a_mode, (1.0 - _LATE) * taken)
        self.seconds += modes
        self._cut = taken - modes

    def finish(self, limit: float) -> None:
        """Run the rest at once, unless that takes more than `limit` s."""
        recording = self._recording
        if self._n_passed:
            left = recording.longest_transient - self._n_passed
            recording = replace(recording, transient=left)
        before, solved = n_followed(), self.n_solved
        taken, record = self._timed(recording, limit)
        if record is None:
            self._cut_behind = (n_followed() - before) // self._n_motion
            self._leave(taken, solved)
            return
        self.n_behind = (n_followed() - before) // self._n_motion
        self.is_whole, self.is_irregular, self.record = True, False, record
        self.seconds += taken

    def _probe(self) -> float:
        """Time of a revolution from where it was stopped, s, with the recorded share of the case."""
        recording = self._recording
        n = recording.longest_transient + recording.revolutions
        share = min(max(self._n_passed, 1), _PROBED) / n
        part = replace(
            recording,
            transient=round(share * recording.longest_transient),
            revolutions=min(round(share * recording.revolutions) or 1, LEAST_REVOLUTIONS - 1),
        )
        before, n_new = self.n_solved, 0
        taken, _ = self._timed(part, math.inf)
        if self.n_solved > before:
            n_new = self.n_solved - before
            again, _ = self._timed(part, math.inf)
            self.seconds, taken = self.seconds + max(taken - again, 0.0), again
        n_revolution = part.longest_transient + part.revolutions
        self._meet(self._n_passed + n_revolution, n_new)
        return taken / n_revolution

    def _timed(self, recording: Recording, most: float) -> tuple[float, Record | None]:
        case = self._case
        return self._stopwatch.timed(
            lambda check: run_case(
                self.setup,
                clearance=case.clearance,
                friction=case.friction,
                recording=recording,
                initial=self._state or case.initial,
                check=check,
            ),
            most,
        )


def is_ring(setup: Setup) -> bool:
    """Whether cases meet many sets of contacts."""
    return len(setup.model.stators) > 1


def n_solved(setup: Setup, case: Case) -> int:
    """Contact modes that cases of this friction have had solved so far."""
    return setup.n_solved(case.friction) if isinstance(setup, ModalSetup) else 0


def _passing(recording: Recording, n: int) -> Recording:
    """A recording of so many revolutions, the last of them recorded."""
    return replace(recording, transient=n - 1, revolutions=1)
