"""A case from event to event under set-valued friction, in closed form between slip, stick and flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.marches.contact_stepping import ContactSteppingMarch
from rubhpc.integrate.marches.march import NO_FORCES
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.marches.short_steps import ShortSteps
from rubhpc.integrate.marches.state_sets import StateSets
from rubhpc.integrate.measuring.samples import new_accumulator, stacked_accumulators
from rubhpc.integrate.record import State
from rubhpc.integrate.reduced_model.transitions import MetTransitions, TransitionRoom
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    FINISHED,
    PAUSED,
    ask_for,
    shaft_angle,
)
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE, ModeTables
from rubhpc.kernels.earlier_spans import earlier_spans, forget_earlier, no_earlier_spans
from rubhpc.kernels.friction_kernel import advance_friction
from rubhpc.kernels.friction_spans import new_spans
from rubhpc.kernels.pieces import NO_PIECES
from rubhpc.kernels.trail import BROKEN
from rubhpc.kernels.transitions import NO_TRANSITIONS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.modal import Place
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.event_forces import FrictionWork
    from rubhpc.kernels.pieces import Pieces
    from rubhpc.kernels.trail import Trail
    from rubhpc.kernels.transitions import Transitions

    Floats = NDArray[np.float64]

_NO_SECTIONS = np.zeros((0, 0))
_NO_RECORD = new_accumulator(0)
_NO_SUMS = stacked_accumulators(0, _NO_RECORD)


class FrictionMarch(StateSets):
    """A case whose pairs open, slide in either sense and stick.

    Where events follow one another without end, or no forces obey the laws, a millisecond is taken in short
    steps; then the case goes on from event to event.
    """

    _no_earlier = no_earlier_spans()

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`, each pressed pair in the state that its forces give."""
        self._steps = ShortSteps(
            lambda: ContactSteppingMarch(
                self._setup, clearance, friction, State.at_rest(self._setup.model), check
            )
        )
        self._transitions: Transitions | None = None
        super().__init__(setup, clearance, friction, initial, check)

    def begin(self, setup: ModalSetup, place: Place) -> None:
        """Begin anew at another speed, each pressed pair in the state that its forces give."""
        self._steps.forget()
        forget_earlier(self._work.earlier)
        super().begin(setup, place)

    def start_again(self, state: State) -> bool:
        """Start the same case anew at another state, with the contact modes that it has met."""
        self._steps.stop()
        forget_earlier(self._work.earlier)
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
        library = setup.friction_library(friction)
        room = library.transitions
        if room is not None and room.is_full:
            room = library.transitions = TransitionRoom()
        self._met, self._transitions = None if room is None else MetTransitions(room), None
        return library

    def find_wanted(self) -> None:
        """See that the tables hold the set of states, or the transition to it, that the kernel asks for."""
        before, wanted = self.mask, int(self._bare_progress["wanted"])
        is_known = wanted in self.tables.mask
        if self._met is None or not self._met.is_due(before, wanted, is_counted=is_known):
            super().find_wanted()
            return
        left, growing = self._tables_of(before, is_copied=not is_known), self.exponents(before)
        super().find_wanted()  # the mode wanted may take the other's place
        both = growing, self.exponents(wanted)
        self._met.tabulate(left, self._tables_of(wanted), both, self.bodies, self._friction)
        for before, after in self._met.nearly_due():  # each would end a kernel call
            for mask in (before, after):
                if mask not in self.tables.mask:
                    self.find(mask)
            modes = self._tables_of(before), self._tables_of(after)
            both = self.exponents(before), self.exponents(after)
            self._met.tabulate(*modes, both, self.bodies, self._friction)

    def _tables_of(self, mask: int, *, is_copied: bool = False) -> ModeTables:
        """The tables (1, ...) of a set of states that they hold."""
        place = self.tables.mask.tolist().index(mask)
        fields: list[Any] = [field[place : place + 1] for field in self.tables]
        fields = [field.copy() for field in fields] if is_copied else fields
        return ModeTables(*fields)

    @property
    def transitions(self) -> Transitions:
        """Transitions between the contact modes of the tables that this case takes often."""
        if self._met is None:
            return NO_TRANSITIONS
        if self._transitions is None:
            self._transitions = self._met.among(self.tables)
        return self._transitions

    def _use(self, tables: ModeTables) -> None:
        super()._use(tables)
        self._transitions = None
        if self._work.earlier.moved.size != self._z.shape[1]:
            self._work = self._work._replace(earlier=earlier_spans(self._z.shape[1], self._clearance.size))
        if self._recorder.spans.path.shape[1:] != self._z.shape:
            n_row = self._recorder.value.size // SAMPLES_AT_ONCE
            spans = new_spans(self._z.shape[1], self._clearance.size, n_row)
            self._recorder = self._recorder._replace(spans=spans)

    def _advance_sections(self, samples: Samples, accumulator: Accumulator, sections: Floats) -> int:
        if self._steps.are_under_way:  # some short steps before events are followed again
            clock = self.clock
            per_revolution = clock.samples_per_revolution << clock.sample_level
            k = len(sections) + int(self.progress.tick) // per_revolution
            outcome = self._kernel((k + 1 - len(sections)) * per_revolution, samples, accumulator, False)
            if outcome == FINISHED:
                sections[k] = self.motion()
            return outcome
        outcome = self._by_kernel(self._work, self.transitions, samples, accumulator, sections=sections)
        if outcome == CONTACT_UNSOLVED:
            self._hand_over()
            return PAUSED
        return outcome

    def _kernel(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        while True:
            if self._steps.are_under_way:
                outcome = self._step_on(last_tick, samples, accumulator, is_recorded)
                if outcome != FINISHED:
                    return outcome
            outcome = super()._kernel(last_tick, samples, accumulator, is_recorded)
            if outcome != CONTACT_UNSOLVED:
                return outcome
            self._hand_over()

    def _advance(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        return self._by_kernel(self._work, self.transitions, samples, accumulator, (last_tick, is_recorded))

    def _advance_pieces(self, pieces: Pieces, samples: Samples, sums: Accumulator) -> int:
        work = self._work._replace(earlier=self._no_earlier)  # a mode is another one in the next piece
        return self._by_kernel(work, NO_TRANSITIONS, samples, _NO_RECORD, pieces=pieces, sums=sums)

    def _by_kernel(
        self,
        work: FrictionWork,
        transitions: Transitions,
        samples: Samples,
        accumulator: Accumulator,
        to: tuple[int, bool] = (0, False),
        sections: Floats = _NO_SECTIONS,
        pieces: Pieces = NO_PIECES,
        sums: Accumulator = _NO_SUMS,
    ) -> int:
        """Advance by the kernel: through pieces, by sections, or `to` a tick, recorded or not."""
        return advance_friction(
            self.tables,
            self.bodies,
            self._friction,
            self.clock,
            *to,
            sections,
            self._setup.displacement_limit,
            self._setup.energy_limit,
            pieces,
            sums,
            self._bare_progress,
            self._z,
            self._z_next,
            self._motion,
            work,
            self._recorder,
            samples,
            accumulator,
            transitions,
        )

    def _hand_over(self) -> None:
        """Go over to short steps, from the motion at the tick reached."""
        self.n_left += 1
        self._work.trail.n_event[0] = BROKEN
        self._steps.take_over(self.clock, self.progress, self._recorder, self._motion)

    def _step_on(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        """Short steps as far as they are to go, or on until states go on; then these are wanted."""
        place = last_tick, self.clock, self.progress, samples, accumulator, self._motion
        while True:
            outcome, is_closed = self._steps.step_to(*place, is_recorded=is_recorded)
            if outcome != FINISHED:
                return outcome
            try:
                states = self._states_after(is_closed, shaft_angle(self.clock, self.progress.tick))
            except NoClosedForm:
                if self.progress.tick >= last_tick:
                    raise
                self._steps.prolong(self.clock)
            else:
                self._steps.stop()
                ask_for(self.progress, states)
                return outcome

    def _unsolved(self) -> str:
        return NO_FORCES
