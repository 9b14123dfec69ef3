"""The motion with one additional weak impact, next to a grazing."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.branches.least_gap import least_gap
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.revolution import least_of
from rubhpc.integrate.periodic_motions.shooting import NotConverged

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point

    Floats = NDArray[np.float64]

NEAR = 1e-8, 1e-2  # of the clearance: gaps from which a gap of zero is extrapolated
BACK = 1e-3  # of the way to the first motion, where the others are unsuitable
DEPTH = 1e-5  # of the clearance, by which a motion without the impact would pass the wall
SMALL = 1e-6  # steps, by which derivatives are taken at most
ALIKE = 0.1  # of a least gap, between the interpolated and the actual value
PART = 0.1  # of the gap over the clearance, their upper limit: no gap closes meanwhile
MOST_ITERATIONS = 20


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
        None was found, or no gap is that small.
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
            return branching.correct(base, guess, along, most=MOST_ITERATIONS, is_free=True)
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
