"""A case by the collocation integrator: any smooth gap and any law."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.marches.march import ALL_SAMPLES, NO_FORCES
from rubhpc.integrate.marches.modal import ModalMarch, slowest_fast
from rubhpc.integrate.measuring.samples import no_record
from rubhpc.integrate.overlaps import with_overlap
from rubhpc.kernels.case_progress import LONG_AGO, PAUSED, restart_clock, shaft_turn
from rubhpc.kernels.collocation.flight import GAP_BEFORE, LEAST_GAP
from rubhpc.kernels.collocation.march import LEAST_SCALE, SETTLED, advance_by_collocation
from rubhpc.kernels.collocation.observing import Seen
from rubhpc.kernels.collocation.structures import (
    ENDLESS,
    FORWARD,
    JAMMED,
    NORMAL,
    OPEN,
    SINGULAR,
    UNCONVERGED,
    CaseState,
    Solution,
    new_memory,
)
from rubhpc.kernels.collocation.tangent import FULL as TOO_MANY
from rubhpc.kernels.collocation.tangent import LOW, N_EVENT, PAIR, Trail
from rubhpc.kernels.sampling import Measured

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.integrate.marches.modal import Place
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State
    from rubhpc.integrate.reduced_model.flight_modes import FlightModes
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.accumulators import Accumulator, Samples

Floats = NDArray[np.float64]
STATE_BITS = 2  # of a pair in the number of all states
MOST_KEPT, ROOM = 64, 1 << 23  # matrices of each length of step where gaps are straight; bytes of all of them


def code_of(states: NDArray[np.int64]) -> int:
    """States of all pairs as one number."""
    return sum((int(state) & 3) << STATE_BITS * i for i, state in enumerate(states))


def states_of(code: int, q: int) -> NDArray[np.int64]:
    """States (q,) of a number: open, sliding forward or backward, sticking."""
    found = np.array([code >> STATE_BITS * i & 3 for i in range(q)])
    return np.where(found == 3, -1, found)


class Contacts(NamedTuple):
    """Contacts of a case at the end of a piece."""

    state: NDArray[np.int64]  # (q,)
    force: Floats  # (q, 2, s), N
    lasting: Floats  # (q,), s
    age: Floats  # (q,), s, of the states
    memory: NDArray[Any]  # (1,)


SOFTER = 'a softer contact (law = "penalty" or "hertz"), or another accuracy'
WHY = {  # a case cannot continue; then what may help
    0: "the motion diverges",
    JAMMED: "friction presses a closed gap further closed (Painleve's paradox); lower the friction",
    UNCONVERGED: "the contact forces of the shortest step were not found; set "
    f'friction_law = "coulomb" if friction is to end where slip does, {SOFTER}',
    ENDLESS: f"events follow without end; set {SOFTER}, lower the restitution, or give the stator more mass",
    SINGULAR: f"{NO_FORCES}; lower the friction, or set {SOFTER}",
}


class CollocationMarch(ModalMarch):
    """A case in the modes of the open system; contact forces are polynomials in each step."""

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`, with the contacts closed that its forces press."""
        super().__init__(setup, clearance, friction, initial, check)
        self._friction, self._at_clearance = friction, clearance
        self._seen: Seen | None = None
        self._sizes: tuple[object, ...] = ()
        self.accuracy = setup.accuracy
        self.trail: Trail | None = None  # of tangent and events, where one is kept
        self._use_modes(setup)
        self._begin(initial.contact_force)

    def _use_modes(self, setup: ModalSetup) -> None:
        """Take the modes of a set-up."""
        self._modes = setup.flight_modes
        self._contacts = self._modes.bodies(self._friction, self._clearance)
        sizes = self._modes.tables.free.shape, self._modes.n_local, self._modes.exponent.size
        if sizes != self._sizes:
            self._sizes, self._solution, self._seen = sizes, self._new_solution(), None

    def _begin(self, contact_force: Floats, turn: tuple[float, float] = (1.0, 0.0)) -> None:
        """Begin with the motion, at the shaft's `turn`; contacts are closed that forces (q,), N, press."""
        modes, s, q = self._modes, self._modes.nodes.at.size, self._clearance.size
        self._memory = new_memory()
        self._case = CaseState(
            x=modes.coordinates(self._motion, *turn),
            state=np.where(contact_force > 0.0, FORWARD, OPEN),
            force=np.zeros((q, 2, s)),
            lasting=np.zeros(q),
            since=np.zeros(q, dtype=np.int64),
        )
        self._case.force[:, NORMAL] = contact_force[:, None]
        self._memory["event_tick"], self._memory["is_new"] = LONG_AGO, 1
        self._memory["scale"] = max(LEAST_SCALE, float(contact_force.max(initial=0.0)))
        self._solution.states[:] = 0

    def begin(self, setup: ModalSetup, place: Place) -> None:
        """Begin anew at another speed in the same reduced coordinates, from where a march has come.

        Contacts are those of the place.
        """
        self.n_step, self.sample, self._stride = 0, 0, ALL_SAMPLES
        self._take(setup)
        self._motion[:] = self.moved(setup, place)
        shortest = self._modes.tables.first_level
        self._use_modes(setup)
        self._begin(place.contact_force)
        if place.contacts is not None:
            contacts = cast("Contacts", place.contacts)
            self._case.state[:], self._case.force[:] = contacts.state, contacts.force
            self._case.lasting[:] = contacts.lasting
            self._case.since[:] = -np.round(contacts.age / self.clock.tick).astype(np.int64)
            self._memory["is_new"] = 0
            for name in ("scale", "fastest", "unseen"):
                self._memory[name] = contacts.memory[name]
            slot = contacts.memory["slot"] + shortest - self._modes.tables.first_level
            self._memory["slot"] = np.clip(slot, 0, self._modes.tables.is_filled.size - 1)

    def reached(self) -> Place:
        """Present motion and contacts, for another speed to continue from."""
        case = self._case
        contacts = Contacts(
            state=case.state.copy(),
            force=case.force.copy(),
            lasting=case.lasting.copy(),
            age=(int(self.progress.tick) - case.since).astype(np.float64) * self.clock.tick,
            memory=self._memory.copy(),
        )
        return super().reached()._replace(contacts=contacts)

    @property
    def mask(self) -> int:
        """Set of contacts whose modes are the coordinates: none."""
        return 0

    @property
    def library(self) -> ModeLibrary:
        """Where the modes of a piece come from."""
        return self._setup.library(0.0)

    def reached_in(self) -> tuple[int, Floats]:
        """The set of contacts `mask`, and a copy of the modal coordinates (2, m), of which none is real."""
        return 0, self._case.x.reshape(2, -1).copy()

    def keep_fast(self, before: tuple[int, Floats], spin: float, since: float) -> None:
        """Let fast modes go on as they were before a piece (`ModalMarch.keep_fast`)."""
        z, fast = self._case.x.reshape(2, -1), np.abs(self._contacts.exponent) > slowest_fast(spin, since)
        fast[-1] = False  # the response to the unbalance
        z[:, fast] = before[1][:, : fast.size][:, fast]

    def start_again(self, state: State) -> bool:
        """Restart the same case at another state."""
        self._stride = ALL_SAMPLES
        self._begin_time()
        self._motion[:] = self.reduced(state)
        self._begin(state.contact_force)
        return True

    def place_at(self, motion: Floats, states: NDArray[np.int64], tick: int) -> None:
        """Stand at a tick with a motion (2 n,) and the pairs in their states (q,)."""
        self._begin_time()
        self._motion[:] = motion
        restart_clock(self._bare_progress, tick, 0, is_recorded=False)
        self._begin((states != OPEN).astype(float), shaft_turn(self.clock, tick))
        self._case.state[:], self._memory["is_new"] = states, SETTLED

    def carry(
        self, last_tick: int, columns: Floats, n_event: int, accuracy: float | None = None
    ) -> tuple[int, Trail]:
        """Go on to a tick with tangent columns (nx, k) and up to `n_event` events.

        Returns the outcome of the kernel, and the trail.
        """
        own, self.accuracy = self.accuracy, accuracy or self.accuracy
        trail = self.new_trail(columns, n_event)
        self.trail, (samples, accumulator) = trail, self._idle
        longest = self._modes.tangent_tables.is_filled.size - 1
        self._memory["slot"] = np.minimum(self._memory["slot"], longest)
        outcome = PAUSED
        while outcome == PAUSED and not trail.count[TOO_MANY]:
            outcome = self._kernel(last_tick, samples, accumulator, False)
            if self.check is not None:
                self.check()
        self.trail, self.accuracy = None, own
        np.minimum(trail.least[0], self._solution.turned[LEAST_GAP], out=trail.least[0])
        self._fill_constant(trail)
        self._solution.turned[[LEAST_GAP, GAP_BEFORE]] = np.inf
        return outcome, trail

    def _fill_constant(self, trail: Trail) -> None:
        """Note gaps and forces in bores that never turn, of pairs without events: the orbit is a circle."""
        is_constant = self._contacts.radius < 0.0
        is_constant[trail.event[: trail.count[N_EVENT], PAIR]] = False
        is_open = self.states == OPEN
        lasts = self._solution.turned[GAP_BEFORE], trail.swing[LOW]
        for least, last, is_so in zip(trail.least, lasts, (is_open, ~is_open), strict=True):
            np.copyto(least, last, where=is_constant & is_so & np.isinf(least))

    def pass_sections(
        self, n_revolution: int, samples: Samples, accumulator: Accumulator
    ) -> tuple[Floats, str | None]:
        """Go on by some revolutions without a record (`ModalMarch.pass_sections`)."""
        sections, per_revolution = (
            np.empty((n_revolution, self._motion.size)),
            self.clock.samples_per_revolution,
        )
        for i in range(n_revolution):
            first = (i - n_revolution) * per_revolution
            reason = self.advance(first, first + per_revolution, samples, accumulator, is_recorded=False)
            if reason is not None:
                return sections, reason
            sections[i] = self.motion()
        return sections, None

    @cached_property
    def _idle(self) -> tuple[Samples, Accumulator]:
        return no_record(self.n_place, self._clearance.size)

    @property
    def modes(self) -> FlightModes:
        """Flight modes at the present speed."""
        return self._modes

    @property
    def room(self) -> Solution:
        """What steps are solved in."""
        return self._solution

    @property
    def states(self) -> NDArray[np.int64]:
        """State of each pair, (q,)."""
        return self._case.state.copy()

    @property
    def pair_states(self) -> int:
        """States of all pairs as one number."""
        return code_of(self._case.state)

    def motion(self) -> Floats:
        """Reduced displacements, then velocities (2 n,), at the sample reached."""
        motion: Floats = self._modes.motion @ self._case.x
        return motion

    def state_of(self, motion: Floats, contact_force: Floats) -> State:
        """State of a reduced motion (2 n,), with the overlap of its gaps: springs press by it."""
        return with_overlap(super().state_of(motion, contact_force), self._setup, self._at_clearance)

    def touching(self) -> NDArray[np.bool_]:
        """Whether each pair is closed, (q,)."""
        is_closed: NDArray[np.bool_] = self._case.state != OPEN
        return is_closed

    def _contact_force(self) -> Floats:
        force = self._modes.nodes.power.T @ self._case.force[:, NORMAL].T  # powers
        last = (self._memory["part"] ** np.arange(len(force))) @ force
        return np.where(self.touching(), np.maximum(last, np.finfo(float).tiny), 0.0)

    @property
    def why(self) -> str:
        """Why the case cannot continue."""
        return WHY[int(self._memory["why"][0])]

    def _unsolved(self) -> str:
        return self.why

    def _new_solution(self) -> Solution:
        modes = self._modes
        n_y, n_x = modes.tables.free.shape[1:]
        k, s, q, nl = modes.tables.is_filled.size, modes.nodes.at.size, self._clearance.size, modes.n_local
        n_row, n, zeros = q * nl, 2 * s * q, np.zeros
        m = 1
        if self._contacts.is_straight:
            m = min(MOST_KEPT, max(1, ROOM // (8 * k * n * n)))
        else:
            n += q * (s - 1) * (nl - 1)
        return Solution(
            start=zeros(3 * n_row),
            y=zeros(n_y),
            y_free=zeros(n_y),
            place=zeros((s, n_row)),
            load=zeros(s * n_row),
            gap=zeros(s * q),
            curvature=zeros(s * q),
            unit=zeros((s * q, 2)),
            normal=zeros((s * q, nl)),
            tangent=zeros((s * q, nl)),
            normal_bend=zeros((nl, nl)),
            tangent_bend=zeros((nl, nl)),
            seen=zeros((s * q, 6)),
            slope=zeros((s * q, 4)),
            ratio=zeros((s * q, 2)),
            bent=zeros((s * q, 3, nl)),
            turning=zeros((s * q, nl, nl)),
            direction=zeros((s * q, 2, nl)),
            residual=zeros(n),
            answer=zeros(n),
            rows=zeros((n, 2 * n)),
            closed=zeros(q, dtype=np.int64),
            matrix=zeros((k * m, n, n)),
            states=zeros(k * m, dtype=np.int64),
            noise=zeros(k * m),
            used=zeros(2, dtype=np.int64),
            size=zeros(modes.exponent.size),
            change=zeros(n_y),
            moved=zeros((s, n_row)),
            begun=zeros(3 * n_row),
            pushed=zeros((q, 2, s)),
            changed=zeros((s, 6)),
            guess=zeros((q, 2, s)),
            weight=zeros(s),
            instant=zeros((q, 2)),
            turned=np.full((3, q), np.inf),
            looked=zeros(1, dtype=np.int64),
            touching=zeros(q, dtype=np.bool_),
            kept=zeros(q, dtype=np.bool_),
            bound=zeros(q, dtype=np.bool_),
            waiting=zeros(q, dtype=np.bool_),
            event=zeros((q, 2, s)),
            after=zeros(n_x),
            held=zeros(n_x),
            turn=zeros(modes.exponent.size, dtype=complex),
            impulse=zeros((q, 2)),
            speed=zeros((q, 2)),
        )

    def _new_seen(self, samples: Samples, accumulator: Accumulator) -> Seen:
        signals, s = self._modes.signals, self._modes.nodes.at.size
        if self._seen is not None and self._seen.read.size == signals.free.shape[1]:
            measured = self._seen.measured
            is_same = measured.samples is samples and measured.accumulator is accumulator
            if is_same and measured.recorder is self._recorder:
                return self._seen
            return self._seen._replace(measured=Measured(self._recorder, samples, accumulator))
        n_x = self._case.x.size
        return Seen(
            begun=np.zeros(n_x),
            moving=np.zeros(n_x),
            other=np.zeros(n_x),
            node=np.zeros((len(signals.value), s)),
            end_rate=np.zeros((2, signals.smooth.size)),
            factor=np.zeros((s, len(signals.power))),
            read=np.zeros(signals.free.shape[1]),
            part=np.zeros(s),
            measured=Measured(self._recorder, samples, accumulator),
        )

    def _kernel(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        modes = self._modes
        self._seen = self._new_seen(samples, accumulator)
        return advance_by_collocation(
            self._contacts,
            modes.nodes,
            modes.tables if self.trail is None else modes.tangent_tables,
            modes.signals,
            modes.power,
            self.clock,
            self.accuracy,
            last_tick,
            is_recorded,
            self._bare_progress,
            self._memory[0],
            self._case,
            self._solution,
            self._seen,
            self.trail,
        )

    def new_trail(self, columns: Floats, n_event: int) -> Trail:
        """Tangent columns (nx, k), and room for events."""
        modes, q = self._modes, self._clearance.size
        n_x, s, n_row = self._case.x.size, modes.nodes.at.size, len(modes.local)
        return Trail(
            columns=np.array(columns, order="C"),
            delay=np.zeros(columns.shape[1]),
            event=np.zeros((n_event, 4), dtype=np.int64),
            tick=np.zeros(n_event, dtype=np.int64),
            approach=np.full(n_event + 1, np.nan),
            count=np.zeros(2, dtype=np.int64),
            least=np.full((2, q), np.inf),
            swing=np.full((2, q), -np.inf),
            before=np.zeros(n_x),
            state=np.zeros(q, dtype=np.int64),
            column=np.zeros(n_x),
            after=np.zeros(n_x),
            load=np.zeros(s * n_row),
            rates=np.zeros(n_x),
            kick=np.zeros((2 * n_row, n_x)),
        )
