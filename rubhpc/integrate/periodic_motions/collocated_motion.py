"""A motion by the collocation integrator, revolution by revolution, with its tangent and its events."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.marches.collocation import CollocationMarch, code_of, states_of
from rubhpc.integrate.periodic_motions.piecewise_motion import (
    MOST_EVENTS,
    Change,
    PiecewiseMotion,
    Unfollowed,
)
from rubhpc.integrate.periodic_motions.revolution import NO_PAIR, NO_SPEED, Piece
from rubhpc.integrate.periodic_motions.tolerances import BY_STEPS
from rubhpc.integrate.scheme import Scheme
from rubhpc.kernels.case_progress import DIVERGED, FINISHED
from rubhpc.kernels.collocation.structures import NORMAL, OPEN, STICKING
from rubhpc.kernels.collocation.tangent import AFTER, BEFORE, FULL, KIND, N_EVENT, PAIR

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State
    from rubhpc.kernels.collocation.tangent import Trail

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ACCURACY = 1e-4  # of forces, at most: periodic motions close to about a hundredth of it
UNRELATED = 1e-25  # of the largest: less is of motions that do not act on each other, and spoils eigenvectors


def followed_motion(scheme: Scheme, accuracy: float = ACCURACY) -> Callable[..., FollowedMotion]:
    """Return what follows motions: in closed form, or by collocation to an accuracy."""
    is_collocated = scheme is Scheme.COLLOCATION
    return partial(CollocatedMotion, accuracy=accuracy) if is_collocated else PiecewiseMotion


@dataclass(frozen=True, kw_only=True, eq=False)
class CollocatedRevolution:
    """One revolution of the shaft, or a part of it, as `revolution.Revolution`.

    Attributes
    ----------
    motion, begin, begun : (2 n,)
        Where it begins: the motion, its tick, and the states of the pairs.
    last : int
        Tick at which it ends.
    """

    motion: Floats
    begun: int
    begin: int
    last: int
    end: Floats
    states: int
    pieces: list[Piece]
    least_gap: Floats
    least_force: Floats


class CollocatedMotion:
    """Follows motions of one case from the shaft's angle 0, as `PiecewiseMotion` does in closed form.

    Attributes
    ----------
    start, states : (2 n,)
        Where the case begins: its reduced motion, and the states of its pairs.
    turn : float, s
        Duration of a revolution.
    energy : (2 n,)
        Twice the energy of unit motions, with the spin as their pace.

    Parameters
    ----------
    accuracy : float
        Of forces, at most.
    """

    is_exact: ClassVar[Literal[False]] = False
    tolerances: ClassVar = BY_STEPS

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State | None,
        march: CollocationMarch | None = None,
        accuracy: float = ACCURACY,
    ) -> None:
        """Begin at a state, or where a march stands that is needed no more."""
        if march is None:
            assert initial is not None
            march = CollocationMarch(setup, clearance, friction, initial, None)
        elif initial is not None:
            march.start_again(initial)
        self.march, self.setup = march, setup
        self.turn = setup.interval * setup.samples_per_revolution
        self.bodies = march.bodies
        self.n, self.q = self.bodies.stiffness.shape[0], len(setup.model.stators)
        self.energy = np.ones(2 * self.n)
        self.energy[: self.n] = setup.spin**2
        self._accuracy = min(setup.accuracy, accuracy)
        self.start, self.states = march.motion(), code_of(march.states)
        self._at = 0  # tick

    @property
    def _turn(self) -> int:
        """Ticks of a revolution."""
        clock = self.march.clock
        return clock.samples_per_revolution << clock.sample_level

    @cached_property
    def _columns(self) -> Floats:
        """Changes of the coordinates (nx, 2 n) by the motion."""
        coordinates, none = self.march.modes.coordinates, np.zeros(2 * self.n)
        at_none = coordinates(none)
        return np.array([coordinates(unit) - at_none for unit in np.eye(none.size)]).T.copy()

    def size(self, motion: Floats) -> float:
        """Root of v'v + spin^2 u'u of a reduced motion (2 n,), in which the mass matrix is the identity."""
        return math.sqrt(self.energy @ motion**2)

    @cached_property
    def nbytes(self) -> int:
        """Bytes of its tables."""
        tables = (*self.march.modes.tables, *self.march.room)
        return sum(table.nbytes for table in tables if isinstance(table, np.ndarray))

    def revolve(
        self, motion: Floats, states: int, *, phase: float = 0.0, share: float = 1.0
    ) -> CollocatedRevolution:
        """Follow a motion (2 n,) with the pairs in these states through one revolution."""
        return self.follow(motion, states, 1, phase=phase, share=share)[0]

    def follow(
        self,
        motion: Floats,
        states: int,
        n_revolution: int,
        most_events: int = MOST_EVENTS,
        *,
        phase: float = 0.0,
        share: float = 1.0,
    ) -> list[CollocatedRevolution]:
        """Follow a motion through several revolutions, or shares of them, from a phase on.

        Raises
        ------
        Unfollowed
            A displacement passes its limit, no contact forces obey the laws, or events follow without end.
        """
        march, found, none = self.march, [], np.zeros((2 * self.n, 0))
        ticks = [round((phase + i * share) * self._turn) for i in range(n_revolution + 1)]
        march.place_at(motion, states_of(states, self.q), ticks[0])
        for begin, last in pairwise(ticks):
            trail = self._carry(last, none, most_events)
            found.append(
                CollocatedRevolution(
                    motion=motion,
                    begun=states,
                    begin=begin,
                    last=last,
                    end=march.motion(),
                    states=code_of(march.states),
                    pieces=self._pieces(trail, states, begin, last),
                    least_gap=trail.least[0],
                    least_force=trail.least[1],
                )
            )
            motion, states = found[-1].end, found[-1].states
        return found

    def _pieces(self, trail: Trail, states: int, begin: int, end: int) -> list[Piece]:
        """What happened from one event to the next, between two ticks."""
        tick, pieces, at, none = self.march.clock.tick, [], states_of(states, self.q), np.zeros(0)
        first = begin
        for k in range(int(trail.count[N_EVENT])):
            pair, kind, _, after = trail.event[k, [PAIR, KIND, BEFORE, AFTER]].tolist()
            touches = kind == NORMAL and at[pair] == OPEN
            before = code_of(at)
            at[pair] = after
            pieces.append(
                Piece(
                    states=before,
                    begin=(first - begin) * tick,
                    duration=(int(trail.tick[k]) - first) * tick,
                    crossing=1 << pair,
                    before=none,
                    touching=np.array([pair]) if touches else NO_PAIR,
                    approach=trail.approach[k : k + 1].copy() if touches else NO_SPEED,
                    after=none,
                    states_after=code_of(at),
                )
            )
            first = int(trail.tick[k])
        last = code_of(at)
        pieces.append(
            Piece(last, (first - begin) * tick, (end - first) * tick, 0, none, NO_PAIR, NO_SPEED, none, last)
        )
        return pieces

    def monodromy(self, revolutions: Sequence[CollocatedRevolution]) -> Floats:
        """Derivative (2 n, 2 n) of a motion's end by its beginning; it is followed once more."""
        first = revolutions[0]
        self.march.place_at(first.motion, states_of(first.begun, self.q), first.begin)
        columns = np.eye(2 * self.n)
        for revolution in revolutions:
            columns = self._carried(revolution.last, columns, MOST_EVENTS)
        columns[np.abs(columns) < UNRELATED * np.abs(columns).max()] = 0.0
        return columns

    def stand_at(self, motion: Floats, states: int) -> None:
        """Stand at the shaft's angle 0 with a motion (2 n,) and the pairs in these states."""
        self.march.place_at(motion, states_of(states, self.q), 0)
        self._at = 0

    def go_on(self, columns: Floats, n_revolution: int = 1) -> Floats:
        """Go on by some revolutions; return what small changes (2 n, k) of the motion become.

        Raises
        ------
        Unfollowed
            As `follow`.
        """
        self._at += n_revolution * self._turn
        return self._carried(self._at, columns, 0)

    def _carried(self, tick: int, columns: Floats, most_events: int) -> Floats:
        """What becomes of small changes (2 n, k) of the motion up to a tick."""
        moved: Floats = self.march.modes.motion @ self._carry(tick, columns, most_events).columns
        return moved

    def _carry(self, tick: int, columns: Floats, most_events: int) -> Trail:
        """Go on to a tick with small changes (2 n, k) of the motion."""
        outcome, trail = self.march.carry(tick, self._columns @ columns, most_events, self._accuracy)
        if outcome == DIVERGED:
            raise Unfollowed(f"a displacement passes {self.setup.displacement_limit:.3g} m")
        if trail.count[FULL]:
            raise Unfollowed(f"more than {most_events} events in a revolution")
        if outcome != FINISHED:
            raise Unfollowed(self.march.why)
        return trail

    def contact_force(self, states: int, motion: Floats) -> Floats:
        """Force of each pair (q,), N, at the angle 0; of a closed one at least the smallest number."""
        self.march.place_at(motion, states_of(states, self.q), 0)
        self.march.carry(0, self._columns[:, :0], 1)
        return self.march.reached().contact_force

    def what_changes(self, piece: Piece) -> list[tuple[int, Change]]:
        """Pairs that an event at the end of a piece concerns, and what becomes of them."""
        was, after = states_of(piece.states, self.q), states_of(piece.states_after, self.q)
        found: list[tuple[int, Change]] = []
        for i in range(self.q):
            if i in piece.touching:
                found.append((i, "touch"))
            if was[i] != OPEN and after[i] == OPEN:
                found.append((i, "release"))
            elif was[i] != OPEN and was[i] != after[i]:
                found.append((i, "stick" if after[i] == STICKING else "slip"))
        return found


FollowedMotion = PiecewiseMotion | CollocatedMotion
