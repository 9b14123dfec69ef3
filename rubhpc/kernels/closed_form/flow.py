"""One linear piece of a motion: closed form up to its first event, whose time is found to rounding."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.case_progress import NONE
from rubhpc.kernels.closed_form.event_loop import stand_still
from rubhpc.kernels.closed_form.mode_change import GAP_TOLERANCE
from rubhpc.kernels.contact_modes import (
    FORCED_LEVEL,
    bounded,
    dot,
    positive_interval,
    propagate,
)
from rubhpc.kernels.coordinate_steps import floor_log2
from rubhpc.kernels.cubics import turning_value

Floats = NDArray[np.float64]

MOST_REFINEMENTS = 30  # Newton steps to a root; two or three are usual
SAME_TIME = 1e-14  # s, within which switch functions vanish together


class PieceTables(Struct):
    """Tables of a contact mode to follow a piece: m coordinates, n reduced degrees, q pairs."""

    closed: int  # set of closed pairs
    switch_re: Floats  # (q, m), switch functions of the coordinates, real part of the product
    switch_im: Floats
    rate_re: Floats  # (q, m), of their rates
    rate_im: Floats
    bound: Floats  # (q, m), of their second derivatives
    power_re: Floats  # (levels, m), exponentials over 2^level ticks
    power_im: Floats
    exponent: Floats  # (2, m), 1/s, real and imaginary
    enter_re: Floats  # (2 n, m), coordinates of a unit motion
    enter_im: Floats
    offset: Floats  # (2, 3, m), further terms: times cosine and sine of the shaft's angle, and constant
    shape_re: Floats  # (2 n, m), motion of unit coordinates
    shape_im: Floats
    translations: Floats  # (r, n), displacements that are compared with the limit
    displacement_limit: float  # m


class PieceRoom(Struct):
    """Work space of a piece."""

    switch: Floats  # (4, q), switch functions and their rates before and after a step
    roots: Floats  # (q,)
    ahead: Floats  # (2, m)
    coordinates: Floats  # (2, 2, m), at the beginning of the piece, and at its end


class Timing(Struct):
    """Times of revolutions that are followed, and how finely they are."""

    spin: float  # rad/s
    tick: float  # s
    search_level: int  # steps up to 2^level ticks need no bound
    longest_level: int  # of steps
    begin: float  # s after the shaft's angle 0, where each revolution begins
    end: float  # s
    moment: float  # s, as in `mode_change.change_contacts`
    most_events: int  # in a revolution


def piece_room(q: int, width: int) -> PieceRoom:
    """Work space for pieces of q pairs with so many coordinates."""
    return PieceRoom(
        switch=np.zeros((4, q)),
        roots=np.zeros(q),
        ahead=np.zeros((2, width)),
        coordinates=np.empty((2, 2, width)),
    )


BEFORE, RATE_BEGUN, RATE_ENDED, GRADIENT = range(4)  # rows of the motions of a piece


@linked_sum
def follow_piece(
    tables: PieceTables,
    room: PieceRoom,
    timing: Timing,
    motion: Floats,
    begin: float,
    motions: Floats,
    rates: Floats,
    least: Floats,
) -> tuple[float, int]:
    """Follow a motion in a contact mode until a switch function falls below its floor, or to `timing.end`.

    Steps are chosen as in `event_loop.advance`. Within the last tick Newton's method finds the root, with
    exact exponentials.

    Parameters
    ----------
    motion : (2 n,)
        Reduced displacements and velocities at the beginning, `begin` (s) after the shaft's angle 0.
    motions : (4, 2 n)
        Filled in: motion at the end before the event, its rate at the beginning and at the end, and the
        gradient of the first switch function that vanishes, by the motion (unchanged where none vanishes).
    rates : (q,)
        Filled in: rates of the switch functions at the end.
    least : (2, q)
        Smallest minimum of the gap, then of the force of each pair; lowered in place.

    Returns
    -------
    float
        Time passed, s.
    int
        Pairs whose switch functions vanish; 0 at the end; -1 at an event beyond the limit of
        displacements.
    """
    entered, ended = room.coordinates[0], room.coordinates[1]
    cosine, sine = np.cos(timing.spin * begin), np.sin(timing.spin * begin)
    for part in range(2):
        rows = tables.enter_re if part == 0 else tables.enter_im
        target, offset = entered[part], tables.offset[part]
        for k in range(target.size):
            target[k] = offset[0, k] * cosine + offset[1, k] * sine + offset[2, k]
        for row in range(motion.size):
            value = motion[row]
            source = rows[row]
            for k in range(target.size):
                target[k] += source[k] * value
    time, crossing = next_event(tables, room, timing, timing.end - begin, least)
    shape_re, shape_im = tables.shape_re, tables.shape_im
    for row in range(motion.size):
        motions[BEFORE, row] = dot(shape_re[row], shape_im[row], ended[0], ended[1])
    for place in range(2):
        z, change = room.coordinates[place], room.ahead
        for k in range(z.shape[1]):
            growth, turning = tables.exponent[0, k], tables.exponent[1, k]
            change[0, k] = growth * z[0, k] - turning * z[1, k]
            change[1, k] = growth * z[1, k] + turning * z[0, k]
        for row in range(motion.size):
            motions[RATE_BEGUN + place, row] = dot(shape_re[row], shape_im[row], change[0], change[1])
    for j in range(rates.size):
        rates[j] = dot(tables.rate_re[j], tables.rate_im[j], ended[0], ended[1])
    if crossing != 0:
        for row in range(tables.translations.shape[0]):
            seen = 0.0
            for k in range(tables.translations.shape[1]):
                seen += tables.translations[row, k] * motions[BEFORE, k]
            if not abs(seen) <= tables.displacement_limit:
                return time, int(np.int64(-1))
        first = floor_log2(crossing & -crossing)
        for row in range(motion.size):
            motions[GRADIENT, row] = dot(
                tables.switch_re[first], tables.switch_im[first], tables.enter_re[row], tables.enter_im[row]
            )
    return time, crossing


@linked_sum
def next_event(
    tables: PieceTables,
    room: PieceRoom,
    timing: Timing,
    duration: float,
    least: Floats,
) -> tuple[float, int]:
    """Find the first event within a duration (s) from `room.coordinates[0]` on; fills in those at its end."""
    tick, search_level, longest_level = timing.tick, timing.search_level, timing.longest_level
    z_entered, z = room.coordinates[0], room.coordinates[1]
    switch_re, switch_im = tables.switch_re, tables.switch_im
    rate_re, rate_im = tables.rate_re, tables.rate_im
    bound, closed, exponent = tables.bound, tables.closed, tables.exponent
    power_re, power_im = tables.power_re, tables.power_im
    q, m = bound.shape
    now, now_rate, then, then_rate = room.switch[0], room.switch[1], room.switch[2], room.switch[3]
    ahead = room.ahead
    for k in range(m):
        z[0, k], z[1, k] = z_entered[0, k], z_entered[1, k]
    read_switches(switch_re, switch_im, rate_re, rate_im, z, now, now_rate)
    n_tick = int(duration / tick)
    passed, halving = 0, NONE
    is_forced = below(now, closed) != 0
    while True:
        is_last = passed >= n_tick
        level = 0
        if is_last:
            move(exponent, duration, z_entered, ahead)
            step = duration - passed * tick
        else:
            level = min(longest_level, floor_log2(n_tick - passed))
            if is_forced:
                level = min(level, FORCED_LEVEL)
            elif halving >= 0:
                level = min(level, halving)
            else:
                free = np.inf
                for j in range(q):
                    b = bounded(bound[j], z[0], z[1])
                    free = min(free, positive_interval(now[j], now_rate[j], b))
                while level > search_level and (1 << level) * tick > free:
                    level -= 1
            step = (1 << level) * tick
            propagate(power_re[level], power_im[level], z[0], z[1], ahead[0], ahead[1])
        read_switches(switch_re, switch_im, rate_re, rate_im, ahead, then, then_rate)
        crossing = int(np.int64(0))  # no literal: callers are compiled for one type
        if not is_forced:
            crossing = below(then, closed)
        if (
            crossing != 0
            and level > 0
            and not is_last
            and not stand_still(crossing, switch_re, switch_im, z[0], z[1], ahead[0], ahead[1])
        ):
            halving = level - 1
            continue
        if crossing != 0:
            first, last = passed * tick, min(duration, (passed + 1) * tick)
            return refine(tables, room.roots, crossing, first, last, tick, z_entered, z)
        for j in range(q):
            if now_rate[j] < 0.0 and then_rate[j] > 0.0:
                value, kind = turning_value(now[j], now_rate[j], then[j], then_rate[j], step), closed >> j & 1
                if value > -floor_of(closed, j):  # a gap that just opened is zero up to rounding
                    least[kind, j] = min(least[kind, j], value)
            now[j], now_rate[j] = then[j], then_rate[j]
        for k in range(m):
            z[0, k], z[1, k] = ahead[0, k], ahead[1, k]
        if is_last:
            return duration, crossing
        passed += 1 << level
        is_forced = False
        halving = max(halving - 1, NONE)


@linked_sum
def read_switches(
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    z: Floats,
    value: Floats,
    rate: Floats,
) -> None:
    """Switch functions (q,) and their rates."""
    for j in range(value.size):
        value[j] = dot(switch_re[j], switch_im[j], z[0], z[1])
        rate[j] = dot(rate_re[j], rate_im[j], z[0], z[1])


@linked_sum
def floor_of(closed: int, j: int) -> float:
    """Value below which the switch function of a pair counts as negative."""
    return 0.0 if closed >> j & 1 else -GAP_TOLERANCE


@linked_sum
def below(value: Floats, closed: int) -> int:
    """Pairs whose switch functions are below their floors."""
    crossing = int(np.int64(0))  # no literal: callers are compiled for one type
    for j in range(value.size):
        if value[j] < floor_of(closed, j):
            crossing |= 1 << j
    return crossing


@linked_sum
def move(exponent: Floats, time: float, z_entered: Floats, z: Floats) -> None:
    """Coordinates (2, m) a time (s) after `z_entered`."""
    for k in range(z.shape[1]):
        size = np.exp(exponent[0, k] * time)
        turn = exponent[1, k] * time
        re, im = size * np.cos(turn), size * np.sin(turn)
        z[0, k] = re * z_entered[0, k] - im * z_entered[1, k]
        z[1, k] = re * z_entered[1, k] + im * z_entered[0, k]


@linked_sum
def refine(
    tables: PieceTables,
    roots: Floats,
    crossing: int,
    first: float,
    last: float,
    tick: float,
    z_entered: Floats,
    z: Floats,
) -> tuple[float, int]:
    """First root of the switch functions `crossing` near the time (s) from `first` to `last`.

    A function that falls slowly may pass zero some ticks before it falls below its floor.
    """
    exponent = tables.exponent
    switch_re, switch_im = tables.switch_re, tables.switch_im
    rate_re, rate_im = tables.rate_re, tables.rate_im
    earliest = max(0.0, first - (1 << FORCED_LEVEL) * tick)
    found = np.inf
    for j in range(roots.size):
        roots[j] = np.inf
        if (crossing >> j) & 1 == 0:
            continue
        time, change = first, np.inf
        for _ in range(MOST_REFINEMENTS):
            move(exponent, time, z_entered, z)
            value = dot(switch_re[j], switch_im[j], z[0], z[1])
            rate = dot(rate_re[j], rate_im[j], z[0], z[1])
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
    move(exponent, found, z_entered, z)
    return found, together
