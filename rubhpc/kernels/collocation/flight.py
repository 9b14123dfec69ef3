"""Flights: from one look at the gaps to the next, by bounds that miss no touch."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.gaps import see_gap
from rubhpc.kernels.collocation.structures import (
    TWIST,
    Bodies,
    CaseState,
    Solution,
)
from rubhpc.kernels.collocation.tables import turn_freely
from rubhpc.kernels.coordinate_steps import floor_log2
from rubhpc.kernels.cubics import turning_value
from rubhpc.kernels.laws import PENALTY

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

NONE, LOST = -1, -2  # in place of the pair that touches
MOST_LOOKS = 10_000_000  # in a flight
GAP_TOLERANCE = 1e-13  # m: what a gap does within it is not looked at
RECENT = 0.5  # of the last contact: so long a pair that has opened is looked at only now and then
LEAST_GAP, GAP_BEFORE, RATE_BEFORE = range(3)  # rows of `Solution.turned`
RARELY = 0.05  # of the time since it has opened


@linked_sum
def time_in_bore(
    gap: float, rate: float, sideways: float, distance: float, bound: float, free: float
) -> float:
    """Time (s) for which a bore surely stays open, at most `free`, that of a gap which is not curved.

    The centres move apart along a straight line, with the rate of the gap and `sideways` (m/s), and deviate
    by no more than half the `bound` (m/s2) times the time squared. What is then left of the gap is a concave
    function of the time: Newton's method comes to its root from above, and the chord is below it.
    """
    left, square = 0.0, rate * rate + sideways * sideways
    for _ in range(4):
        along, aside = distance - rate * free, sideways * free
        reach = math.sqrt(along * along + aside * aside)
        left = gap + free * (2.0 * distance * rate - square * free) / (distance + reach)
        left -= 0.5 * bound * free * free
        if left >= 0.0:
            return free
        slope = (distance * rate - square * free) / reach - bound * free
        held, free = free, free - left / slope
    return held * gap / (gap - left)


@linked_sum
def fly(
    bodies: Bodies,
    power: Complexes,
    s: int,
    tick_length: float,
    tick: int,
    last_tick: int,
    unseen: int,
    case: CaseState,
    solution: Solution,
) -> tuple[int, int, float, int]:
    """Advance with all pairs open to the first touch, or to `last_tick`.

    A gap is a convex function of the local motions, so that it stays above its tangent less half of a bound
    of its acceleration times the time squared; for a bore see `time_in_bore`. The first ticks `unseen` are
    taken without a look.

    Returns
    -------
    tick, pair : int
        The pair that touches, NONE at the end, or LOST where a motion is not finite or its looks have no end.
    acceleration : float
        Bound of that of its gap, m/s2.
    n_look : int
    """
    n_complex, n_local, n_row = bodies.n_complex, bodies.n_local, bodies.load.shape[0]
    n_mode, q = bodies.exponent.size, bodies.radius.size
    x, after, turn, start, local, bend = (
        case.x,
        solution.after,
        solution.turn,
        solution.start,
        bodies.local,
        bodies.bend,
    )
    size, highest = np.empty(n_mode), power.shape[0] - 1
    for i in range(q):
        solution.turned[RATE_BEFORE, i] = 0.0
    ahead, is_exact, n_look, open_at = min(unseen, last_tick - tick), True, 0, tick
    for k in range(x.size):
        solution.held[k] = x[k]
    while True:
        if ahead != 0:
            if is_exact:
                for k in range(n_mode):
                    turn[k] = np.exp(bodies.exponent[k] * (ahead * tick_length))
                turn_freely(n_complex, turn, x, after)
            else:
                level = min(floor_log2(ahead), highest)
                ahead = 1 << level
                turn_freely(n_complex, power[level], x, after)
            for k in range(x.size):
                x[k] = after[k]
            tick += ahead
        if tick >= last_tick:
            return tick, NONE, 0.0, n_look
        n_look += 1
        for k in range(n_complex):
            size[k] = math.sqrt(x[k] * x[k] + x[n_complex + k] * x[n_complex + k])
        for k in range(n_complex, n_mode):
            size[k] = abs(x[n_complex + k])
        for r in range(2 * n_row):
            row, total = local[r], 0.0
            for k in range(x.size):
                total += row[k] * x[k]
            start[r] = total
        ahead, is_exact, is_seen = last_tick - tick, False, True
        looked = tick
        for i in range(q):
            first = i * n_local
            see_gap(bodies, i, start, first, i * s, solution)
            gap, rate, bound, is_bore = solution.gap[i * s], 0.0, 0.0, bodies.radius[i] < 0.0
            for a in range(n_local):
                slope, row, total = solution.normal[i * s, a], bend[first + a], 0.0
                weight = 1.0 if is_bore and a < TWIST else abs(slope)  # the normal of a bore may turn
                if weight != 0.0:
                    for k in range(n_mode):
                        total += row[k] * size[k]
                    rate += slope * start[n_row + first + a]
                    bound += weight * total
            sideways, distance, sharpest = 0.0, 0.0, bound
            if is_bore:
                for a in range(TWIST):
                    sideways += solution.tangent[i * s, a] * start[n_row + first + a]
                distance = -1.0 / solution.curvature[i * s]
                sharpest += sideways * sideways / distance
            if solution.turned[RATE_BEFORE, i] < 0.0 <= rate and tick > solution.looked[0]:
                passed = (tick - solution.looked[0]) * tick_length
                before = solution.turned[GAP_BEFORE, i], solution.turned[RATE_BEFORE, i]
                turning = turning_value(before[0], before[1], gap, rate, passed)
                solution.turned[LEAST_GAP, i] = min(solution.turned[LEAST_GAP, i], turning)
            solution.turned[GAP_BEFORE, i], solution.turned[RATE_BEFORE, i] = gap, rate
            soft = bodies.damping[i] / bodies.stiffness[i] if bodies.normal_law[i] == PENALTY else 0.0
            near = gap + soft * max(rate, 0.0)
            least = math.sqrt(2.0 * GAP_TOLERANCE / sharpest)
            age = (tick - case.since[i]) * tick_length
            if age < RECENT * case.lasting[i]:
                least = max(least, RARELY * age)
            is_close = False
            if (rate < 0.0 and gap < -rate * tick_length) or (near < 0.0 and soft > 0.0):
                back = -int(gap / (rate * tick_length)) if gap < 0.0 and rate < 0.0 else 0
                back = max(back, -((tick - open_at) // 2))  # halves: Newton's method may pass the gap
                if back == 0:
                    return tick, i, sharpest, n_look
                # From the last look: back in time, modes that decay fast would overflow.
                for k in range(x.size):
                    x[k] = solution.held[k]
                ahead, is_exact, is_seen = tick + back - open_at, True, False
                tick = open_at
                break
            if gap <= 0.0:  # closed as yet, and opening: while the rate surely stays positive
                free = max(least, rate / sharpest)
            else:
                root = math.sqrt(rate * rate + 2.0 * bound * gap)
                free = (root + rate) / bound if rate > 0.0 else 2.0 * gap / (root - rate)
                if is_bore:
                    free = time_in_bore(gap, rate, sideways, distance, bound, free)
                is_close = rate < 0.0 and bound * gap < 0.5 * rate * rate
                if not is_close:
                    free = max(least, free)
            ticks = max(1, int(min(free / tick_length, 1.0 * ahead)))
            if ticks < ahead:
                ahead, is_exact = ticks, is_close
        solution.looked[0] = looked
        if is_seen:
            open_at = tick
            for k in range(x.size):
                solution.held[k] = x[k]
        if n_look > MOST_LOOKS or not abs(solution.gap[0]) < np.inf:
            return tick, LOST, 0.0, n_look
