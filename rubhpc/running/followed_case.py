"""A case that `rubhpc plan` follows part by part, as far as there is time: what it takes, or will take."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from rubhpc.integrate.case import march_of, run_case
from rubhpc.integrate.following import n_followed
from rubhpc.integrate.lyapunov import N_ALIGNING, SPAN
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS, N_ALL, N_FIRST, N_MOST
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.running.modes_to_come import USUAL, ModesToCome, sum_of_powers

if TYPE_CHECKING:
    from rubhpc.integrate.record import Record, State
    from rubhpc.integrate.setup import Setup
    from rubhpc.running.stopwatch import Stopwatch
    from rubhpc.study.cases import Case
    from rubhpc.study.study import Recording

_LONG = 0.25  # s: cases that take less are run twice
_PATIENCE = 15.0  # s that a part may take in any case: a whip that begins meets 300 contact modes
_LITTLE = 0.5  # of what a case has taken: as much more is worth knowing better what is to come
_FIRST, _FIRST_STEPS = 1 / 16, 50_000  # of a case, and predicted steps: its first part
_LATE = 0.25  # least pace of a part without its contact modes, over that with them
_REPEATED = 1.25  # revolutions counted over a length: two motions that take over from a tangent align again
_PROBED = 8  # revolutions at most, of those that show what is left of a case will take


class Forecast(NamedTuple):
    """What a case that has not been run whole will take.

    Attributes
    ----------
    seconds, per_revolution : float, s
        Up to the end of the record, and for each revolution that is followed behind it.
    least : float, s
        What it takes at least.
    modes, fading : float, s
        Of contact modes that the last doubling of its revolutions met, and their ratio to those of the next.
    before : float
        Revolutions by then.
    n_left : float
        Revolutions that are left then up to the end of the record.
    n_behind : int
        Revolutions behind the record, at least.
    lengths : tuple of int
        Revolutions behind a record, of which one is followed (`lengths_behind`).
    """

    seconds: float
    per_revolution: float = 0.0
    least: float = 0.0
    modes: float = 0.0
    fading: float = USUAL
    before: float = 1.0
    n_left: float = 0.0
    n_behind: int = 0
    lengths: tuple[int, ...] = ()

    def whole(self, n_behind: float) -> float:
        """Time of the case, s, if so many revolutions are followed behind its record.

        Where it still meets contact modes, each doubling of its revolutions is taken to meet a share of those
        of the last (`ModesToCome`).
        """
        n = self._behind(n_behind)
        left = max(self.n_left + n, 0.0)
        to_come = self.modes * sum_of_powers(self.fading, math.log2(1.0 + left / self.before))
        return max(self.least, self.seconds + n * self.per_revolution + to_come)

    def _behind(self, usual: float) -> float:
        if self.per_revolution == 0.0:
            return 0.0
        if self.n_behind < max(self.lengths[:1], default=1):
            return usual
        likely = (n for n in self.lengths if n > self.n_behind / _REPEATED)
        return float(max(next(likely, 0), self.n_behind))


class FollowedCase:
    """A case, run part by part.

    Attributes
    ----------
    setup : Setup
        What it shares with other cases.
    seconds : float, s
        What its parts have taken, contact modes included.
    modes : float, s
        What contact modes took of it, where it has one stator.
    a_mode : float, s
        About what a contact mode takes.
    is_whole, is_irregular : bool
        Whether it was run to its end, and whether it still met new contact modes where it was left.
    n_behind : int
        Revolutions that were followed behind the record.
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
        self._pace = 0.0  # s a revolution of the latest part, without its contact modes
        self._met = ModesToCome()
        self._part = 1  # revolutions of the first part
        self._cut = 0.0  # s, after which the next part was cut off, without its contact modes
        self._cut_behind = 0  # revolutions behind the record by then

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

        A motion may come to a whip after most of its transient, and then takes twenty times as long.

        Parameters
        ----------
        steps : float
            Predicted, of the whole case.
        n_behind : float
            Revolutions that are likely to be followed behind the record.
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
        """Revolutions of the next part; 0 where the transient has been passed."""
        return min(max(self._part, self._n_passed), self._recording.longest_transient - self._n_passed)

    def _is_worth(self, n: float, limit: float) -> bool:
        """Whether so many revolutions more are within a limit, s, or cost little beside those before."""
        more = self._seconds_of(n)
        return self.seconds + more <= limit or more <= _LITTLE * self.seconds

    def _seconds_of(self, n: float) -> float:
        """About what so many revolutions more take, with the contact modes that they meet."""
        further = max(self._n_passed + n - self._met.revolutions, 0.0)
        return n * self._pace + self.a_mode * self._met.to_come(further)

    @property
    def seconds_of_next(self) -> float:
        """About what `go_on` takes, behind the record nothing."""
        return self._seconds_of(self._next or self._recording.revolutions)

    def go_on(self, limit: float) -> bool:
        """Run the next part, as long as all before, or what is left; False where that took over `limit` s."""
        if n := self._next:
            return self._pass(n, limit)
        self.finish(limit)
        return self.is_whole

    def run_at_once(self) -> None:
        """Run it whole; once more where that takes little, for what contact modes take."""
        self.finish(math.inf)
        if self.seconds < _LONG and not self.is_in_ring:
            again, _ = self._timed(self._recording, math.inf)
            self.modes = max(self.seconds - again, 0.0)

    def forecast(self) -> Forecast:
        """What it will take, from where it was left."""
        if self.is_whole:
            return Forecast(self.seconds)
        recording = self._recording
        n_left = recording.longest_transient - self._n_passed + recording.revolutions
        least = self.seconds + self._cut
        if self._cut_behind:  # it was cut off there
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
        """Pass some revolutions of the transient; False where that was cut off."""
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
        """Take in new contact modes by these revolutions."""
        self._met.enter(revolutions, n_new)
        self.is_irregular = self._met.is_growing

    def _leave(self, taken: float, before: int) -> None:
        """Take in a part that was cut off, with so many contact modes solved before: they stay solved."""
        n_new = self.n_solved - before
        self._meet(2 * max(self._n_passed, 1), n_new)
        modes = min(n_new * self.a_mode, (1.0 - _LATE) * taken)
        self.seconds += modes
        self._cut = taken - modes

    def finish(self, limit: float) -> None:
        """Run what is left of it at once, unless that takes more than `limit` s."""
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
        """Time of a revolution from where it was left, s, as many recorded as in the case."""
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


