"""What the linear theory about a periodic motion says of the contacts of cases near it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.periodic_motions.saltation import saltate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.piecewise_motion import Piece, PiecewiseMotion
    from rubhpc.integrate.periodic_motions.shooting import Orbit

    Floats = NDArray[np.float64]

PER_REVOLUTION = 64  # times at which gaps and forces are looked at
AT_ONCE = 256  # periods that are looked at together


class _Watched(NamedTuple):
    """A gap or force over a piece, at t times."""

    value: Floats  # (t,), on the periodic motion
    rows: Floats  # (t, 2 n), its derivative by the motion at the section
    begins: bool  # it vanishes where the piece begins, or does so later nearby
    ends: bool  # it vanishes where the piece ends


class Onward:
    """Gaps and forces along a periodic motion, and of cases near it period by period, to first order.

    Events move in time; what must not happen is one more, or one less.
    """

    def __init__(self, piecewise: PiecewiseMotion, orbit: Orbit) -> None:
        """Carry small changes of the section through a period."""
        self._monodromy = orbit.monodromy
        self._watched: list[_Watched] = []
        pieces = [piece for revolution in orbit.revolutions for piece in revolution.pieces]
        motion, tangent, before = orbit.motion, np.eye(orbit.motion.size), pieces[-1]
        for piece, following in zip(pieces, [*pieces[1:], None], strict=True):
            self._watch(piecewise, before, piece, motion, tangent)
            tangent = piecewise.mode(piece.states).propagator(piece.duration) @ tangent
            if piece.crossing and following is not None:
                tangent = saltate(piecewise, piece, following, tangent)
            motion, before = piece.after, piece

    def keeps_contacts(self, apart: Floats, n_period: int) -> bool:
        """Whether a case at a distance (2 n,) has the contacts of the periodic motion for so many periods."""
        columns, power = apart[:, None], self._monodromy
        while columns.shape[1] < min(n_period, AT_ONCE):
            columns, power = np.hstack([columns, power @ columns]), power @ power
        for _ in range(-(-n_period // columns.shape[1])):
            if not all(_keeps(one, one.value[:, None] + one.rows @ columns) for one in self._watched):
                return False
            columns = power @ columns
        return True

    def _watch(
        self, piecewise: PiecewiseMotion, before: Piece, piece: Piece, motion: Floats, tangent: Floats
    ) -> None:
        mode = piecewise.mode(piece.states)
        n_time = max(3, round(PER_REVOLUTION * piece.duration / piecewise.turn))
        times = piece.duration * (np.arange(n_time) + 0.5) / n_time
        z = piecewise.enter(mode, piece.begin, motion)
        exponent = mode.tables.exponent[0] + 1j * mode.tables.exponent[1]
        moved = np.exp(times[:, None] * exponent) * (z[0] + 1j * z[1]) + times[:, None] * mode.tables.drift
        passing = np.exp(times[:, None] * mode.exponent)
        for j, floor in enumerate(mode.tables.floor):
            if floor == -np.inf:
                continue
            row = mode.tables.switch_re[j] + 1j * mode.tables.switch_im[j]
            rows = (passing * row[mode.moving]).view(np.float64) @ mode.enter @ tangent
            began = bool(before.crossing) and before.states != piece.states
            self._watched.append(_Watched((moved @ row).real, rows, began, bool(piece.crossing >> j & 1)))


def _keeps(one: _Watched, value: Floats) -> bool:
    """Whether values (t, k) are positive in all k periods, but for times by the ends where one vanishes."""
    positive = value > 0.0
    if positive.all():
        return True
    if not (one.begins or one.ends):
        return False
    since = np.logical_or.accumulate(positive, axis=0)
    until = np.logical_or.accumulate(positive[::-1], axis=0)[::-1]
    is_kept = positive.copy()
    if one.begins:
        is_kept |= ~since
    if one.ends:
        is_kept |= ~until
    return bool(is_kept.all() and since[-1].all())
