"""The motion with one additional weak impact, next to a grazing, and the least gap from which it is found."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.revolution import cut, joined, least_of
from rubhpc.integrate.periodic_motions.saltation import carried, tangents
from rubhpc.integrate.periodic_motions.shooting import NotConverged
from rubhpc.kernels.closed_form.mode_change import GAP_TOLERANCE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.revolution import Piece

    Floats = NDArray[np.float64]


LOOKS = 256  # samples of a revolution, among which the least gap is sought
MOST_ITERATIONS, TURNED = 30, 1e-14  # of Newton's method for its time; accuracy as a share of a revolution

NEAR = 1e-8, 1e-2  # of the clearance: gaps from which a gap of zero is extrapolated
BACK = 1e-3  # of the way to the first motion, where the others are unsuitable
DEPTH = 1e-5  # of the clearance, by which a motion without the impact would pass the wall
SMALL = 1e-6  # steps, by which derivatives are taken at most
ALIKE = 0.1  # of a least gap, between the interpolated and the actual value
PART = 0.1  # of the gap over the clearance, their upper limit: no gap closes meanwhile
MOST_CORRECTIONS = 20


@dataclass(frozen=True, kw_only=True, eq=False)
class LeastGap:
    """The least gap of an open pair where it turns within a period.

    Attributes
    ----------
    gap : float, m
    bend : float, m/s^2
        Its second derivative with respect to time.
    """

    point: Point
    case: PiecewiseMotion
    pair: int
    gap: float
    bend: float
    _place: int  # of its piece, counted over all revolutions
    _time: float  # s, in that piece

    @property
    def gradient(self) -> Floats:
        """Derivative (2 n,) of the gap with respect to the motion at the section."""
        case = self.case
        tables = case.mode(self.point.pieces[self._place].states).tables
        row = tables.switch_re[self.pair] + 1j * tables.switch_im[self.pair]
        row = row * np.exp((tables.exponent[0] + 1j * tables.exponent[1]) * self._time)
        gradient: Floats = tables.enter_re @ row.real - tables.enter_im @ row.imag
        return gradient @ tangents(case, self.point.revolutions)[self._place - 1] if self._place else gradient

    def impact(self, depth: float) -> Floats:
        """Change of the motion (2 n,) after the period by an impact here, to leading order.

        A wall at a depth p is hit with the speed `v = sqrt(2 p d)`, where d is the second derivative of the
        gap, and the pair parts at once. Closed pairs stay closed.
        """
        case, bodies = self.case, self.case.bodies
        closed = case.mode(self.point.pieces[self._place].states).is_closed.copy()
        closed[self.pair] = True
        hit = np.flatnonzero(closed)
        speed = np.where(hit == self.pair, np.sqrt(2.0 * max(depth * self.bend, 0.0)), 0.0)
        gained = (1.0 + bodies.restitution) * speed
        normals, directions = bodies.gap_jacobian[hit], bodies.force_direction[hit].T
        change = np.zeros((2 * case.n, 1))
        change[case.n :, 0] = directions @ np.linalg.solve(normals @ directions, gained)
        rows = cut(joined([one.rows for one in self.point.revolutions]), self._place, None)
        times = rows.times.copy()
        times[0, 1] -= self._time
        return carried(case, rows._replace(times=times), change)[:, 0]


def least_gap(point: Point, pair: int) -> LeastGap | None:
    """Find the least gap of a pair; None where it has none in a piece, or the case no closed form."""
    case, best = point.case, (np.inf, 0, 0.0)
    if not case.is_exact:
        return None
    pieces = point.pieces
    begins = [point.motion, *(piece.after for piece in pieces)]
    for place, (piece, begun) in enumerate(zip(pieces, begins, strict=False)):
        if case.mode(piece.states).is_closed[pair]:
            continue
        looks = np.linspace(0.0, piece.duration, max(8, int(LOOKS * piece.duration / case.turn)))
        gap, rate, _ = _gap(case, piece, begun, pair, looks)
        is_turn = (rate[:-1] < 0.0) & (rate[1:] >= 0.0)
        turns = np.flatnonzero(is_turn & (np.minimum(gap[:-1], gap[1:]) > GAP_TOLERANCE))  # none just opened
        if turns.size:
            first = turns[np.argmin(np.minimum(gap[turns], gap[turns + 1]))]
            if (least := min(gap[first], gap[first + 1])) < best[0]:
                best = float(least), place, float(looks[first if gap[first] == least else first + 1])
    if not np.isfinite(best[0]):
        return None
    _, place, time = best
    piece, begun = pieces[place], begins[place]
    for _ in range(MOST_ITERATIONS):
        gap, rate, bend = _gap(case, piece, begun, pair, np.array([time]))
        if not bend[0] > 0.0:
            return None
        moved = -rate[0] / bend[0]
        time = float(np.clip(time + moved, 0.0, piece.duration))
        if abs(moved) < TURNED * case.turn:
            break
    return LeastGap(
        point=point, case=case, pair=pair, gap=float(gap[0]), bend=float(bend[0]), _place=place, _time=time
    )  # fmt: skip


def _gap(
    case: PiecewiseMotion, piece: Piece, begun: Floats, pair: int, times: Floats
) -> tuple[Floats, Floats, Floats]:
    """Gap of a pair and its first and second derivative at some times (k,), s, of a piece."""
    mode = case.mode(piece.states)
    tables = mode.tables
    re, im = case.enter(mode, piece.begin, begun)
    exponent = tables.exponent[0] + 1j * tables.exponent[1]
    terms = (re + 1j * im) * np.exp(np.multiply.outer(times, exponent))
    row = tables.switch_re[pair] + 1j * tables.switch_im[pair]
    gap, rate, bend = (np.real(terms @ (row * exponent**k)) for k in range(3))
    return gap, rate, bend


def weakly_impacting(branching: Branching, free: Sequence[Point], share: float = DEPTH) -> Point:
    """Find the periodic motion with a weak impact, which replaces a small overlap with the wall.

    The speed of the impact is proportional to the root of the depth p of this overlap, and the change of the
    motion to the root of the change of the parameter. At a given parameter the derivative in Newton's method
    is therefore unbounded. Both are smooth in terms of the depth. The equation `h(x, lambda) = -p` is
    therefore added, with h the least gap linearised next to the grazing, and the parameter is an unknown. It
    lies ahead where the branch continues, or behind where it turns (Nordmark 1991; di Bernardo and others
    2008, 7.2).

    Parameters
    ----------
    free : sequence of Point
        Motions without the impact, towards the grazing. Of those with a least gap between 1e-8 and 1e-2 of
        its clearance the one nearest to 1e-5 is used, or one a thousandth of the way back.
    share : float
        Of the clearance.

    Raises
    ------
    NotConverged
        None was found, no gap is that small, or motions have no closed form.
    """
    base, pair, gap, clearance = _beside(branching, free)
    least = least_gap(base, pair)
    if least is None or abs(least.gap - gap) > ALIKE * gap:
        raise NotConverged("the least gap does not turn")
    small = min(SMALL, PART * gap / clearance)
    try:
        ended, ahead = branching.rate(base, small)
    except Unfollowed as problem:
        raise NotConverged(str(problem)) from None
    was, now = (float(least_of(some)[0][pair]) for some in (base.revolutions, ahead))
    rate = (now - was) / small
    row = np.append(least.gradient / base.scale, rate)
    if not np.isfinite(row).all() or rate == 0.0:
        raise NotConverged("the least gap has no derivative")
    depth = share * clearance
    matrix = np.block([[(base.monodromy - np.eye(ended.size)) / base.scale, ended[:, None]], [row[None, :]]])
    guesses, along = (
        [np.append(np.zeros(ended.size), -(least.gap + depth) / rate)],
        -row / np.linalg.norm(row),
    )
    with suppress(np.linalg.LinAlgError):
        guesses.append(np.linalg.solve(matrix, np.append(-least.impact(depth), -(least.gap + depth))))
    for guess in guesses[::-1]:
        with suppress(NotConverged):
            return branching.correct(base, guess, along, most=MOST_CORRECTIONS, is_free=True)
    raise NotConverged("no motion with a weak impact was found")


def _beside(branching: Branching, free: Sequence[Point]) -> tuple[Point, int, float, float]:
    """A motion that nearly grazes, the pair concerned, its least gap and its clearance, m."""

    def nearly(points: Iterable[Point]) -> tuple[Point, int, float, float] | None:
        found = []
        for point in points:
            gap, _ = least_of(point.revolutions)
            clearance = np.abs(point.case.bodies.clearance[: gap.size])
            pair = int(np.argmin(gap / clearance))
            if NEAR[0] * clearance[pair] < gap[pair] < NEAR[1] * clearance[pair]:
                found.append((point, pair, float(gap[pair]), float(clearance[pair])))
        return min(found, key=lambda one: abs(math.log(one[2] / one[3] / DEPTH)), default=None)

    if (found := nearly(free)) is not None:
        return found
    back = branching.difference(free[-1], free[0])
    if length := float(np.linalg.norm(back)):
        moved = branching.correct(free[-1], BACK * back, back / length, is_free=True)
        if (found := nearly([moved])) is not None:
            return found
    raise NotConverged("no gap is about to close")
