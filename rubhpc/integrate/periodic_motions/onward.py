"""What the linear theory about a periodic motion says of the contacts of cases near it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.revolution import Piece
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
        """See how small changes of the section change gaps and forces through a period."""
        self._powers = orbit.powers
        self._watched: list[_Watched] = []
        pieces = [piece for revolution in orbit.revolutions for piece in revolution.pieces]
        motion, tangent, before = orbit.motion, None, pieces[-1]
        for piece, following in zip(pieces, orbit.tangents, strict=True):
            self._watch(piecewise, before, piece, motion, tangent)
            motion, tangent, before = piece.after, following, piece

    def keeps_contacts(self, apart: Floats, n_period: int) -> bool:
        """Whether a case at a distance (2 n,) has the contacts of the periodic motion for so many periods."""
        k = (min(n_period, AT_ONCE) - 1).bit_length()  # looked at together are 2^k periods
        columns = self._powers.sequence(apart, 1 << k)
        for left in range(n_period, 0, -(1 << k)):
            if not all(_keeps(one, one.value[:, None] + one.rows @ columns) for one in self._watched):
                return False
            if left > 1 << k:
                columns = self._powers.of(k) @ columns
        return True

    def _watch(
        self, piecewise: PiecewiseMotion, before: Piece, piece: Piece, motion: Floats, tangent: Floats | None
    ) -> None:
        mode = piecewise.mode(piece.states)
        looked_at = np.flatnonzero(mode.tables.floor > -np.inf)
        if not looked_at.size:
            return
        n_time = max(3, round(PER_REVOLUTION * piece.duration / piecewise.turn))
        step = piece.duration / n_time
        z = piecewise.enter(mode, piece.begin, motion)
        exponent = mode.tables.exponent[0] + 1j * mode.tables.exponent[1]
        passing = np.empty((n_time, exponent.size), np.complex128)
        passing[0], passing[1:] = np.exp(0.5 * step * exponent), np.exp(step * exponent)
        np.cumprod(passing, axis=0, out=passing)
        moved = passing * (z[0] + 1j * z[1])
        if mode.tables.drift.any():
            moved += np.multiply.outer(step * (np.arange(n_time) + 0.5), mode.tables.drift)
        passing = np.take(passing, mode.moving, axis=1)
        for j in looked_at.tolist():
            row = mode.tables.switch_re[j] + 1j * mode.tables.switch_im[j]
            rows = (passing * row[mode.moving]).view(np.float64) @ mode.enter
            if tangent is not None:
                rows = rows @ tangent
            began = bool(before.crossing) and before.states != piece.states
            self._watched.append(_Watched((moved @ row).real, rows, began, bool(piece.crossing >> j & 1)))


def _keeps(one: _Watched, value: Floats) -> bool:
    """Whether values (t, k) are positive in all k periods, but for times by the ends where one vanishes."""
    positive = value > 0.0
    if positive.all():
        return True
    if not (one.begins or one.ends):
        return False
    whole = np.flatnonzero(positive.all(axis=1))  # times at which all periods are positive
    if not whole.size:
        return _keeps_each(one, positive)
    first, last = whole[0], whole[-1]
    head, tail = positive[: first + 1], positive[last:]
    if (
        whole.size <= last - first
        or (first > 0 and not one.begins)
        or (last < len(positive) - 1 and not one.ends)
    ):
        return False
    return not ((head[:-1] & ~head[1:]).any() or (tail[1:] & ~tail[:-1]).any())


def _keeps_each(one: _Watched, positive: NDArray[np.bool_]) -> bool:
    """The same, where at no time all periods are positive (t, k)."""
    since = np.logical_or.accumulate(positive, axis=0)
    until = np.logical_or.accumulate(positive[::-1], axis=0)[::-1]
    is_kept = positive | (one.begins & ~since) | (one.ends & ~until)
    return bool(is_kept.all() and since[-1].all())
