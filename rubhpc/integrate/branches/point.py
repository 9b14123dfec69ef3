"""One periodic motion of a branch, and how near its touches are to leaving a pair closed or open."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.periodic_motions.shooting import floquet_multipliers
from rubhpc.kernels._jit import plain
from rubhpc.kernels.closed_form.mode_change import AT_REST, HIDDEN, OPENING, least_flight

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.family import Family, Motion
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.revolution import Piece
    from rubhpc.integrate.record import State

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]
    Complexes = NDArray[np.complex128]


AT_ONCE = 1e-6  # of the time for which a pair must part to count as open

TURN = 0.2  # change of the motion, over its size, that counts as one step
NEAR_FOLD = 0.03  # distance of a multiplier from 1 within which the parameter is not held
MAY_FOLD = 0.7  # a real multiplier beyond which a fold may be a step ahead
REAL = 1e-6  # imaginary part below which a multiplier counts as real
CENTRAL = 0.2  # share of an event-free piece at either end without a section


def staying_closed(case: Motion, revolutions: Iterable[Any]) -> Floats:
    """Least distances (2, q), over the touches of a motion, of pairs that stay closed from parting.

    A pair that touches, or is closed when another one touches, parts where the impact sends it away, or where
    nothing presses it after the impact. It may touch again within a ten-thousandth of a revolution: one
    contact more, without a gap or a force with a minimum of zero. The first row is the additional speed with
    which a pair would part for good (`kernels.closed_form.mode_change`), over the speed of a whirl in the
    gap; impulses that hold it count as the speeds that they change. The second row is its force after the
    touch, N. Infinite for a pair that stays closed at no touch, and for all pairs without closed form, where
    contacts appear and vanish by gaps and forces alone.
    """
    least = np.full((2, case.q), np.inf)
    if not case.is_exact:
        return least
    whirl = abs(case.setup.spin) * max(float(case.bodies.clearance.max()), np.finfo(float).tiny)
    for revolution in revolutions:
        for piece, following in pairwise(revolution.pieces):
            if not piece.touching.size:
                continue
            mode = case.mode(following.states)
            stays = mode.is_closed
            if not stays.any():
                continue
            lacking, opening = _opening(case, piece, following.begin)
            # Impulses that hold a pair which would part for a moment come later.
            force = -np.linalg.pinv(case.bodies.delassus[np.ix_(stays, stays)]) @ opening[stays]
            for row, value in enumerate((lacking[stays] / whirl, force)):
                least[row, stays] = np.minimum(least[row, stays], value)
    return least


def _opening(case: PiecewiseMotion, piece: Piece, time: float) -> tuple[Floats, Floats]:
    """Missing speeds (q,), m/s, for pairs to part at the touch that ends a piece; gap accelerations.

    The accelerations, m/s2, are those without contact forces. Infinite and 0 where no impulses are found.
    """
    bodies, march, n, angle = case.bodies, case.march, case.n, case.setup.spin * time
    motion = piece.before.copy()
    if march.change(piece.states, piece.crossing, angle, motion, AT_ONCE * march.moment) < 0:
        return np.full(case.q, np.inf), np.zeros(case.q)
    impulse = march.given
    speed = bodies.gap_jacobian @ motion[n:]
    is_hit = (impulse > 0.0) & (np.abs(speed) <= max(AT_REST, OPENING))
    if is_hit.any():
        inverse = np.linalg.pinv(bodies.delassus[np.ix_(is_hit, is_hit)])
        speed[is_hit] = -impulse[is_hit] / np.diag(inverse)
    free = (
        bodies.force_cosine * np.cos(angle)
        + bodies.force_sine * np.sin(angle)
        - bodies.stiffness @ motion[:n]
        - bodies.damping @ motion[n:]
    )
    opening = bodies.gap_jacobian @ free
    flight = np.array([plain(least_flight)(pull, march.moment, HIDDEN) for pull in opening.tolist()])
    return OPENING + np.maximum(-opening, 0.0) * flight - speed, opening


@dataclass(frozen=True, kw_only=True, eq=False)
class Point:
    """A periodic motion on a branch.

    Attributes
    ----------
    value : float
        Of the parameter.
    phase : float
        Angle of the shaft, in revolutions, at which `motion` (2 n,) is taken, and `states` of the pairs.
    revolutions : list of Revolution or CollocatedRevolution
        As many as its period.
    family : Family
        Its case at the value is the one whose coordinates these are.
    """

    value: float
    phase: float
    motion: Floats
    states: int
    revolutions: list[Any]
    family: Family

    @property
    def case(self) -> Motion:
        """The case whose motion this is, set up again where the family had no room for it."""
        return self.family.at(self.value)

    @property
    def period(self) -> int:
        """Revolutions."""
        return len(self.revolutions)

    @property
    def pieces(self) -> list[Piece]:
        """Its pieces, of all revolutions."""
        return [piece for revolution in self.revolutions for piece in revolution.pieces]

    @property
    def parameter_axis(self) -> Floats:
        """A change by one step of the parameter alone, (2 n + 1,)."""
        return np.append(np.zeros(self.motion.size), 1.0)

    @cached_property
    def monodromy(self) -> Floats:
        """Derivative (2 n, 2 n) of the motion after a period with respect to that before it."""
        return self.case.monodromy(self.revolutions)

    @cached_property
    def multipliers(self) -> Complexes:
        """Its eigenvalues, largest first, (2 n,)."""
        return floquet_multipliers(self.monodromy)

    @cached_property
    def state(self) -> State:
        """The motion with the shaft at its angle 0."""
        motion, states, _ = self.after((1.0 - self.phase) % 1.0)
        return self.case.march.state_of(motion, self.case.contact_force(states, motion))

    def note_state(self) -> Point:
        """Compute what every point of a branch needs while its case is set up; returns the point."""
        _ = self.state, self.multipliers
        return self

    @cached_property
    def scale(self) -> Floats:
        """Steps (2 n,) for a unit of each coordinate."""
        spin, size = abs(self.case.setup.spin), max(self.case.size(self.motion), np.finfo(float).tiny)
        return np.repeat([spin, 1.0], self.case.n) / (TURN * size)

    @property
    def is_near_fold(self) -> bool:
        """Whether the problem with the parameter held is nearly singular."""
        return bool(np.abs(self.multipliers - 1.0).min() < NEAR_FOLD)

    @property
    def may_fold(self) -> bool:
        """Whether a fold may lie within a step of the branch."""
        is_real = np.abs(self.multipliers.imag) <= REAL
        return bool((is_real & (self.multipliers.real > MAY_FOLD)).any())

    @property
    def n_unstable(self) -> int:
        """Multipliers beyond the unit circle."""
        return int((np.abs(self.multipliers) > 1.0).sum())

    @cached_property
    def staying_closed(self) -> Floats:
        """Distances of pairs from parting at a touch, (2, q): `staying_closed`."""
        return staying_closed(self.case, self.revolutions)

    def after(self, ahead: float) -> tuple[Floats, int, float]:
        """The motion (2 n,) some revolutions ahead, the states of the pairs, and the phase there."""
        phase, motion, states = self.phase, self.motion, self.states
        whole, rest = divmod(ahead, 1.0)
        for share in [1.0] * int(whole) + ([rest] if rest else []):
            ended = self.case.revolve(motion, states, phase=phase, share=share)
            motion, states, phase = ended.end, ended.states, (phase + share) % 1.0
        return motion, states, phase

    @cached_property
    def sequence(self) -> tuple[tuple[int, tuple[int, ...]], ...]:
        """Contacts in the order of a period: pairs closed until each event, and pairs that touch there.

        It begins with the smallest, so that it does not depend on the section.
        """
        events = [(piece.states, tuple(piece.touching.tolist())) for piece in self.pieces if piece.crossing]
        if not events:
            return ((self.states, ()),)
        return min(tuple(events[k:] + events[:k]) for k in range(len(events)))


def away_from_events(point: Point) -> float:
    """Revolutions from a point's section to the middle of the longest event-free piece; 0 if it is near.

    An impact at the section would make the motion there jump.
    """
    turn, pieces = point.case.turn, point.pieces
    times = np.cumsum([piece.duration for piece in pieces]) / turn
    events = np.array([time for time, piece in zip(times, pieces, strict=True) if piece.crossing])
    if not events.size:
        return 0.0
    gaps = np.diff(np.append(events, events[0] + point.period))
    here = float(events[0] / gaps[-1])  # share of its piece that lies ahead
    longest = int(np.argmax(gaps))
    if CENTRAL < here < 1.0 - CENTRAL and gaps[-1] > 0.5 * gaps[longest]:
        return 0.0
    return float((events[longest] + 0.5 * gaps[longest]) % point.period)
