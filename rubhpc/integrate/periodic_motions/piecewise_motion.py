"""A motion as its linear pieces: from one event to the next, at times found to rounding."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.periodic_motions.piece_mode import Mode, know, mode_of, unknown_modes
from rubhpc.integrate.periodic_motions.revolution import (
    Piece,
    Revolution,
    copied,
    cut,
    longer,
    whole_revolutions,
)
from rubhpc.integrate.periodic_motions.saltation import carried, monodromy
from rubhpc.integrate.periodic_motions.tolerances import TO_ROUNDING
from rubhpc.kernels.closed_form.flow import Timing, piece_room
from rubhpc.kernels.closed_form.revolutions import (
    BEYOND,
    FOLLOWED,
    FULL,
    MODE_UNKNOWN,
    PIECE,
    STATES,
    UNSOLVED,
    begin_passage,
    follow_revolutions,
    new_passage,
    piece_rows,
)
from rubhpc.kernels.closed_form.small_changes import ChangeRoom, change_room

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State

Floats = NDArray[np.float64]
Change = Literal["touch", "release", "slip", "stick"]

MOST_EVENTS, MANY_EVENTS = 1000, 2**14  # in a revolution; where it is followed without end
FEW_MODES = 4  # that others have read before, and that are read at once
FEW_PIECES = 32  # that there is room for at first
WITH_MODES = 2.2  # bytes of tables and modes, as solved and for pieces, over those of tables
STEPS_PER_REVOLUTION = 128  # at least, so that no turn of a gap between two steps is missed


class Unfollowed(Exception):  # noqa: N818 - a state of the motion, never seen by users
    """A motion that cannot be followed from event to event: its text says why."""


class PiecewiseMotion:
    """Follows motions of one case from the shaft's angle 0, revolution by revolution.

    Attributes
    ----------
    start, states : (2 n,)
        Where the case begins: its reduced motion, and its closed pairs.
    turn : float, s
        Duration of a revolution.
    energy : (2 n,)
        Twice the energy of unit motions, with the spin as their pace.
    highest, longest : int
        Level of the longest tabulated steps, and of those between which no turn of a gap is missed.

    Parameters
    ----------
    initial : State or None
        Where the case begins; `integrate.start.fit_to_gaps` makes it fit. None: where a march stands.
    march : EventDrivenMarch, optional
        Of the case, that is needed no more: it is started anew, unless it stands where the case begins.
    """

    is_exact: ClassVar[Literal[True]] = True
    tolerances: ClassVar = TO_ROUNDING

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State | None,
        march: EventDrivenMarch | None = None,
    ) -> None:
        """Take a case in closed form; `NoClosedForm` where it has none."""
        if march is None:
            assert initial is not None
            march = EventDrivenMarch(setup, clearance, friction, initial, None)
        elif initial is not None:
            march.start_again(initial)
        self.march = march
        self.setup = setup
        self.turn = setup.interval * setup.samples_per_revolution
        self.bodies = self.march.bodies
        self.n, self.q = self.bodies.stiffness.shape[0], len(setup.model.stators)
        self.energy = np.ones(2 * self.n)
        self.energy[: self.n] = setup.spin**2
        self._modes: dict[int, Mode] = {}
        self._change_rooms: dict[tuple[int, int], ChangeRoom] = {}
        self._take_tables()
        self._rows = piece_rows(FEW_PIECES, 2 * self.n, self.q)
        self._passage = new_passage(2 * self.n)
        self._asked: tuple[int, float, float, int] | None = None
        clock = self.march.clock
        self.highest = self._tables.power_re.shape[1] - 1
        self.longest = min(self.highest, int(math.log2(self.turn / STEPS_PER_REVOLUTION / clock.tick)))
        self.start, self.states = self.march.motion(), self.march.mask
        self.stand_at(self.start, self.states)

    def size(self, motion: Floats) -> float:
        """Root of v'v + spin^2 u'u of a reduced motion (2 n,), in which the mass matrix is the identity."""
        velocity, displacement = motion[self.n :], self.setup.spin * motion[: self.n]
        return math.sqrt(velocity @ velocity + displacement @ displacement)

    @property
    def nbytes(self) -> float:
        """Bytes of its tables and modes."""
        return WITH_MODES * sum(table.nbytes for table in self.march.tables if isinstance(table, np.ndarray))

    def mode(self, states: int) -> Mode:
        """Contact mode with these states, solved where it is new.

        Raises
        ------
        Unfollowed
            The case meets more modes than can be tabulated.
        """
        if self.march.tables is not self._tables:  # rows may have been given to other modes
            self._take_tables()
        if states not in self._modes:
            if not np.any(self.march.tables.mask == states):
                try:
                    self.march.find(states)
                except NoClosedForm:
                    raise Unfollowed("more sets of closed contacts than can be tabulated") from None
            if self.march.tables is not self._tables:
                self._take_tables()
            self._modes[states] = mode = mode_of(self.march, states)
            know(self.known, mode)
        return self._modes[states]

    def enter(self, mode: Mode, time: float, motion: Floats) -> Floats:
        """Coordinates (2, m) in a contact mode of a motion (2 n,) at a time, s, after the angle 0."""
        angle, tables = self.setup.spin * time, mode.tables
        z = np.array([math.cos(angle), math.sin(angle), 1.0]) @ tables.offset
        z[0] += motion @ tables.enter_re
        z[1] += motion @ tables.enter_im
        return z

    def revolve(
        self,
        motion: Floats,
        states: int,
        most_events: int = MOST_EVENTS,
        *,
        phase: float = 0.0,
        share: float = 1.0,
    ) -> Revolution:
        """Follow a motion (2 n,) with the pairs in these states through one revolution.

        Parameters
        ----------
        phase : float
            Angle of the shaft where it begins, in revolutions.
        share : float
            Of a revolution that is followed.

        Raises
        ------
        Unfollowed
            A displacement passes its limit, no contact forces obey the laws, or events follow without end.
        """
        return self.follow(motion, states, 1, most_events, phase=phase, share=share)[0]

    def follow(
        self,
        motion: Floats,
        states: int,
        n_revolution: int,
        most_events: int = MOST_EVENTS,
        *,
        phase: float = 0.0,
        share: float = 1.0,
    ) -> list[Revolution]:
        """Follow a motion through several revolutions, each as `revolve` does."""
        least = np.full((n_revolution, 2, self.q), np.inf)
        n_piece = self._follow(
            motion, states, least, self.timing(most_events, phase, share, longest=self.longest)
        )
        return whole_revolutions(copied(self._rows, n_piece), least)

    def _follow(self, motion: Floats, states: int, least: Floats, timing: Timing) -> int:
        """Follow a motion through as many revolutions as `least` (r, 2, q) has; return its pieces."""
        passage = self._passage
        begin_passage(passage, motion, states, timing.begin)
        outcome = MODE_UNKNOWN
        while outcome != FOLLOWED:
            if outcome == MODE_UNKNOWN:
                self.mode(int(passage.reached[STATES]))
            elif outcome == FULL:
                self._rows = longer(self._rows)
            else:
                raise Unfollowed(self.why_unfollowed(outcome, timing.most_events))
            outcome = follow_revolutions(
                self.known,
                self.bodies,
                self.room,
                timing,
                passage,
                self._rows,
                least,
                *self.march.change_work,
            )
        return int(passage.reached[PIECE])

    def timing(self, most_events: int, phase: float = 0.0, share: float = 1.0, *, longest: int) -> Timing:
        """Times of a share of a revolution from a phase on, in steps up to a level; the last one is kept."""
        asked, clock = (most_events, phase, share, longest), self.march.clock
        if self._asked != asked:
            self._asked = asked
            self._timing = Timing(
                spin=self.setup.spin,
                tick=clock.tick,
                search_level=clock.search_level,
                longest_level=longest,
                begin=phase * self.turn,
                end=(phase + share) * self.turn,
                moment=self.march.moment,
                most_events=most_events,
            )
        return self._timing

    def why_unfollowed(self, outcome: int, most_events: int) -> str:
        """Why a motion is not followed further, by the outcome of a kernel."""
        if outcome == BEYOND:
            return f"a displacement passes {self.setup.displacement_limit:.3g} m"
        if outcome == UNSOLVED:
            return "no contact forces that obey the laws were found"
        return f"more than {most_events} events in a revolution"

    def monodromy(self, revolutions: Sequence[Revolution]) -> Floats:
        """Derivative (2 n, 2 n) of a motion's end by its beginning."""
        return monodromy(self, revolutions)

    def stand_at(self, motion: Floats, states: int) -> None:
        """Stand at the shaft's angle 0 with a motion (2 n,) and the pairs in these states."""
        self._stands = motion, states

    def go_on(self, columns: Floats, n_revolution: int = 1) -> Floats:
        """Go on by some revolutions; return what small changes (2 n, k) of the motion become.

        Raises
        ------
        Unfollowed
            As `revolve`.
        """
        least = np.full((n_revolution, 2, self.q), np.inf)
        n_piece = self._follow(*self._stands, least, self.timing(MANY_EVENTS, longest=self.highest))
        passage = self._passage
        self._stands = passage.motion.copy(), int(passage.reached[STATES])
        return carried(self, cut(self._rows, 0, n_piece), columns)

    def change_room(self, k: int) -> ChangeRoom:
        """Room in which k small changes are carried; the same each time."""
        width = self._tables.switch_re.shape[2]
        if (width, k) not in self._change_rooms:
            self._change_rooms[width, k] = change_room(width, self.n, self.q, k)
        return self._change_rooms[width, k]

    def contact_force(self, states: int, motion: Floats) -> Floats:
        """Force of each pair (q,), N, at the angle 0; of a closed one at least the smallest number."""
        mode = self.mode(states)
        force = self.march.forces(mode.place, self.enter(mode, 0.0, motion))
        return np.where(mode.is_closed, np.maximum(force, np.finfo(float).tiny), 0.0)

    def what_changes(self, piece: Piece) -> list[tuple[int, Change]]:
        """Pairs that an event at the end of a piece concerns, and what becomes of them."""
        was, is_closed = self.mode(piece.states).is_closed, self.mode(piece.states_after).is_closed
        found: list[tuple[int, Change]] = []
        for i in range(self.q):
            if i in piece.touching:
                found.append((i, "touch"))
            if was[i] and not is_closed[i]:
                found.append((i, "release"))
        return found

    def _take_tables(self) -> None:
        self._modes.clear()
        self._tables = self.march.tables
        width = self._tables.switch_re.shape[2]
        self.room = piece_room(self.q, width)
        self.known = unknown_modes(self._tables)
        if len(self.march.derived) <= FEW_MODES:  # kernels would ask for them one by one
            for states in sorted(self.march.derived.keys() & set(self._tables.mask.tolist())):
                self.mode(states)
