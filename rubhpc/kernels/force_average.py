"""The largest mean of a contact force over a short time: the measure of its peak.

The peak of the force itself does not converge. After a touch the force of the damper at a stator's tip goes
as one over the root of the time since, so that its peak grows with mesh refinement, and the tip's own mass
takes the rim's speed by an impulse. The mean over a given time converges: an impulse is spread over this
time, and what the mesh does not resolve is shorter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels.cubics import turning_value

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

AVERAGING_TIME = 20e-6  # s
SHORTEST = AVERAGING_TIME / 64  # s, of two consecutive pieces; shorter ones are merged
MOST_PIECES = 160  # of a force within the averaging time; further ones are merged into the last one

BEGIN, END, BEFORE, IMPULSE, FIRST, LAST = range(6)  # rows of `piece`: s, s, N s, N s, N, N
LOUD = 6  # row whose first number is the end of the last piece that may exceed the peak, s
OLDEST, COUNT = range(2)  # columns of `held`


@linked
def part_of(piece: Floats, k: int, time: float) -> tuple[float, float]:
    """Impulse (N s) of a pair's piece k (6, n) up to a time in it, and the force (N) then.

    The impulse follows Hermite's cubic. An impact takes no time and counts whole.
    """
    impulse, length = piece[IMPULSE, k], piece[END, k] - piece[BEGIN, k]
    if not length > 0.0:
        return impulse, 0.0
    a, b = piece[FIRST, k] * length, piece[LAST, k] * length
    quadratic, cubic = 3.0 * impulse - 2.0 * a - b, a + b - 2.0 * impulse
    s = (time - piece[BEGIN, k]) / length
    return s * (a + s * (quadratic + s * cubic)), (a + s * (2.0 * quadratic + 3.0 * s * cubic)) / length


@linked
def greatest_force(step: float, impulse: float, first: float, last: float, merged: float) -> float:
    """Bound on the force (N) of a piece and of those merged with it: Bernstein's bound of its parabola."""
    if not step > 0.0:
        return np.inf
    return max(first, last, 3.0 * impulse / step - first - last, merged)


@linked
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
    """Add a piece of the force of pair i, and update the peak by the largest mean that ends within it.

    Between the times at which an end of the window meets an end of a piece, the mean is smooth: its largest
    value is at one of these times, or at a maximum in between.

    Parameters
    ----------
    begin, step : float, s
        Beginning of the piece, counted from `origin` (1,), and its length; 0 for an impact.
    impulse, first, last : float, N s, N, N
        Its impulse, and the force at its ends.
    pieces : (q, 7, MOST_PIECES)
        The pieces within the averaging time, in a ring buffer.
    held : (q, 2)
        Place of the oldest piece, and number of pieces.
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
    elif begin - AVERAGING_TIME >= piece[LOUD, 0]:  # no force above the peak is left in the window
        held[i, OLDEST], held[i, COUNT] = k, count
        return
    before = piece[BEFORE, now]
    time, start = begin, begin - AVERAGING_TIME  # the ends of the window
    is_inside = piece[BEGIN, k] <= start  # whether it begins in piece k, or in a flight before it
    gained, force = part_of(piece, now, time)
    left, leaving = piece[BEFORE, k], 0.0  # the impulse before the window, and the force where it begins
    if is_inside:
        part, leaving = part_of(piece, k, start)
        left += part
    mean, rate = before + gained - left, force - leaving  # times the averaging time
    largest = mean if piece[BEGIN, now] == begin else 0.0  # of merged pieces, the mean at the end is exact
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
