"""What keeps a pair closed after a touch: how slowly it parts, and how firmly it is pressed."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.kernels.mode_change import AT_REST, OPENING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.revolution import Piece, Revolution

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

AT_ONCE = 1e-6  # of the time for which a pair must part to have parted


def staying_closed(case: PiecewiseMotion, revolutions: Iterable[Revolution]) -> Floats:
    """Least distances (2, q), over the touches of a motion, from where a pair that stays closed would part.

    A pair that is closed when another touches, or touches itself, parts where the impact sends it away, or
    where nothing presses it behind the impact. It may be back within a ten-thousandth of a revolution: a
    contact more, without a gap or a force that turns at zero. The first row has how much faster a pair
    would have to part to stay apart (`kernels.mode_change`), over the speed of a whirl in the gap, the
    impulses that hold it counted as the speeds that they take; the second its force behind the touch, N.
    Infinite for a pair that stays closed at no touch, and all of it under a penalty, where nothing impacts.
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
            else:  # what decides: the impulses that hold what would part for a moment come after it
                force = -np.linalg.pinv(case.bodies.delassus[np.ix_(stays, stays)]) @ opening[stays]
            for row, value in enumerate((lacking[stays] / whirl, force)):
                least[row, stays] = np.minimum(least[row, stays], value)
    return least


def _opening(case: PiecewiseMotion, piece: Piece, time: float) -> tuple[Floats, Floats]:
    """Speeds (q,), m/s, that pairs lack to part at the touch that ends a piece; accelerations of their gaps.

    These, m/s2, are without the forces of contacts. Infinite and 0 where no impulses are found.
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
    return OPENING + np.maximum(-opening, 0.0) * march.moment - speed, opening
