"""A case in its transient: its last revolutions, and where it goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.measuring.orbit_measures import LONGEST_PERIOD
from rubhpc.integrate.transient import idle_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.marches.modal import ModalMarch, Place
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.solved_motion import SolvedMotion
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]

AT_ONCE = 1024  # revolutions in one call
LEADING = 16  # periods before a search that determine its start
KEPT = LEADING * LONGEST_PERIOD  # revolutions whose ends are kept


class Passed(NamedTuple):
    """A finished transient, or the end of the case in it."""

    march: ModalMarch  # from which the case continues
    reason: str | None  # why it cannot continue
    n_revolution: int  # simulated
    n_step: int  # steps before the march was begun anew
    motion: SolvedMotion | None  # on which the case continues


class TransientCase:
    """A case in its transient.

    Attributes
    ----------
    march : ModalMarch
    n_revolution, n_step : int
        Revolutions simulated, and steps before the last restart of the march.
    passed : (k, 2 n)
        Motions at the ends of the last revolutions, the present one last.
    states : int
        Present states of the pairs.
    """

    def __init__(self, march: ModalMarch, recording: Recording) -> None:
        """Start at the beginning of a march."""
        self.march, self._recording = march, recording
        self._idle = idle_of(march)
        self.n_revolution = self.n_step = 0
        self.states = march.pair_states
        self.passed = march.motion()[np.newaxis]
        self._place: tuple[ModalSetup, Place] | None = None  # where to begin before continuing

    @property
    def n_left(self) -> int:
        """Revolutions until the longest transient."""
        return self._recording.longest_transient - self.n_revolution

    def simulate(self, n_revolution: int) -> str | None:
        """Continue, at most to the longest transient; returns why the case cannot."""
        left = min(n_revolution, self.n_left)
        while left > 0:
            now = min(left, AT_ONCE)
            self._begin()
            sections, reason = self.march.pass_sections(now, *self._idle)
            self.n_revolution, left = self.n_revolution + now, left - now
            if reason is not None:
                return reason
            self.passed = np.concatenate([self.passed, sections])[-KEPT - 1 :]
            self.states = self.march.pair_states
        return None

    def continue_at(self, setup: ModalSetup, place: Place) -> None:
        """Continue with another motion, or with the same one and tables that may have been refilled."""
        self._place = setup, place

    def stay(self) -> None:
        """Continue from here later, whatever the march is used for in between."""
        if self._place is None:
            self.continue_at(self.march.setup, self.march.reached())

    def ended(self, reason: str | None, motion: SolvedMotion | None = None) -> Passed:
        """The finished transient, with the march to continue from."""
        self._begin()
        return Passed(self.march, reason, self.n_revolution, self.n_step, motion)

    def _begin(self) -> None:
        if self._place is not None:
            self.n_step += self.march.n_step
            self.march.begin(*self._place)
            self._place = None
