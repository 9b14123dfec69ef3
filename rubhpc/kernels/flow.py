"""One linear piece of a motion: closed-form to its first event, whose time is found to rounding."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_sum
from rubhpc.kernels.case_progress import NONE
from rubhpc.kernels.contact_modes import FORCED_LEVEL, bounded, dot, floor_log2, propagate
from rubhpc.kernels.cubics import turning_value

Floats = NDArray[np.float64]

MOST_REFINEMENTS = 30  # Newton steps to a root; two or three are taken
SAME_TIME = 1e-14  # s, within which switch functions vanish together


@jit_sum
def next_event(
    mode: int,
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    bound: Floats,
    power_re: Floats,
    power_im: Floats,
    exponent: Floats,
    drift: Floats,
    floor: Floats,
    tick: float,
    search_level: int,
    longest_level: int,
    duration: float,
    z_entered: Floats,
    z: Floats,
    least: Floats,
) -> tuple[float, int]:
    """Follow a contact mode until a switch function falls below its floor, for `duration` at most.

    Steps are chosen as by `event_loop.advance`; within the last tick the root is found by Newton's method
    with the exponentials themselves.

    Parameters
    ----------
    switch_re, ..., power_im : (p, ...)
        Tables of all modes (`contact_modes.ModeTables`); `mode` is the one to follow.
    exponent : (2, m), 1/s
        Of the coordinates, real and imaginary.
    drift : (m,), 1/s
        Growth of coordinates that grow linearly, times their unit.
    floor : (n_switch,)
        Below which a switch function is negative; -inf for one that is not looked at.
    tick, duration : float, s
    search_level, longest_level : int
        Steps up to 2^level ticks need no bound; none is longer than 2^longest_level.
    z_entered, z : (2, m)
        Coordinates at the beginning, and, filled in, at the end.
    least : (n_switch,)
        Smallest value of each switch function where it turns; lowered in place.

    Returns
    -------
    float
        Time passed, s.
    int
        Bits of the switch functions that vanish; 0 where `duration` has passed.
    """
    n_switch, m = switch_re.shape[1], z.shape[1]
    now, now_rate = np.zeros(n_switch), np.zeros(n_switch)
    then, then_rate = np.zeros(n_switch), np.zeros(n_switch)
    ahead = np.zeros((2, m))
    for k in range(m):
        z[0, k], z[1, k] = z_entered[0, k], z_entered[1, k]
    read_switches(mode, switch_re, switch_im, rate_re, rate_im, floor, z, now, now_rate)
    n_tick = int(duration / tick)
    passed, halving = 0, NONE
    is_forced = below(now, floor) != 0
    while True:
        is_last = passed >= n_tick
        level = 0
        if is_last:
            move(exponent, drift, duration, z_entered, ahead)
            step = duration - passed * tick
        else:
            level = min(longest_level, floor_log2(n_tick - passed))
            if is_forced:
                level = min(level, FORCED_LEVEL)
            elif halving >= 0:
                level = min(level, halving)
            else:
                free = np.inf
                for j in range(n_switch):
                    if floor[j] > -np.inf:
                        b = bounded(bound[mode, j], z[0], z[1])
                        free = min(free, positive_time(now[j], now_rate[j], b))
                while level > search_level and (1 << level) * tick > free:
                    level -= 1
            step = (1 << level) * tick
            propagate(power_re[mode, level], power_im[mode, level], z[0], z[1], ahead[0], ahead[1])
            for k in range(m):
                ahead[0, k] += drift[k] * step
        read_switches(mode, switch_re, switch_im, rate_re, rate_im, floor, ahead, then, then_rate)
        crossing = 0 if is_forced else below(then, floor)
        if crossing != 0 and level > 0 and not is_last:
            halving = level - 1
            continue
        if crossing != 0:
            return refine(
                mode,
                switch_re,
                switch_im,
                rate_re,
                rate_im,
                exponent,
                drift,
                crossing,
                passed * tick,
                min(duration, (passed + 1) * tick),
                tick,
                z_entered,
                z,
            )
        for j in range(n_switch):
            if floor[j] > -np.inf and now_rate[j] < 0.0 and then_rate[j] > 0.0:
                value = turning_value(now[j], now_rate[j], then[j], then_rate[j], step)
                if value > -floor[j]:  # a gap that has just opened is zero but for rounding
                    least[j] = min(least[j], value)
            now[j], now_rate[j] = then[j], then_rate[j]
        for k in range(m):
            z[0, k], z[1, k] = ahead[0, k], ahead[1, k]
        if is_last:
            return duration, int(np.int64(0))
        passed += 1 << level
        is_forced = False
        halving = max(halving - 1, NONE)


@jit_inline_sum
def positive_time(value: float, rate: float, bend: float) -> float:
    """Time, s, for which a function stays positive whose second derivative is within `bend`."""
    if not value > 0.0:
        return 0.0
    if bend > 0.0:
        return float((rate + np.sqrt(rate * rate + 2.0 * bend * value)) / bend)
    return -value / rate if rate < 0.0 else np.inf


@jit_sum
def read_switches(
    mode: int,
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    floor: Floats,
    z: Floats,
    value: Floats,
    rate: Floats,
) -> None:
    """Switch functions (n_switch,) that are looked at, and their rates."""
    for j in range(value.size):
        if floor[j] > -np.inf:
            value[j] = dot(switch_re[mode, j], switch_im[mode, j], z[0], z[1])
            rate[j] = dot(rate_re[mode, j], rate_im[mode, j], z[0], z[1])


@jit_inline_sum
def below(value: Floats, floor: Floats) -> int:
    """Bits of the switch functions below their floors."""
    crossing = int(np.int64(0))  # no literal: callers are compiled for one type
    for j in range(value.size):
        if value[j] < floor[j]:
            crossing |= 1 << j
    return crossing


@jit_sum
def move(exponent: Floats, drift: Floats, time: float, z_entered: Floats, z: Floats) -> None:
    """Coordinates (2, m) a time (s) after they were `z_entered`."""
    for k in range(z.shape[1]):
        size = np.exp(exponent[0, k] * time)
        turn = exponent[1, k] * time
        re, im = size * np.cos(turn), size * np.sin(turn)
        z[0, k] = re * z_entered[0, k] - im * z_entered[1, k] + drift[k] * time
        z[1, k] = re * z_entered[1, k] + im * z_entered[0, k]


@jit_sum
def refine(
    mode: int,
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    exponent: Floats,
    drift: Floats,
    crossing: int,
    first: float,
    last: float,
    tick: float,
    z_entered: Floats,
    z: Floats,
) -> tuple[float, int]:
    """First root of the switch functions `crossing` near the time (s) from `first` to `last`.

    A function that falls slowly may have passed zero some ticks before it is below its floor.
    """
    earliest = max(0.0, first - (1 << FORCED_LEVEL) * tick)
    roots = np.full(switch_re.shape[1], np.inf)
    found = np.inf
    for j in range(roots.size):
        if (crossing >> j) & 1 == 0:
            continue
        time, change = first, np.inf
        for _ in range(MOST_REFINEMENTS):
            move(exponent, drift, time, z_entered, z)
            value = dot(switch_re[mode, j], switch_im[mode, j], z[0], z[1])
            rate = dot(rate_re[mode, j], rate_im[mode, j], z[0], z[1])
            if not rate < 0.0:
                time = last
                break
            change = -value / rate
            time = min(max(time + change, earliest), last)
            if abs(change) <= 1e-15 * max(time, tick):
                break
        roots[j] = time
        found = min(found, time)
    together = int(np.int64(0))
    for j in range(roots.size):
        if roots[j] <= found + SAME_TIME:
            together |= 1 << j
    move(exponent, drift, found, z_entered, z)
    return found, together
