"""A case from event to event under set-valued friction, in closed form between slip, stick and flight."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.marches.contact_stepping import ContactSteppingMarch
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.march import NO_FORCES
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.marches.short_steps import ShortSteps
from rubhpc.integrate.marches.workspace import empty_workspace
from rubhpc.integrate.record import State
from rubhpc.integrate.reduced_model.friction_mode import mask_of, states_of
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
from rubhpc.kernels.event_forces import friction_work
from rubhpc.kernels.friction_change import change_states
from rubhpc.kernels.friction_loop import advance_with_friction
from rubhpc.kernels.friction_pieces import AT_REST, LEAST_FORCE, advance_friction_pieces
from rubhpc.kernels.friction_sections import advance_friction_sections
from rubhpc.kernels.friction_spans import new_spans
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, MOST_PAIRS, OPEN, STUCK, FrictionBodies
from rubhpc.kernels.trail import BROKEN
from rubhpc.kernels.transitions import NO_TRANSITIONS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.modal import Place
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.contact_pairs import Workspace
    from rubhpc.kernels.event_forces import FrictionWork
    from rubhpc.kernels.pieces import Pieces
    from rubhpc.kernels.trail import Trail
    from rubhpc.kernels.transitions import Transitions

    Floats = NDArray[np.float64]


class FrictionMarch(EventDrivenMarch):
    """A case whose pairs open, slide in either sense and stick.

    Where events follow one another without end, or no forces obey the laws, a millisecond is taken in short
    steps; then the case goes on from event to event.
    """

    most_pairs = MOST_PAIRS
    take_change = staticmethod(change_states)
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
        self._pulled: tuple[Floats, Floats, Floats] | None = None  # stiffness, and what follows from it
        super().__init__(setup, clearance, friction, initial, check)

    def begin(self, setup: ModalSetup, place: Place) -> None:
        """Begin anew at another speed, each pressed pair in the state that its forces give."""
        self._steps.forget()
        forget_earlier(self._work.earlier)
        super().begin(setup, place)

    def moved_by(self, mask: int) -> int:
        """What of a set of states decides how the bodies move: all of it, but whether pairs are lifted."""
        return mask & ((1 << 2 * self._clearance.size) - 1)

    def start_again(self, state: State) -> bool:
        """Start the same case anew at another state, with the contact modes that it has met."""
        self._steps.stop()
        forget_earlier(self._work.earlier)
        return super().start_again(state)

    @property
    def given(self) -> Floats:
        """Normal impulses and tractions (2, q), N s, of the last event that was taken by itself."""
        return self._work.given

    def _note_in(self, trail: Trail) -> None:
        self._work = self._work._replace(trail=trail)

    def closed(self, mask: int) -> NDArray[np.bool_]:
        """Which pairs are closed in a contact mode, (q,)."""
        return np.array([state != OPEN for state in states_of(mask, self._clearance.size)])

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

    @cached_property
    def _coefficients(self) -> tuple[Floats, Floats]:
        """Of sliding and of static friction, (q,)."""
        sliding = np.full(self._clearance.size, self._coefficient)
        return sliding, sliding * self._setup.law.static_friction_ratio

    @cached_property
    def _work(self) -> FrictionWork:
        """Room for events, and how the forces of pairs act on each other, which is so at any speed."""
        pairs, q = self._setup.friction_pairs(self._coefficient), self._clearance.size
        gap_jacobian, along = pairs.gap_jacobian, pairs.friction_direction
        solver = empty_workspace(q)
        solver.matrix[:], solver.coupling[:] = gap_jacobian @ gap_jacobian.T, gap_jacobian @ along.T
        solver.tangential[:] = -along @ gap_jacobian.T, -along @ along.T
        self._soften(solver)
        return friction_work(solver, q, gap_jacobian.shape[1])

    def _friction_bodies(self) -> FrictionBodies:
        """What friction asks of the bodies at the speed that they turn at."""
        bodies = self.bodies
        if self._pulled is None or self._pulled[0] is not bodies.stiffness:  # pieces of a run-up share it
            rows = np.vstack([bodies.gap_jacobian, bodies.slip])
            pull = np.hstack([rows @ bodies.stiffness, rows @ bodies.damping])
            self._pulled = bodies.stiffness, rows, pull
        _, rows, pull = self._pulled
        turned = np.empty((len(rows), 2))
        turned[:, 0], turned[:, 1] = rows @ bodies.force_cosine, rows @ bodies.force_sine
        return FrictionBodies(*self._coefficients, rim_speed=bodies.rim_speed, pull=pull, turned=turned)

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

    def _soften(self, solver: Workspace) -> None:
        """Change how normal forces follow from gaps: here they hold them, and nothing changes."""

    def _first_mask(self, contact_force: Floats) -> int:
        return self._states_after(contact_force > 0.0, 0.0)

    def _states_after(self, is_pressed: NDArray[np.bool_], angle: float, further: int = 0) -> int:
        """States that go on from the motion, with the shaft at an angle, rad, and some gaps closed.

        `further` are bits of the set of states beyond two a pair.
        """
        n, rim_speed = self.bodies.stiffness.shape[0], self._friction.rim_speed
        slips = rim_speed + self.bodies.slip @ self._motion[n:]
        states = []  # arrays would take longer for a few pairs, which a run-up asks of every piece
        for slip, speed, presses in zip(slips.tolist(), rim_speed.tolist(), is_pressed.tolist(), strict=True):
            sliding = FORWARD if slip >= 0.0 else BACKWARD
            states.append((STUCK if abs(slip) <= AT_REST * speed else sliding) if presses else OPEN)
        found = self.change(mask_of(states) | further, 0, angle, self._motion)
        if found < 0:
            raise NoClosedForm
        return found

    def change(
        self, mask: int, crossing: int, angle: float, motion: Floats, moment: float | None = None
    ) -> int:
        """Take an event: `motion` (2 n,) after it, in place, and the states that go on, or -1."""
        return int(
            self.take_change(
                self.bodies,
                self._friction,
                mask,
                crossing,
                self.moment if moment is None else moment,
                np.cos(angle),
                np.sin(angle),
                motion,
                False,
                self._work,
                self._unrecorded,
            )
        )

    def _advance_sections(self, samples: Samples, accumulator: Accumulator, sections: Floats) -> int:
        if self._steps.are_under_way:  # some short steps before events are followed again
            clock = self.clock
            per_revolution = clock.samples_per_revolution << clock.sample_level
            k = len(sections) + int(self.progress.tick) // per_revolution
            outcome = self._kernel((k + 1 - len(sections)) * per_revolution, samples, accumulator, False)
            if outcome == FINISHED:
                sections[k] = self.motion()
            return outcome
        outcome = self._advance_sections_in_closed_form(samples, accumulator, sections)
        if outcome == CONTACT_UNSOLVED:
            self._hand_over()
            return PAUSED
        return outcome

    def _advance_sections_in_closed_form(
        self, samples: Samples, accumulator: Accumulator, sections: Floats
    ) -> int:
        return advance_friction_sections(
            self.tables,
            self.bodies,
            self._friction,
            self.clock,
            self._setup.displacement_limit,
            self._setup.energy_limit,
            self._bare_progress,
            self._z,
            self._z_next,
            self._motion,
            self._work,
            self._recorder,
            samples,
            accumulator,
            sections,
            self.transitions,
        )

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
        return advance_with_friction(
            self.tables,
            self.bodies,
            self._friction,
            self.clock,
            last_tick,
            is_recorded,
            self._bare_progress,
            self._z,
            self._z_next,
            self._motion,
            self._work,
            self._recorder,
            samples,
            accumulator,
            self.transitions,
        )

    def _advance_pieces(self, pieces: Pieces, samples: Samples, sums: Accumulator) -> int:
        return advance_friction_pieces(
            self.tables,
            self.bodies,
            self._friction,
            self.clock,
            pieces,
            self._bare_progress,
            self._z,
            self._z_next,
            self._motion,
            self._work._replace(earlier=self._no_earlier),  # a mode is another one in the next piece
            self._recorder,
            samples,
            sums,
            NO_TRANSITIONS,
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

    def forces(self, mode: int, z: Floats) -> Floats:
        """Normal forces (q,), N, at coordinates (2, m) of a contact mode, by its index in the tables."""
        q, tables = self._clearance.size, self.tables
        value = (tables.switch_re[mode] @ z[0] - tables.switch_im[mode] @ z[1]).reshape(q, 2)
        force = np.zeros(q)
        for i, state in enumerate(states_of(int(tables.mask[mode]), q)):
            if state == OPEN:
                continue
            pressed, turned = value[i].tolist()
            if state == STUCK:
                pressed = 0.5 * (pressed + turned) / (float(self._friction.static[i]) or 1.0)
            force[i] = max(pressed, LEAST_FORCE)
        return force
