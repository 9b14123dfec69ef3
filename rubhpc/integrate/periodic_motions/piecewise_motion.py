"""A motion as its linear pieces: from one event to the next, at times found to rounding."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.marches.closed_form import closed_form_march
from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.periodic_motions.piece_mode import Mode, mode_of
from rubhpc.kernels._jit import plain
from rubhpc.kernels.case_progress import closed_pairs
from rubhpc.kernels.flow import BEFORE, GRADIENT, RATE_BEGUN, RATE_ENDED, follow_piece, piece_room
from rubhpc.kernels.friction_states import STUCK, state_of

if TYPE_CHECKING:
    from rubhpc.integrate.marches.event_driven import EventDrivenMarch
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State

Floats = NDArray[np.float64]
Change = Literal["touch", "release", "slip", "stick"]

MOST_EVENTS = 1000  # in a revolution
NO_PAIR, NO_SPEED, NO_IMPULSE = np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((2, 0))
STEPS_PER_REVOLUTION = 128  # at least, so that no turn of a gap between two steps is missed


class Unfollowed(Exception):  # noqa: N818 - a state of the motion, never seen by users
    """A motion that cannot be followed from event to event: its text says why."""


class Piece(NamedTuple):
    """Motion in one contact mode, n reduced degrees.

    Attributes
    ----------
    states : int
        Set of closed pairs, or of the states of all pairs under set-valued friction.
    begin, duration : float, s
        Since the shaft passed its angle 0, and until the event or the end of the revolution.
    crossing : int
        Bits of the switch functions that vanish at the end; 0 where the revolution ends.
    rate_begun, rate_ended : (2 n,)
        Rate of the motion at the beginning, and at the end before the event.
    before, after : (2 n,)
        Reduced displacements and velocities at the end, before and after the event.
    gradient : (2 n,)
        Of the first switch function that vanishes, by the motion; of no meaning where none does.
    switch_rate : float
        Its rate, its unit per second.
    touching, approach : (k,)
        Pairs whose gaps close at the end, and their speeds of approach, m/s.
    given : (2, q)
        Normal impulses of the event and tractions, N s.
    states_after : int
        What goes on.
    """

    states: int
    begin: float
    duration: float
    crossing: int
    rate_begun: Floats
    rate_ended: Floats
    before: Floats
    gradient: Floats
    switch_rate: float
    touching: NDArray[np.int64]
    approach: Floats
    given: Floats
    after: Floats
    states_after: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Revolution:
    """One revolution of the shaft, from angle 0 to angle 0 unless another was asked for.

    Attributes
    ----------
    pieces : list of Piece
        One more than there are events.
    end, states : (2 n,)
        Motion at the end, and the states then.
    least_gap, least_force : (q,), m, N
        Smallest gap and force of each pair where it turns between events; inf where it never does.
    """

    pieces: list[Piece]
    end: Floats
    states: int
    least_gap: Floats
    least_force: Floats


class PiecewiseMotion:
    """Follows motions of one case from the shaft's angle 0, revolution by revolution.

    Attributes
    ----------
    start, states : (2 n,)
        Where the case begins: its reduced motion, and the states of its pairs.
    turn : float, s
        Duration of a revolution.
    rim_speed : (q,), m/s
        Speed of each rim without vibration.

    Parameters
    ----------
    initial : State
        Where the case begins; `integrate.initial_state.fit_to_gaps` makes it fit.
    march : EventDrivenMarch, optional
        Of the case, that is needed no more: it is started anew.
    """

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        march: EventDrivenMarch | None = None,
    ) -> None:
        """Take a case in closed form; `NoClosedForm` where it has none."""
        made = closed_form_march(setup)
        self.has_states = issubclass(made, FrictionMarch)
        if march is None:
            march = made(setup, clearance, friction, initial, None)
        else:
            march.start_again(initial)
        self.march = march
        self.setup = setup
        self.turn = setup.interval * setup.samples_per_revolution
        self.bodies = self.march.bodies
        self.n, self.q = self.bodies.stiffness.shape[0], len(setup.model.stators)
        self.rim_speed = np.array([stator.radius for stator in setup.model.stators]) * abs(setup.spin)
        self.n_switch = self.march.tables.switch_re.shape[1]
        self.impacts: dict[bytes, tuple[Floats, Floats]] = {}  # those met (`saltation.Impact`)
        self._modes: dict[int, Mode] = {}
        self._take_tables()
        clock = self.march.clock
        self._longest = min(
            self._tables.power_re.shape[1] - 1, int(math.log2(self.turn / STEPS_PER_REVOLUTION / clock.tick))
        )
        self.start = self.march.motion_of(*self.march.place())
        self.states = plain(closed_pairs)(self.march.progress, self._tables)

    def size(self, motion: Floats) -> float:
        """Root of v'v + spin^2 u'u of a reduced motion (2 n,), in which the mass matrix is the identity."""
        velocity, displacement = motion[self.n :], self.setup.spin * motion[: self.n]
        return math.sqrt(velocity @ velocity + displacement @ displacement)

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
            self._modes[states] = mode_of(self.march, states)
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
        pieces: list[Piece] = []
        time, clock = phase * self.turn, self.march.clock
        stop = (phase + share) * self.turn
        least = np.full((2, self.q), np.inf)
        while True:
            mode = self.mode(states)
            motions, rates = np.empty((4, motion.size)), np.empty(self.n_switch)
            duration, crossing = follow_piece(
                mode.tables,
                self._room,
                motion,
                time,
                self.setup.spin,
                clock.tick,
                clock.search_level,
                self._longest,
                stop - time,
                self._coordinates,
                motions,
                rates,
                least,
            )
            before = motions[BEFORE]
            touching, approach, given, after, states_after = NO_PAIR, NO_SPEED, NO_IMPULSE, before, states
            if crossing < 0:
                raise Unfollowed(f"a displacement passes {self.setup.displacement_limit:.3g} m")
            if crossing:
                touching, approach = self._touch(mode, crossing, rates)
                after = before.copy()
                angle = self.setup.spin * (time + duration)
                states_after = self.march.change(states, crossing, angle, after)
                given = self.march.given.copy()
                if states_after < 0:
                    raise Unfollowed("no contact forces that obey the laws were found")
            pieces.append(
                Piece(
                    states=states,
                    begin=time,
                    duration=duration,
                    crossing=crossing,
                    rate_begun=motions[RATE_BEGUN],
                    rate_ended=motions[RATE_ENDED],
                    before=before,
                    gradient=motions[GRADIENT],
                    switch_rate=float(rates[first_of(crossing)]) if crossing else math.nan,
                    touching=touching,
                    approach=approach,
                    given=given,
                    after=after,
                    states_after=states_after,
                )
            )
            time, motion, states = time + duration, after, states_after
            if not crossing:
                return Revolution(
                    pieces=pieces, end=motion, states=states, least_gap=least[0], least_force=least[1]
                )
            if len(pieces) > most_events:
                raise Unfollowed(f"more than {most_events} events in a revolution")

    def contact_force(self, states: int, motion: Floats) -> Floats:
        """Force of each pair (q,), N, at the angle 0; of a closed one at least the smallest number."""
        mode = self.mode(states)
        force = self.march.forces(mode.place, self.enter(mode, 0.0, motion))
        return np.where(mode.is_closed, np.maximum(force, np.finfo(float).tiny), 0.0)

    def switch(self, mode: Mode, crossing: int, re: Floats, im: Floats) -> float:
        """First switch function that vanishes, of coordinates (m,), real and imaginary."""
        j = first_of(crossing)
        return float(mode.tables.switch_re[j] @ re - mode.tables.switch_im[j] @ im)

    def unit_clearance(self, mode: Mode) -> Floats:
        """What a clearance greater by 1 m at every pair adds to coordinates (2, m)."""
        return np.asarray(mode.unit_length[: self.q].sum(axis=0))

    def what_changes(self, piece: Piece) -> list[tuple[int, Change]]:
        """Pairs that an event at the end of a piece concerns, and what becomes of them."""
        was, is_closed = self.mode(piece.states).is_closed, self.mode(piece.states_after).is_closed
        found: list[tuple[int, Change]] = []
        for i in range(self.q):
            if i in piece.touching:
                found.append((i, "touch"))
            if was[i] and not is_closed[i]:
                found.append((i, "release"))
            elif self.has_states and was[i] and state_of(piece.states, i) != state_of(piece.states_after, i):
                found.append((i, "stick" if state_of(piece.states_after, i) == STUCK else "slip"))
        return found

    def _take_tables(self) -> None:
        self._modes.clear()
        self._tables = self.march.tables
        width = self._tables.switch_re.shape[2]
        self._room, self._coordinates = piece_room(self.n_switch, width), np.empty((2, 2, width))

    def _touch(self, mode: Mode, crossing: int, rates: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Pairs whose gaps close at an event, and their speeds of approach, m/s."""
        stride = self.n_switch // self.q
        found = [i for i in range(self.q) if crossing >> stride * i & 1 and mode.is_open[i]]
        if not found:
            return NO_PAIR, NO_SPEED
        pairs = np.array(found)
        return pairs, -rates[stride * pairs]


def first_of(crossing: int) -> int:
    """Index of the lowest bit."""
    return (crossing & -crossing).bit_length() - 1
