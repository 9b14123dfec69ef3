"""The motion with one weak impact more, next to a grazing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.periodic_motions.family import flow
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.shooting import NotConverged

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point

    Floats = NDArray[np.float64]

NEAR = 1e-8, 1e-2  # of the clearance: gaps from which a gap of zero is extrapolated
BACK = 1e-3  # of the way to the first motion, where the others nearly touch or do not
DEPTH = 1e-5  # of the clearance, by which a motion without the impact would pass the wall
SMALL = 1e-7  # steps, by which derivatives are taken at most
PART = 0.1  # of the gap over the clearance, which they are at most: no gap closes meanwhile
MOST_ITERATIONS = 20


def weakly_impacting(branching: Branching, free: Sequence[Point]) -> Point:
    """Find the periodic motion that a wall holds up from passing it by a hundred-thousandth of the clearance.

    The speed of an impact goes with the root of that depth p, the change of the motion with the root of the
    change of the parameter: at a given parameter Newton's method meets a derivative without bound. In terms
    of the depth both are smooth. So `h(x, lambda) = -p` is added, h being the least gap linearised beside
    the grazing, and the parameter is an unknown: it lies ahead where the branch goes on, or behind where it
    turns (Nordmark 1991; di Bernardo and others 2008, 7.2).

    Parameters
    ----------
    free : sequence of Point
        Motions without the impact, towards the grazing; the last one is taken whose least gap is between
        1e-8 and 1e-2 of its clearance, or one a thousandth of the way back.

    Raises
    ------
    NotConverged
        None was found, or no gap is that small.
    """
    base, pair, gap, clearance = _beside(branching, free)
    row = _gradient(branching, base, pair, min(SMALL, PART * gap / clearance))
    guess = np.zeros(row.size)
    guess[-1] = -(gap + DEPTH * clearance) / row[-1]
    return branching.correct(base, guess, -row / np.linalg.norm(row), most=MOST_ITERATIONS, is_free=True)


def _beside(branching: Branching, free: Sequence[Point]) -> tuple[Point, int, float, float]:
    """A motion that nearly grazes, the pair that does, its least gap and its clearance, m."""

    def nearly(points: Iterable[Point]) -> tuple[Point, int, float, float] | None:
        for point in points:
            gap = _least_gap(branching, point)
            clearance = point.case.bodies.clearance[: gap.size]
            pair = int(np.argmin(gap / clearance))
            if NEAR[0] * clearance[pair] < gap[pair] < NEAR[1] * clearance[pair]:
                return point, pair, float(gap[pair]), float(clearance[pair])
        return None

    if (found := nearly(free[::-1])) is not None:
        return found
    back = branching.difference(free[-1], free[0])
    if length := float(np.linalg.norm(back)):
        moved = branching.correct(free[-1], BACK * back, back / length, is_free=True)
        if (found := nearly([moved])) is not None:
            return found
    raise NotConverged("no gap is about to close")


def _least_gap(branching: Branching, point: Point, step: Floats | None = None) -> Floats:
    """Least gaps (q,), m, over a period from a motion, or from a step (2 n + 1,) beside it."""
    case, motion = point.case, point.motion
    if step is not None:
        motion = motion + step[:-1] / point.scale
        if step[-1] != 0.0:
            case = branching.family.at(point.value + step[-1] * branching.step)
            motion = branching.family.carry(motion, point.case, case)
    try:
        revolutions = flow(case, motion, point.states, point.period, point.phase)
    except Unfollowed as problem:
        raise NotConverged(str(problem)) from None
    return np.asarray(np.min([revolution.least_gap for revolution in revolutions], axis=0))


def _gradient(branching: Branching, point: Point, pair: int, small: float) -> Floats:
    """Derivative (2 n + 1,) of a least gap, m, by the motion and the parameter, in steps."""
    row = np.empty(point.motion.size + 1)
    for k in range(row.size):
        step = np.zeros(row.size)
        step[k] = small
        ahead, behind = (_least_gap(branching, point, way * step)[pair] for way in (1.0, -1.0))
        row[k] = (ahead - behind) / (2.0 * small)
    if not np.isfinite(row).all() or row[-1] == 0.0:
        raise NotConverged("the least gap has no derivative")
    return row
