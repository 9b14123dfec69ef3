"""The largest mean of a contact force over a short time: what a peak of it is measured by.

Of a force itself no peak converges. What a touch sets off in the damper of a stator's tip grows with the
mesh, as one over the root of the time since, and the tip's own mass takes the rim's speed by an impulse. The
mean over a given time has neither fault: an impulse is shared out over it, and what the mesh does not resolve
lasts shorter than that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline, jit_lean
from rubhpc.kernels.cubics import turning_value

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

AVERAGING_TIME = 20e-6  # s
SHORTEST = AVERAGING_TIME / 64  # s, of two pieces that follow one another; shorter ones become one
MOST_PIECES = 160  # of a force within the averaging time; what does not fit is added to the last one

BEGIN, END, BEFORE, IMPULSE, FIRST, LAST = range(6)  # rows of `piece`: s, s, N s, N s, N, N
LOUD = 6  # row whose first number is the end of the last piece whose force may have passed the peak, s
OLDEST, COUNT = range(2)  # columns of `held`


@jit_inline
def part_of(piece: Floats, k: int, time: float) -> tuple[float, float]:
    """Impulse (N s) of a pair's piece k (6, n) up to a time in it, and the force (N) then.

    The impulse goes as Hermite's cubic; that of an impact, which takes no time, is whole.
    """
    impulse, length = piece[IMPULSE, k], piece[END, k] - piece[BEGIN, k]
    if not length > 0.0:
        return impulse, 0.0
    a, b = piece[FIRST, k] * length, piece[LAST, k] * length
    quadratic, cubic = 3.0 * impulse - 2.0 * a - b, a + b - 2.0 * impulse
    s = (time - piece[BEGIN, k]) / length
    return s * (a + s * (quadratic + s * cubic)), (a + s * (2.0 * quadratic + 3.0 * s * cubic)) / length


@jit_inline
def greatest_force(step: float, impulse: float, first: float, last: float, merged: float) -> float:
    """Bound on the force (N) of a piece, and of those that it is one with: Bernstein's of its parabola."""
    if not step > 0.0:
        return np.inf
    return max(first, last, 3.0 * impulse / step - first - last, merged)


@jit_lean
def add_force(
    i: int,
    begin: float,
    step: float,
    impulse: float,
    first: float,
    last: float,
    origin: Floats,
    pieces: Floats,
    held: Ints,
    peak: Floats,
) -> None:
    """Add a piece of the force of pair i, and take the largest mean that ends within it.

    Between the moments at which the window begins or ends at the end of a piece, the mean is smooth: its
    largest value is at one of them, or where it turns in between.

    Parameters
    ----------
    begin, step : float, s
        When the piece begins, counted from `origin` (1,), and how long it lasts; 0 for an impact.
    impulse, first, last : float, N s, N, N
        Its impulse, and the force at its ends.
    pieces : (q, 7, MOST_PIECES)
        The pieces within the averaging time, in a ring.
    held : (q, 2)
        Which is the oldest of them, and how many there are.
    peak : (q,), N
        The largest mean so far.
    """
    piece = pieces[i]
    most = piece.shape[1]
    begin += origin[0]
    end = begin + step
    k, count = held[i, OLDEST], held[i, COUNT]
    while count > 0 and piece[END, k] <= begin - AVERAGING_TIME:
        k, count = (k + 1) % most, count - 1
    now = (k + count - 1) % most
    is_short = count > 0 and step > 0.0 and piece[END, now] > piece[BEGIN, now]
    is_short = is_short and end - piece[BEGIN, now] < SHORTEST
    if is_short or count == most:
        piece[IMPULSE, now] += impulse
        piece[END, now] = end
        force = piece[IMPULSE, now] / (end - piece[BEGIN, now]) if end > piece[BEGIN, now] else 0.0
        piece[FIRST, now], piece[LAST, now] = force, force
    else:
        before = piece[BEFORE, now] + piece[IMPULSE, now] if count > 0 else 0.0
        now, count = (k + count) % most, count + 1
        piece[BEGIN, now], piece[END, now], piece[BEFORE, now] = begin, end, before
        piece[IMPULSE, now], piece[FIRST, now], piece[LAST, now] = impulse, first, last
    if greatest_force(step, impulse, first, last, piece[FIRST, now]) > peak[i]:
        piece[LOUD, 0] = end
    elif begin - AVERAGING_TIME >= piece[LOUD, 0]:  # no mean of less than the peak is above it
        held[i, OLDEST], held[i, COUNT] = k, count
        return
    before = piece[BEFORE, now]
    time, start = begin, begin - AVERAGING_TIME  # the ends of the window
    is_inside = piece[BEGIN, k] <= start  # whether it begins in piece k, or in a flight before that
    gained, force = part_of(piece, now, time)
    left, leaving = piece[BEFORE, k], 0.0  # the impulse before the window, and the force where it begins
    if is_inside:
        part, leaving = part_of(piece, k, start)
        left += part
    mean, rate = before + gained - left, force - leaving  # times the averaging time
    largest = mean if piece[BEGIN, now] == begin else 0.0  # of pieces that are one, that at the end is exact
    while time < end:
        bound = piece[END, k] if is_inside else piece[BEGIN, k]
        later = max(time, min(end, bound + AVERAGING_TIME))
        gained, force = part_of(piece, now, later)
        left, leaving = piece[BEFORE, k], 0.0
        if is_inside:
            part, leaving = part_of(piece, k, later - AVERAGING_TIME)
            left += part
        after, rate_after = before + gained - left, force - leaving
        largest = max(largest, after)
        if rate > 0.0 and rate_after < 0.0:
            largest = max(largest, turning_value(mean, rate, after, rate_after, later - time))
        if later >= end:
            break
        time, mean = later, after
        if is_inside:
            k, count = (k + 1) % most, count - 1
            is_inside = piece[BEGIN, k] <= bound
        else:
            is_inside = True
        leaving = 0.0
        if is_inside and piece[END, k] > piece[BEGIN, k]:
            leaving = piece[FIRST, k]
        rate = force - leaving
    held[i, OLDEST], held[i, COUNT] = k, count
    peak[i] = max(peak[i], largest / AVERAGING_TIME)
