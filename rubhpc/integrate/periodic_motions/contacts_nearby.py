"""What the linear theory about a periodic motion says of the contacts of cases near it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.periodic_motions.revolution import joined
from rubhpc.kernels.linear_theory import Watched, keeps_contacts
from rubhpc.kernels.small_changes import ALL_CARRIED
from rubhpc.kernels.watching import N_PART, N_TIME, begin_watching, watch_pieces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.approach import Approach
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.shooting import Orbit
    from rubhpc.kernels.revolutions import PieceRows

    Floats = NDArray[np.float64]

PER_REVOLUTION = 64  # times at which gaps and forces are looked at
MOST_PERIODS = 4000  # that the linear theory is followed


class ContactsNearby:
    """Gaps and forces along a periodic motion, and of cases near it period by period, to first order.

    Events move in time; what must not happen is one more, or one less.

    Attributes
    ----------
    watched : Watched
        The gaps and forces.
    """

    def __init__(self, piecewise: PiecewiseMotion, orbit: Orbit, approach: Approach) -> None:
        """See how small changes of the section change gaps and forces through a period."""
        self._approach = approach
        rows = joined([revolution.rows for revolution in orbit.revolutions])
        parts, value, change = _watch(piecewise, rows, orbit.motion)
        onward = approach.theory.span @ change.T
        self.watched = Watched(parts, value, np.ascontiguousarray(change.T), onward)
        self._work = np.empty(value.size + 2 * len(onward))

    def keeps_contacts(self, apart: Floats, n_period: int = MOST_PERIODS, share: float = 0.0) -> bool:
        """Whether a case at a distance (2 n,) has the contacts of the periodic motion.

        For so many periods, or until no more than a share of the square of its distance is left.
        """
        least = share * self._approach.square(apart)
        return bool(keeps_contacts(self._approach.theory, self.watched, apart, n_period, least, self._work))


def _watch(
    piecewise: PiecewiseMotion, rows: PieceRows, motion: Floats
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Parts, values and changes of what is watched along the pieces of a period."""
    n_time = np.maximum(3, np.rint(PER_REVOLUTION * rows.times[:, 1] / piecewise.turn).astype(np.int64))
    watching = begin_watching(motion, n_time, piecewise.q, piecewise.room.ahead.shape[1])
    piece = 0
    while piece != ALL_CARRIED:
        piecewise.mode(int(rows.states[piece, 0]))
        piece = watch_pieces(
            piecewise.known,
            piecewise.bodies,
            piecewise.setup.spin,
            rows,
            watching,
            piecewise.change_room(motion.size),
        )
    n = int(watching.reached[N_TIME])
    return watching.parts[: watching.reached[N_PART]].copy(), watching.value[:n].copy(), watching.change[:n]
