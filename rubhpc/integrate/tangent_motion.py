"""The exact tangent of a case in closed form: along the trail of its record, then from its end on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.lyapunov import N_ALIGNING, SPAN, Marches
from rubhpc.integrate.measuring.regimes import N_ALL, N_FIRST, N_MOST
from rubhpc.integrate.transient import pass_revolutions
from rubhpc.kernels.tangent import ALL_CARRIED, PIECE, TrailModes, carry_along, new_tangent
from rubhpc.kernels.trail import BROKEN

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.event_driven import EventDrivenMarch
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import Setup
    from rubhpc.kernels.trail import Trail
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]

MOST_AT_ONCE = 16 * SPAN  # revolutions passed together after the record
N_ALIGNING_RETURN = 2  # spans in which the difference from a return turns, within a record
MOST_RETURNS = 4  # revolutions back to the return that is taken, at most
REPEATED = 1e-8  # of a motion: a smaller difference from a return is rounding
GOALS = N_FIRST, N_ALL, N_MOST  # spans that are read together (`regimes.by_growth`)


class TangentMotion:
    """A small displacement of a motion, propagated by its exact derivative (`kernels.tangent`).

    Where pairs leave the closed form for collocation, it continues with two motions (`lyapunov.Marches`).
    """

    def __init__(
        self,
        start: Callable[[State], EventDrivenMarch],
        state: State,
        setup: Setup,
        recording: Recording,
        trail: Trail | None = None,
        march: EventDrivenMarch | None = None,
    ) -> None:
        """Begin at the end of a record, with the trail of its revolutions if it was kept.

        A march of the case that is no longer needed may be given and is restarted, as the trail.
        """
        self.n_aligning, self.most_spans = N_ALIGNING, N_ALIGNING + N_MOST
        self.within: list[float] = []
        self._start, self._recording, self._setup = start, recording, setup
        self._state = state
        self._march = march = start(state) if march is None else march
        self._n_passed, self._most_at_once = 0, MOST_AT_ONCE
        n = march.bodies.stiffness.shape[0]
        self._motion = np.cos(np.arange(2.0 * n))  # without a special direction
        self._beside: Marches | None = None
        self._grown: list[float] = []  # logarithms, revolution by revolution, not yet read
        if trail is not None and self._carry_within(trail, recording.revolutions):
            self._leave_room(trail, recording.revolutions)
        self._spare = march.new_trail() if trail is None else trail

    def part(self, n_revolution: int) -> float | None:
        """Continue; see `lyapunov.Neighbours`.

        Raises
        ------
        NoClosedForm
            The motion needs collocation.
        """
        while self._beside is None and len(self._grown) < n_revolution:
            if not self._pass_on():
                return None
        if self._beside is not None:
            return self._beside.part(n_revolution)
        grown, self._grown = self._grown[:n_revolution], self._grown[n_revolution:]
        return float(sum(grown))

    def _carry_within(self, trail: Trail, n_revolution: int) -> bool:
        """Propagate the displacement along a record; False where its trail is broken.

        The difference of a torus from an earlier return lies along the torus, and that of a chaotic motion
        has lost what decays. A displacement without a special direction takes twice as long to align.
        """
        if trail.n_event[0] == BROKEN:
            return False
        n_within = max(0, n_revolution // SPAN - N_ALIGNING)
        begun = 0
        if n_revolution >= N_ALIGNING * SPAN:
            self.n_aligning = 0
            begun = n_revolution - (n_within + N_ALIGNING_RETURN) * SPAN
            difference = self._from_return(trail, begun)
            if difference is None:
                begun = n_revolution - (n_within + N_ALIGNING) * SPAN
            else:
                self._motion = difference
        self._carry(trail, 0, n_revolution, begun)
        grown, self._grown = np.array(self._grown[len(self._grown) - n_within * SPAN :]), []
        self.within = (grown.reshape(-1, SPAN).sum(axis=1) / SPAN).tolist()
        return True

    def _from_return(self, trail: Trail, revolution: int) -> Floats | None:
        """Difference (2 n,) of the motion at a revolution from its nearest return; None where it repeats."""
        march, clock = self._march, self._march.clock
        ticks = clock.samples_per_revolution << clock.sample_level
        returns = [_motion_at(trail, march, (revolution - back) * ticks) for back in range(MOST_RETURNS + 1)]
        scale = np.repeat([clock.spin, 1.0], returns[0].size // 2)
        apart = (returns[0] - returns[1:]) * scale
        size = np.sqrt(np.square(apart).sum(axis=1))
        nearest = int(size.argmin())
        if not size[nearest] > REPEATED * np.linalg.norm(returns[0] * scale):
            return None
        difference: Floats = apart[nearest] / scale
        return difference

    def _pass_on(self) -> bool:
        """Pass some more revolutions, or reduce their number; returns whether the motion can continue."""
        n_revolution = self._next_revolutions()
        march, trail = self._march, self._spare
        march.start_again(self._state)
        march.keep(trail)
        n_left = march.n_left
        reason = pass_revolutions(march, self._recording, n_revolution)
        march.keep(None)
        if reason is not None:
            return False
        clock = march.clock
        first = -n_revolution * clock.samples_per_revolution << clock.sample_level
        before, self._state = self._state, march.final()
        if self._carry(trail, first, n_revolution):
            self._n_passed += n_revolution
            self._leave_room(trail, n_revolution)
            return True
        if march.n_left == n_left and n_revolution > 1:  # no room for their events
            self._most_at_once, self._state = n_revolution // 2, before
        else:
            self._beside = Marches(self._start, before, self._setup, self._recording)
            for _ in range(self._beside.n_aligning):
                self._beside.part(SPAN)
        return True

    def _next_revolutions(self) -> int:
        """Revolutions up to the next number of spans that is read together, or a part of them."""
        ends = (SPAN * (self.n_aligning + goal - len(self.within)) for goal in GOALS)
        left = next((end - self._n_passed for end in ends if end > self._n_passed), SPAN)
        return min(left, self._most_at_once)

    def _leave_room(self, trail: Trail, n_revolution: int) -> None:
        """Limit the revolutions passed at once such that a trail has room for twice their events."""
        n_event = max(1, 2 * int(trail.n_event[0]))
        self._most_at_once = min(self._most_at_once, max(1, trail.tick.size * n_revolution // n_event))

    def _carry(self, trail: Trail, first: int, n_revolution: int, begun: int = 0) -> bool:
        """Propagate the displacement along a trail that begins at tick `first`; False where it is broken.

        It begins with a later revolution, `begun`.
        """
        if trail.n_event[0] == BROKEN:
            return False
        march = self._march
        tangent = new_tangent(
            trail.begun.shape[2],
            len(march.bodies.gap_jacobian),
            self._motion,
            n_revolution - begun,
        )
        clock = march.clock
        first += begun * clock.samples_per_revolution << clock.sample_level
        modes = _ModesOfTrail(trail, march)
        tangent.reached[PIECE] = piece = _piece_at(trail, first)
        while piece != ALL_CARRIED:
            march.find(int(trail.states[piece]))
            piece = carry_along(
                march.tables,
                march.bodies,
                clock.spin,
                first,
                clock.samples_per_revolution << clock.sample_level,
                trail,
                modes.placed(),
                tangent,
            )
        self._motion = tangent.motion
        self._grown += tangent.grown.tolist()
        return True


class _ModesOfTrail:
    """The contact modes of a trail, each read when it is first in the tables.

    Large rings meet more modes than fit in the tables, so that places change while a trail is read.
    """

    def __init__(self, trail: Trail, march: EventDrivenMarch) -> None:
        self._march = march
        distinct, of_piece = np.unique(trail.states[: trail.n_event[0] + 1], return_inverse=True)
        self._states: list[int] = distinct.tolist()
        self._is_read = [False] * len(distinct)
        m, k = trail.begun.shape[2], len(distinct)
        self._modes = TrailModes(
            of_piece.reshape(-1),
            np.full(k, -1),
            np.zeros((k, 2, m)),
            np.zeros(k, dtype=np.int64),
        )

    def placed(self) -> TrailModes:
        """The modes with their present places in the tables."""
        march, modes = self._march, self._modes
        place_of = {states: place for place, states in enumerate(march.tables.mask.tolist())}
        for i, states in enumerate(self._states):
            modes.place[i] = place = place_of.get(states, -1)
            if place >= 0 and not self._is_read[i]:
                modes.exponent[i], modes.opened[i] = march.exponents(states), ~states
                self._is_read[i] = True
        return modes


def _piece_at(trail: Trail, tick: int) -> int:
    """The piece of a trail in which a motion is at a tick; at an event, the one before."""
    return int(np.searchsorted(trail.tick[: trail.n_event[0]], tick))


def _motion_at(trail: Trail, march: EventDrivenMarch, tick: int) -> Floats:
    """The motion (2 n,) at a tick of a trail that begins at tick 0."""
    piece = _piece_at(trail, tick)
    states = int(trail.states[piece])
    if states not in march.tables.mask:
        march.find(states)
    tables, exponent = march.tables, march.exponents(states)
    time = (tick - int(trail.tick[piece - 1] if piece > 0 else 0)) * march.clock.tick
    begun, mode = trail.begun[piece], tables.mask.tolist().index(states)
    z = (begun[0] + 1j * begun[1]) * np.exp(time * (exponent[0] + 1j * exponent[1]))
    motion: Floats = tables.motion_re[mode] @ z.real - tables.motion_im[mode] @ z.imag
    return motion
