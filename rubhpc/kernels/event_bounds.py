"""How long no switch function can vanish unseen, by bounds on its derivatives: an event lies beyond."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import ModeTables  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.coordinate_steps import floor_log2
from rubhpc.kernels.friction_states import OPEN, state_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

THIRD, SIXTH = 1.0 / 3.0, 1.0 / 6.0
STRIDE, N_STRIDE = 8.0, 4  # factors by which times are tried: this one, its square root, and so on
FEW_BITS = 2  # of a count of ticks, behind the first
WORTH_ASKING = 4  # of an interval free of events: its last share, in which it is bounded anew
LESS = 0.585  # below 2 - sqrt(2): |x + i y| is at most x + y less this times the smaller, x and y positive
CLOSE = 8  # share of a unit of ticks: a step is to end further than that behind a root
FREE, SURE = range(2)  # rows of what is known of the switch functions


@linked_sum
def free_until(
    states: int,
    tables: ModeTables,
    mode: int,
    z_re: Floats,
    z_im: Floats,
    now: int,
    tick: float,
    shortest: int,
    longest: int,
    known: Ints,
) -> tuple[int, int]:
    """How long no switch function of a set of states, a contact mode of the tables, can vanish unseen.

    Parameters
    ----------
    now : int
        Tick at which the coordinates stand; each lasts `tick` (s).
    shortest, longest : int
        Ticks less than which are taken for none, and beyond which none is asked for.
    known : (2, 2 q)
        The tick before which each of them cannot vanish, and that before which it does so once at most and
        stays negative, as they were proved last: those alone are asked anew that come before the others. In
        place.

    Returns
    -------
    int
        Tick before which none can vanish.
    int
        Tick before which one that has vanished is negative still: that is seen at the end of a step. No more
        than a little after one is expected to vanish.
    """
    n_switch, first = known.shape[1], -1
    for j in range(n_switch):
        if is_watched(states, j) and (first < 0 or known[SURE, j] < known[SURE, first]):
            first = j
    reached, most = now + longest, longest * tick
    for turn_of in range(n_switch):  # the one that comes first, then the others
        j = first + turn_of
        j = j - n_switch if j >= n_switch else j
        if known[SURE, j] < reached and is_watched(states, j):
            re, im, weight = tables.switch_re[mode, j], tables.switch_im[mode, j], tables.turn[mode, j]
            turning_re, turning_im = tables.rate_re[mode, j], tables.rate_im[mode, j]
            bending_re, bending_im = tables.bend_re[mode, j], tables.bend_im[mode, j]
            value, rate, bend, slow_turn = 0.0, 0.0, 0.0, 0.0
            gain, fast_rate, rise, fast_bend, fast_turn = 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(z_re.size):  # in one loop: several would wait for their sums as often
                a, b, cubed = z_re[k], z_im[k], weight[k]
                x, y = abs(a), abs(b)
                turned, part = turning_re[k] * a - turning_im[k] * b, re[k] * a - im[k] * b
                bent = bending_re[k] * a - bending_im[k] * b
                third = cubed * (x + y - LESS * min(x, y))
                fast = 1.0 if cubed < 0.0 else 0.0
                pushed = fast if part > 0.0 else 0.0
                value += part
                rate += turned
                bend += bent
                slow_turn += max(third, 0.0)
                gain += pushed * part
                fast_turn += pushed * third
                fast_rate += fast * turned
                rise += fast * max(turned, 0.0)
                fast_bend += fast * bent
            slow_rate, slow_bend = rate - fast_rate, bend - fast_bend
            whole = (value, rate, bend, slow_turn - fast_turn)
            slow = (value - gain, slow_rate, slow_bend, slow_turn)
            sure = free = min(positive_until(whole, slow, shortest * tick, most), most)
            if value > 0.0:
                sure = max(free, falling_until(slow_rate + rise, slow_bend, slow_turn, free))
            known[FREE, j] = now + int(free / tick)
            known[SURE, j] = now + int(min(sure, most) / tick)
            reached = min(reached, known[SURE, j])
            if known[FREE, j] < reached:
                passed = now + ticks_beyond(value, rate, bend, tick, reached - now)
                reached = min(reached, max(passed, known[FREE, j] + shortest))
    free_to = reached
    for j in range(n_switch):
        if is_watched(states, j):
            free_to = min(free_to, known[FREE, j])
    return free_to, reached


@linked_sum
def is_watched(states: int, j: int) -> bool:
    """Whether switch function j of a set of states is one: an open pair has one alone."""
    return j % 2 == 0 or state_of(states, j // 2) != OPEN


@linked_sum
def ticks_beyond(value: float, rate: float, bend: float, tick: float, most: int) -> int:
    """Ticks (s), of few bits, shortly after the root of a parabola; about `most` at most."""
    root = np.sqrt(max(rate * rate - 2.0 * bend * value, 0.0))
    time = 2.0 * value / (root - rate) if root > rate else np.inf
    if not time < most * tick:
        return most
    count = int(time / tick)
    unit = 1 << max(floor_log2(max(count, 1)) - FEW_BITS, 0)
    passed = (count // unit + 1) * unit
    return int(passed + unit if passed - count < unit // CLOSE else passed)


@linked_sum
def positive_until(
    whole: tuple[float, float, float, float],
    slow: tuple[float, float, float, float],
    shortest: float,
    most: float,
) -> float:
    """Time (s) until which one of two cubics is positive: `shortest` at least, about `most` at most, or 0.

    Both are lower bounds. The `whole` one is Taylor's: a decay from x at a rate r is no less than
    `x (1 - r t + (r t)^2 / 2)` where x is negative, and less by `x (r t)^3 / 6` at most elsewhere. In the
    `slow` one it is no less than nothing where x is positive, and no less than x elsewhere.
    """
    if not (is_positive(whole, shortest) or is_positive(slow, shortest)):
        return 0.0
    time, longer = shortest, STRIDE
    for _ in range(N_STRIDE):
        while time < most and (is_positive(whole, longer * time) or is_positive(slow, longer * time)):
            time *= longer
        longer = np.sqrt(longer)
    return time


@linked_sum
def is_positive(cubic: tuple[float, float, float, float], time: float) -> bool:
    """Whether `value + rate t + bend t^2 / 2 - turn t^3 / 6` is positive up to a time (s).

    It is if its coefficients in Bernstein's polynomials are.
    """
    value, rate, bend, turn = cubic
    third, sixth = rate * time * THIRD, bend * time * time * SIXTH
    second = value + 2.0 * third + sixth
    last = value + 3.0 * third + 3.0 * sixth - turn * time * time * time * SIXTH
    return min(value, value + third, second, last) > 0.0


@linked_sum
def falling_until(rate: float, bend: float, turn: float, begin: float) -> float:
    """Time (s) until which `rate + bend t + turn t^2 / 2` is negative from `begin` on; 0 where it is not."""
    if not rate + begin * (bend + 0.5 * begin * turn) < 0.0:
        return 0.0
    root = np.sqrt(max(bend * bend - 2.0 * turn * rate, 0.0))
    if bend > 0.0:  # this form of it does not cancel
        return float(-2.0 * rate / (root + bend))
    return float((root - bend) / turn) if turn > 0.0 else np.inf