def n_motion(setup: Setup) -> int:
    """Motions that are followed behind the record: one with its tangent, or two side by side."""
    return 1 if getattr(march_of(setup.scheme, setup), "has_closed_form", False) else 2


def lengths_behind(setup: Setup, recording: Recording) -> tuple[int, ...]:
    """Revolutions for which a motion without a period is followed behind its record, one of these."""
    if recording.revolutions < LEAST_REVOLUTIONS:
        return ()
    known = recording.revolutions // SPAN if n_motion(setup) == 1 else 0  # spans: a tangent has those before
    return tuple(SPAN * max(N_ALIGNING + n - known, 0) for n in (N_FIRST, N_ALL, N_MOST))


def usual_behind(setup: Setup, recording: Recording) -> float:
    """Revolutions behind the record of a case that takes long, where no other has shown more.

    Set by trial: of six whips in a ring under Coulomb's law the tangents of five were carried over the first
    length; two motions in short steps showed chaos within theirs.
    """
    lengths = lengths_behind(setup, recording)
    if not lengths:
        return 0.0
    return 0.25 * lengths[0] + 0.75 * lengths[1] if n_motion(setup) == 1 else lengths[0]


def is_ring(setup: Setup) -> bool:
    """Whether cases meet many sets of contacts."""
    return len(setup.model.stators) > 1


def n_solved(setup: Setup, case: Case) -> int:
    """Contact modes that cases of this friction have had solved so far."""
    return setup.n_solved(case.friction) if isinstance(setup, ModalSetup) else 0


def _passing(recording: Recording, n: int) -> Recording:
    """So many revolutions, the last of them recorded."""
    return replace(recording, transient=n - 1, revolutions=1)
