"""Distances of a pair from parting after a touch: in speed and in contact force."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.kernels._jit import plain
from rubhpc.kernels.mode_change import AT_REST, HIDDEN, OPENING, least_flight

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.revolution import Piece, Revolution

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

AT_ONCE = 1e-6  # of the time for which a pair must part to count as open


def staying_closed(case: PiecewiseMotion, revolutions: Iterable[Revolution]) -> Floats:
    """Least distances (2, q), over the touches of a motion, of pairs that stay closed from parting.

    A pair that touches, or is closed when another one touches, parts where the impact sends it away, or where
    nothing presses it after the impact. It may touch again within a ten-thousandth of a revolution: one
    contact more, without a gap or a force with a minimum of zero. The first row is the additional speed with
    which a pair would part for good (`kernels.mode_change`), over the speed of a whirl in the gap; impulses
    that hold it count as the speeds that they change. The second row is its force after the touch, N.
    Infinite for a pair that stays closed at no touch, and for all pairs under a penalty, which has no
    impacts.
    """
    least = np.full((2, case.q), np.inf)
    if case.bodies.spring > 0.0:
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
            if case.has_states:
                force = case.march.forces(mode.place, case.enter(mode, following.begin, piece.after))[stays]
            else:  # decisive: impulses that hold a pair which would part for a moment come later
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
    impulse = march.given[0]
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
