"""A motion as its linear pieces: from one event to the next, at times found to rounding."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.marches.closed_form import closed_form_march
from rubhpc.integrate.marches.event_driven import NoClosedForm
from rubhpc.kernels._jit import plain
from rubhpc.kernels.case_progress import closed_pairs
from rubhpc.kernels.event_steps import GAP_TOLERANCE
from rubhpc.kernels.flow import next_event
from rubhpc.kernels.friction_states import STUCK, state_of
from rubhpc.kernels.laws import is_set_valued

if TYPE_CHECKING:
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import ModalSetup

Floats = NDArray[np.float64]
Change = Literal["touch", "release", "slip", "stick"]

MOST_EVENTS = 1000  # in a revolution
NO_PAIR, NO_SPEED = np.zeros(0, dtype=np.int64), np.zeros(0)
STEPS_PER_REVOLUTION = 128  # at least, so that no turn of a gap between two steps is missed


class Unfollowed(Exception):  # noqa: N818 - a state of the motion, never seen by users
    """A motion that cannot be followed from event to event: its text says why."""


class Piece(NamedTuple):
    """Motion in one contact mode, m coordinates, n reduced degrees.

    Attributes
    ----------
    states : int
        Set of closed pairs, or of the states of all pairs under set-valued friction.
    begin, duration : float, s
        Since the shaft passed its angle 0, and until the event or the end of the revolution.
    crossing : int
        Bits of the switch functions that vanish at the end; 0 where the revolution ends.
    begun, ended : (2, m)
        Coordinates at the beginning, and at the end before the event.
    before, after : (2 n,)
        Reduced displacements and velocities at the end, before and after the event.
    touching, approach : (k,)
        Pairs whose gaps close at the end, and their speeds of approach, m/s.
    states_after : int
        What goes on.
    """

    states: int
    begin: float
    duration: float
    crossing: int
    begun: Floats
    ended: Floats
    before: Floats
    touching: NDArray[np.int64]
    approach: Floats
    after: Floats
    states_after: int


class Mode(NamedTuple):
    """A contact mode as pieces need it: m coordinates, n reduced degrees."""

    place: int  # in the tables
    is_closed: NDArray[np.bool_]  # (q,)
    is_open: NDArray[np.bool_]  # (q,), watched for its gap
    floor: Floats  # (n_switch,), below which a switch function is negative
    exponent: Floats  # (2, m), 1/s, real and imaginary
    drift: Floats  # (m,), 1/s
    shape_re: Floats  # (2 n, m), motion of unit coordinates
    shape_im: Floats
    enter_re: Floats  # (2 n, m), coordinates of a unit motion
    enter_im: Floats
    steady: Floats  # (2, m), coordinates of no motion at all, but for those of the unbalance response
    cosine: Floats  # (2, m), to be added times the cosine of the shaft's angle
    sine: Floats  # (2, m), times its sine


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
    """

    def __init__(self, setup: ModalSetup, clearance: float, friction: float, initial: State) -> None:
        """Take a case in closed form; `NoClosedForm` where it has none."""
        self.has_states = plain(is_set_valued)(setup.law)
        self.march = closed_form_march(setup)(setup, clearance, friction, initial, None)
        self.setup = setup
        self.turn = setup.interval * setup.samples_per_revolution
        self.bodies = self.march.bodies
        self.n, self.q = self.bodies.stiffness.shape[0], len(setup.model.stators)
        self.rim_speed = np.array([stator.radius for stator in setup.model.stators]) * abs(setup.spin)
        self.n_switch = self.march.tables.switch_re.shape[1]
        self._modes: dict[int, Mode] = {}
        self._tables = self.march.tables
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
        if states not in self._modes:
            if not np.any(self.march.tables.mask == states):
                try:
                    self.march.find(states)
                except NoClosedForm:
                    raise Unfollowed("more sets of closed contacts than can be tabulated") from None
            if self.march.tables is not self._tables:  # rows may have been given to other modes
                self._modes.clear()
                self._tables = self.march.tables
            self._modes[states] = self._read(states)
        return self._modes[states]

    def enter(self, mode: Mode, time: float, motion: Floats) -> Floats:
        """Coordinates (2, m) in a contact mode of a motion (2 n,) at a time, s, after the angle 0."""
        angle = self.setup.spin * time
        z = math.cos(angle) * mode.cosine + math.sin(angle) * mode.sine + mode.steady
        z[0] += motion @ mode.enter_re
        z[1] += motion @ mode.enter_im
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
        least_gap, least_force = np.full((2, self.q), np.inf)
        while True:
            mode = self.mode(states)
            tables = self._tables
            begun, z = self.enter(mode, time, motion), np.empty_like(mode.exponent)
            turned = np.full(self.n_switch, np.inf)
            duration, crossing = next_event(
                mode.place,
                tables.switch_re,
                tables.switch_im,
                tables.rate_re,
                tables.rate_im,
                tables.bound,
                tables.power_re,
                tables.power_im,
                mode.exponent,
                mode.drift,
                mode.floor,
                clock.tick,
                clock.search_level,
                self._longest,
                stop - time,
                begun,
                z,
                turned,
            )
            if turned.min() < np.inf:
                lowest = turned[:: self.n_switch // self.q]
                least_gap = np.where(mode.is_open, np.minimum(least_gap, lowest), least_gap)
                least_force = np.where(mode.is_closed, np.minimum(least_force, lowest), least_force)
            before = mode.shape_re @ z[0] - mode.shape_im @ z[1]
            touching, approach, after, states_after = NO_PAIR, NO_SPEED, before, states
            if crossing:
                if self.march.is_beyond(before):
                    raise Unfollowed(f"a displacement passes {self.setup.displacement_limit:.3g} m")
                touching, approach = self._touch(mode, crossing, z)
                after = before.copy()
                angle = self.setup.spin * (time + duration)
                states_after = self.march.change(states, crossing, angle, after)
                if states_after < 0:
                    raise Unfollowed("no contact forces that obey the laws were found")
            pieces.append(
                Piece(
                    states=states,
                    begin=time,
                    duration=duration,
                    crossing=crossing,
                    begun=begun,
                    ended=z,
                    before=before,
                    touching=touching,
                    approach=approach,
                    after=after,
                    states_after=states_after,
                )
            )
            time, motion, states = time + duration, after, states_after
            if not crossing:
                return Revolution(
                    pieces=pieces, end=motion, states=states, least_gap=least_gap, least_force=least_force
                )
            if len(pieces) > most_events:
                raise Unfollowed(f"more than {most_events} events in a revolution")

    def contact_force(self, states: int, motion: Floats) -> Floats:
        """Force of each pair (q,), N, at the angle 0; of a closed one at least the smallest number."""
        mode = self.mode(states)
        force = self.march.forces(mode.place, self.enter(mode, 0.0, motion))
        return np.where(mode.is_closed, np.maximum(force, np.finfo(float).tiny), 0.0)

    def gradient(self, mode: Mode, crossing: int) -> Floats:
        """Gradient (2 n,) by the motion of the first switch function that vanishes."""
        j = first_of(crossing)
        re, im = self._tables.switch_re[mode.place, j], self._tables.switch_im[mode.place, j]
        return np.asarray(mode.enter_re @ re - mode.enter_im @ im)

    def switch(self, mode: Mode, crossing: int, re: Floats, im: Floats) -> float:
        """First switch function that vanishes, of coordinates (m,), real and imaginary."""
        j = first_of(crossing)
        return float(self._tables.switch_re[mode.place, j] @ re - self._tables.switch_im[mode.place, j] @ im)

    def rate_begun(self, piece: Piece) -> Floats:
        """Rate (2 n,) of the motion at the beginning of a piece."""
        return rate_of(self.mode(piece.states), piece.begun)

    def rate_ended(self, piece: Piece) -> Floats:
        """Rate (2 n,) of the motion at the end of a piece, before the event."""
        return rate_of(self.mode(piece.states), piece.ended)

    def switch_rate(self, piece: Piece) -> float:
        """Rate of the first switch function that vanishes at the end of a piece, its unit per second."""
        mode, j = self.mode(piece.states), first_of(piece.crossing)
        re, im = self._tables.rate_re[mode.place, j], self._tables.rate_im[mode.place, j]
        return float(re @ piece.ended[0] - im @ piece.ended[1])

    def unit_clearance(self, mode: Mode) -> tuple[Floats, Floats]:
        """What a clearance greater by 1 m at every pair adds to coordinates (m,), real and imaginary."""
        first = self._tables.n_eigenmode[mode.place]
        re, im = -self._tables.enter_constant[mode.place, : self.q].sum(axis=0)
        re[first], im[first] = 0.0, 0.0
        re[first + 1 : first + 1 + self.q] = 1.0
        return re, im

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

    def _read(self, states: int) -> Mode:
        """Take a mode from the tables."""
        place, tables = int(np.flatnonzero(self._tables.mask == states)[0]), self._tables
        exponent, drift = self.march.exponents(states)
        is_closed = self.march.closed(states)
        floor = np.where(is_closed, 0.0, -GAP_TOLERANCE)
        if self.n_switch > self.q:
            floor = np.stack([floor, np.where(is_closed, 0.0, -np.inf)], axis=1).ravel()
        clearance, first = self.bodies.clearance, tables.n_eigenmode[place]
        steady = -np.tensordot(clearance, tables.enter_constant[place], 1)
        cosine, sine = -tables.enter_cosine[place], -tables.enter_sine[place]
        cosine[:, first], sine[:, first], steady[:, first] = (1.0, 0.0), (0.0, 1.0), 0.0
        steady[0, first + 1 : first + 1 + clearance.size] = clearance
        return Mode(
            place=place,
            is_closed=is_closed,
            is_open=self.march.opened(states),
            floor=floor,
            exponent=exponent,
            drift=drift,
            shape_re=tables.motion_re[place],
            shape_im=tables.motion_im[place],
            enter_re=tables.enter_re[place],
            enter_im=tables.enter_im[place],
            steady=steady,
            cosine=cosine,
            sine=sine,
        )

    def _touch(self, mode: Mode, crossing: int, z: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Pairs whose gaps close at an event, and their speeds of approach, m/s."""
        stride, tables = self.n_switch // self.q, self._tables
        found = [i for i in range(self.q) if crossing >> stride * i & 1 and mode.is_open[i]]
        if not found:
            return NO_PAIR, NO_SPEED
        pairs = np.array(found)
        rows = stride * pairs
        return pairs, tables.rate_im[mode.place, rows] @ z[1] - tables.rate_re[mode.place, rows] @ z[0]


def first_of(crossing: int) -> int:
    """Index of the lowest bit."""
    return (crossing & -crossing).bit_length() - 1


def rate_of(mode: Mode, z: Floats) -> Floats:
    """Rate (2 n,) of the motion with coordinates (2, m)."""
    growth, turning = mode.exponent
    re = growth * z[0] - turning * z[1] + mode.drift
    return np.asarray(mode.shape_re @ re - mode.shape_im @ (growth * z[1] + turning * z[0]))
