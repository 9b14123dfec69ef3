"""The time that a case takes which has been run in part."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from rubhpc.integrate.case import march_of
from rubhpc.integrate.lyapunov import N_ALIGNING, SPAN
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS, N_ALL, N_FIRST, N_MOST
from rubhpc.running.modes_to_come import USUAL, sum_of_powers

if TYPE_CHECKING:
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.study import Recording

_REPEATED = 1.25  # of a length: two motions that replace a tangent align again


class Forecast(NamedTuple):
    """Predicted time of a case that has not been run whole.

    Attributes
    ----------
    seconds, per_revolution : float, s
        Up to the end of the record, and for each revolution that is followed after it.
    least : float, s
        Least time.
    modes, fading : float, s
        Of contact modes that the last doubling of its revolutions met, and the ratio of the next to these.
    before : float
        Revolutions up to that doubling.
    n_left : float
        Revolutions from there to the end of the record.
    n_behind : int
        Least revolutions after the record.
    lengths : tuple of int
        Possible revolutions after a record (`lengths_behind`).
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
        """Time of the case, s, with so many revolutions followed after its record.

        Where it still meets contact modes, each doubling of its revolutions is assumed to meet a share of
        those of the last (`ModesToCome`).
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


def n_motion(setup: Setup) -> int:
    """Motions that are followed after the record: one with its tangent, or two."""
    return 1 if getattr(march_of(setup.scheme, setup), "has_closed_form", False) else 2


def lengths_behind(setup: Setup, recording: Recording) -> tuple[int, ...]:
    """Possible revolutions for which a motion without a period is followed after its record."""
    if recording.revolutions < LEAST_REVOLUTIONS:
        return ()
    known = recording.revolutions // SPAN if n_motion(setup) == 1 else 0  # spans: a tangent has those before
    return tuple(SPAN * max(N_ALIGNING + n - known, 0) for n in (N_FIRST, N_ALL, N_MOST))


def usual_behind(setup: Setup, recording: Recording) -> float:
    """Default number of revolutions after the record of a long case.

    Set by trial: of six whips in a ring under Coulomb's law the tangents of five needed more than the first
    length; two motions in short steps showed chaos within it.
    """
    lengths = lengths_behind(setup, recording)
    if not lengths:
        return 0.0
    return 0.25 * lengths[0] + 0.75 * lengths[1] if n_motion(setup) == 1 else lengths[0]
