"""A case from event to event under set-valued friction, in closed form between slip, stick and flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.collocation import CollocationMarch
from rubhpc.integrate.marches.interlude import Interlude
from rubhpc.integrate.marches.march import NO_FORCES
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.marches.state_sets import StateSets
from rubhpc.integrate.measuring.samples import new_accumulator, stacked_accumulators
from rubhpc.integrate.record import State
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    FINISHED,
    NO_SECTIONS,
    PAUSED,
    Sections,
    ask_for,
    shaft_angle,
)
from rubhpc.kernels.friction_kernel import advance_friction
from rubhpc.kernels.pieces import NO_PIECES
from rubhpc.kernels.sampling import Measured
from rubhpc.kernels.trail import BROKEN

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.modal import Place
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.pieces import Pieces
    from rubhpc.kernels.trail import Trail

    Floats = NDArray[np.float64]

_NO_RECORD = new_accumulator(0)
_NO_SUMS = stacked_accumulators(0, _NO_RECORD)


class FrictionMarch(StateSets):
    """A case whose pairs open, slide in either sense and stick.

    Where events follow one another without end, or no forces obey the laws, a millisecond is taken by
    collocation; then the case goes on from event to event.
    """

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`, each pressed pair in the state that its forces give."""
        self._interlude = Interlude(
            lambda: CollocationMarch(
                self._setup, clearance, friction, State.at_rest(self._setup.model), check
            )
        )
        super().__init__(setup, clearance, friction, initial, check)

    def begin(self, setup: ModalSetup, place: Place) -> None:
        """Begin anew at another speed, each pressed pair in the state that its forces give."""
        self._interlude.forget()
        super().begin(setup, place)

    def start_again(self, state: State) -> bool:
        """Start the same case anew at another state, with the contact modes that it has met."""
        self._interlude.stop()
        return super().start_again(state)

    def _note_in(self, trail: Trail) -> None:
        self._work = self._work._replace(trail=trail)

    def _find_library(self, setup: ModalSetup, friction: float) -> ModeLibrary:
        q = self._clearance.size
        if q > self.most_pairs:
            raise NoClosedForm
        self._entered_with = np.ones(q + 1)
        self._entered_with[:q] = self._clearance
        self.bodies = self.bodies._replace(clearance=self._entered_with)
        self._friction = self._friction_bodies()
        return setup.friction_library(friction)

    def _advance_sections(self, samples: Samples, accumulator: Accumulator, sections: Floats) -> int:
        if self._interlude.is_under_way:  # before events are followed again
            last_tick = self._end_of_revolution()
            outcome = self._kernel(last_tick, samples, accumulator, False)
            if outcome == FINISHED:
                sections[last_tick // self._per_revolution - 1] = self.motion()
            return outcome
        outcome = super()._advance_sections(samples, accumulator, sections)
        if outcome == CONTACT_UNSOLVED:
            self._hand_over()
            return PAUSED
        return outcome

    def _kernel(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        while True:
            if self._interlude.is_under_way:
                outcome = self._step_on(last_tick, samples, accumulator, is_recorded)
                if outcome != FINISHED:
                    return outcome
            outcome = super()._kernel(last_tick, samples, accumulator, is_recorded)
            if outcome != CONTACT_UNSOLVED:
                return outcome
            self._hand_over()

    def _advance_pieces(self, pieces: Pieces, samples: Samples, sums: Accumulator) -> int:
        return self._by_kernel(samples, _NO_RECORD, pieces=pieces, sums=sums)

    def _by_kernel(
        self,
        samples: Samples,
        accumulator: Accumulator,
        to: tuple[int, bool] = (0, False),
        sections: Sections = NO_SECTIONS,
        pieces: Pieces = NO_PIECES,
        sums: Accumulator = _NO_SUMS,
    ) -> int:
        """Advance by the kernel: through pieces, or `to` a tick, recorded or not, or by sections from it."""
        return advance_friction(
            self.tables,
            self.bodies,
            self._friction,
            self.clock,
            *to,
            pieces,
            sums,
            self._bare_progress,
            self._coordinates,
            self._work,
            Measured(self._recorder, samples, accumulator),
            sections,
        )

    def _hand_over(self) -> None:
        """Go over to collocation, from the motion at the tick reached."""
        self.n_left += 1
        self._work.trail.n_event[0] = BROKEN
        closed = self.closed(self.mask)
        self._interlude.take_over(self.clock, self.progress, self._recorder, self._motion, closed)

    def _step_on(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        """Collocation as far as it is to go, or on until states go on; then these are wanted."""
        place = last_tick, self.clock, self.progress, samples, accumulator, self._motion
        while True:
            outcome, is_closed = self._interlude.advance(*place, is_recorded=is_recorded)
            if outcome != FINISHED:
                return outcome
            try:
                states = self._states_after(is_closed, shaft_angle(self.clock, self.progress.tick))
            except NoClosedForm:
                if self.progress.tick >= last_tick:
                    raise
                self._interlude.prolong(self.clock)
            else:
                self._interlude.stop()
                ask_for(self.progress, states)
                return outcome

    def _unsolved(self) -> str:
        return NO_FORCES
