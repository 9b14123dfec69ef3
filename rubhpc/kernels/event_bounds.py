"""How long no switch function can vanish unseen, by bounds on its derivatives: an event lies beyond."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, short_loops
from rubhpc.kernels.contact_modes import positive_interval
from rubhpc.kernels.friction_states import OPEN, state_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

THIRD, SIXTH = 1.0 / 3.0, 1.0 / 6.0
FREE, SURE = range(2)  # rows of what is known of the switch functions


@jit_inline_sum
@short_loops
def free_until(
    states: int,
    mode: int,
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    bend_re: Floats,
    bend_im: Floats,
    bound: Floats,
    turn: Floats,
    z_re: Floats,
    z_im: Floats,
    now: int,
    tick: float,
    longest: int,
    known: Ints,
) -> tuple[int, int]:
    """How long no switch function (2 q, m) of a set of states can vanish unseen.

    Parameters
    ----------
    now : int
        Tick at which the coordinates stand; each lasts `tick` (s).
    turn : (p, 2 q, m)
        As in `ModeTables`: negative for coordinates that decay fast without vibration. They are bounded by
        what they are now, not by a series.
    longest : int
        Ticks beyond which none is asked for.
    known : (2, 2 q)
        The tick before which each of them cannot vanish, and that before which it does so once at most and
        stays negative, as they were proved last: those alone are asked anew that come before the others. In
        place.

    Returns
    -------
    int
        Tick before which none can vanish.
    int
        Tick before which one that has vanished is negative still: that is seen at the end of a step.
    """
    n_switch, first = known.shape[1], -1
    for j in range(n_switch):
        is_watched = j % 2 == 0 or state_of(states, j // 2) != OPEN
        if is_watched and (first < 0 or known[SURE, j] < known[SURE, first]):
            first = j
    reached, most = now + longest, longest * tick
    for turn_of in range(n_switch):  # the one that comes first, then the others
        j = first + turn_of
        j = j - n_switch if j >= n_switch else j
        if known[SURE, j] < reached and (j % 2 == 0 or state_of(states, j // 2) != OPEN):
            re, im, turning_re, turning_im = (
                switch_re[mode, j],
                switch_im[mode, j],
                rate_re[mode, j],
                rate_im[mode, j],
            )
            bending_re, bending_im, weight, next_weight = (
                bend_re[mode, j],
                bend_im[mode, j],
                bound[mode, j],
                turn[mode, j],
            )
            value, rate, bend, most_bend, most_turn = 0.0, 0.0, 0.0, 0.0, 0.0
            fast_size, fast_rate, gain, rise = 0.0, 0.0, 0.0, 0.0
            for k in range(z_re.size):  # in one loop: several would wait for their sums as often
                a, b = z_re[k], z_im[k]
                size, cubed = abs(a) + abs(b), next_weight[k]
                part, turned = re[k] * a - im[k] * b, turning_re[k] * a - turning_im[k] * b
                bent = bending_re[k] * a - bending_im[k] * b
                value += part
                rate += turned
                most_bend += weight[k] * size
                fast = 1.0 if cubed < 0.0 else 0.0
                fast_rate += fast * turned
                fast_size += fast * part
                gain += fast * abs(part)
                rise += fast * abs(turned)
                bend += bent - fast * bent
                most_turn += max(cubed, 0.0) * size
            gain, rise = 0.5 * (gain + fast_size), 0.5 * (rise + fast_rate)
            slow_rate = rate - fast_rate
            free = min(positive_interval(value, rate, most_bend), most)
            # What decays adds no less than nothing where it is positive, and no less than now elsewhere.
            least = value - gain
            if least > 0.0:
                while free < most and is_positive(least, slow_rate, bend, most_turn, 2.0 * free):
                    free *= 2.0
                if free < most and is_positive(least, slow_rate, bend, most_turn, 1.5 * free):
                    free *= 1.5
            sure = free
            if value > 0.0:
                sure = max(free, falling_until(slow_rate + rise, bend, most_turn, free))
            known[FREE, j] = now + int(free / tick)
            known[SURE, j] = now + int(min(sure, most) / tick)
            reached = min(reached, known[SURE, j])
    free_to = reached
    for j in range(n_switch):
        if j % 2 == 0 or state_of(states, j // 2) != OPEN:
            free_to = min(free_to, known[FREE, j])
    return free_to, reached


@jit_inline_sum
def is_positive(value: float, rate: float, bend: float, turn: float, time: float) -> bool:
    """Whether `value + rate t + bend t^2 / 2 - turn t^3 / 6` is positive up to a time (s).

    It is if its coefficients in Bernstein's polynomials are.
    """
    third, sixth = rate * time * THIRD, bend * time * time * SIXTH
    second = value + 2.0 * third + sixth
    last = value + 3.0 * third + 3.0 * sixth - turn * time * time * time * SIXTH
    return value > 0.0 and value + third > 0.0 and second > 0.0 and last > 0.0


@jit_inline_sum
def falling_until(rate: float, bend: float, turn: float, begin: float) -> float:
    """Time (s) until which `rate + bend t + turn t^2 / 2` is negative from `begin` on; 0 where it is not."""
    if not rate + begin * (bend + 0.5 * begin * turn) < 0.0:
        return 0.0
    root = np.sqrt(max(bend * bend - 2.0 * turn * rate, 0.0))
    if bend > 0.0:  # this form of it does not cancel
        return float(-2.0 * rate / (root + bend))
    return float((root - bend) / turn) if turn > 0.0 else np.inf
