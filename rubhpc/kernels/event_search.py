"""Where an event falls within a step at whose end a switch function is found negative.

A bracket of whole ticks is narrowed by Newton's method on the closed-form switch functions, from a parabola
through what is known at both ends, and by bisection where that fails. Each place is reached from the last
one that is known to lie before the event, in few powers of two of ticks where it is near.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import ModeTables, dot, used_width
from rubhpc.kernels.coordinate_steps import floor_log2, go_on
from rubhpc.kernels.event_bounds import FREE
from rubhpc.kernels.friction_states import OPEN, STUCK, FrictionBodies, state_of, stuck_pairs
from rubhpc.kernels.mode_change import GAP_TOLERANCE

if TYPE_CHECKING:
    from rubhpc.kernels.case_progress import Clock

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEWTON_TRIES = 6  # places tried before the bracket is halved instead
DOUBTFUL = 0.01  # of what a function changes by in a tick: one that is nearer to zero may be on either side
KNOWN_BITS = 4  # of the first of them, behind the first bit


@linked_sum
def find_change(
    states: int,
    mode: int,
    switch_re: Floats,
    switch_im: Floats,
    z_re: Floats,
    z_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    overlap: float,
    tick: int,
    known: Ints,
) -> int:
    """Bits of the switch functions (2 q, m) of a set of states that are negative at a tick.

    Those that are known to be positive until then (`event_bounds.free_until`) are not looked at. The gap of a
    pair that parts is none of them up to an `overlap` (m): modes that follow the speed leave one as they are
    entered.
    """
    crossing = int(np.int64(0))
    for j in range(switch_re.shape[1]):
        is_open = state_of(states, j // 2) == OPEN
        if (is_open and j % 2 == 1) or known[FREE, j] >= tick:
            continue
        value = dot(switch_re[mode, j], switch_im[mode, j], z_re, z_im)
        if value < (-GAP_TOLERANCE if is_open else 0.0) and (
            not is_open or value < -overlap or dot(rate_re[mode, j], rate_im[mode, j], z_re, z_im) < 0.0
        ):
            crossing |= 1 << j
    return crossing


@linked_sum
def move_ticks(
    tables: ModeTables, bodies: FrictionBodies, mode: int, count: int, tick: float, z: Floats, target: Floats
) -> None:
    """Fill `target` (2, m) with the coordinates `count` ticks (s) after `z`, as many as are used.

    At most `longest_move` ticks: there are no exponentials over more.
    """
    used = used_width(tables, mode)
    z_re, z_im = target[0, :used], target[1, :used]
    go_on(count, tables.power_re[mode], tables.power_im[mode], z[0, :used], z[1, :used], z_re, z_im)
    states = tables.mask[mode]
    if stuck_pairs(states) != 0:
        move_stuck(states, tables.n_eigenmode[mode], bodies.rim_speed, count * tick, z_re)


@linked_sum
def longest_move(tables: ModeTables) -> int:
    """Ticks that can be passed at once: those of all levels of exponentials together."""
    return int((1 << tables.power_re.shape[1]) - 1)


@linked_sum
def move_stuck(states: int, n_eigenmode: int, rim_speed: Floats, time: float, z_re: Floats) -> None:
    """Add to the displacements along the rims of pairs that stick what the rims move in a time (s)."""
    q = rim_speed.size
    for i in range(q):
        if state_of(states, i) == STUCK:
            z_re[n_eigenmode + 2 + q + i] += rim_speed[i] * time


@linked_sum
def look_ahead(
    tables: ModeTables,
    mode: int,
    crossing: int,
    overlap: float,
    tick: float,
    place: int,
    known: Ints,
    z_re: Floats,
    z_im: Floats,
) -> tuple[int, int, bool, float]:
    """What the switch functions are about to do at coordinates (m,), by their parabolas there.

    Parameters
    ----------
    crossing : int
        Bits of those whose root is wanted where none is negative.
    tick : float, s
    place : int
        Tick at which the coordinates stand.
    known : (2, 2 q)
        As `find_change` reads it, a tick later.

    Returns
    -------
    int
        Bits of those that are negative, as of `find_change`.
    int
        Bits of those that are so a tick later.
    bool
        Whether that is beyond doubt.
    float
        Ticks to the first root, of the first of these that there are any of, or of `crossing`: negative where
        it lies behind, -inf where none is found.
    """
    states, found, soon, is_clear = tables.mask[mode], int(np.int64(0)), int(np.int64(0)), True
    behind, ahead = np.inf, np.inf
    for j in range(tables.switch_re.shape[1]):
        is_open = state_of(states, j // 2) == OPEN
        if (is_open and j % 2 == 1) or known[FREE, j] > place:
            continue
        re, im, turning_re, turning_im, bending_re, bending_im = (
            tables.switch_re[mode, j],
            tables.switch_im[mode, j],
            tables.rate_re[mode, j],
            tables.rate_im[mode, j],
            tables.bend_re[mode, j],
            tables.bend_im[mode, j],
        )
        value, rate, bend = 0.0, 0.0, 0.0
        for k in range(z_re.size):
            a, b = z_re[k], z_im[k]
            value += re[k] * a - im[k] * b
            rate += turning_re[k] * a - turning_im[k] * b
            bend += bending_re[k] * a - bending_im[k] * b
        value += GAP_TOLERANCE if is_open else 0.0
        later = value + tick * (rate + 0.5 * tick * bend)
        root = np.sqrt(max(rate * rate - 2.0 * bend * value, 0.0))
        root = 2.0 * value / (root - rate) if rate < 0.0 else -np.inf
        if value < 0.0 and (not is_open or rate < 0.0 or value < GAP_TOLERANCE - overlap):
            found, behind = found | 1 << j, min(behind, root)
        elif (crossing >> j) & 1 == 1:
            ahead = min(ahead, root)
        if later < 0.0 and (not is_open or rate < 0.0 or later < GAP_TOLERANCE - overlap):
            soon |= 1 << j
        is_clear = is_clear and abs(later) > DOUBTFUL * tick * abs(rate)
    return found, soon, is_clear, (behind if found != 0 else ahead) / tick


@linked_sum
def root_between(
    tables: ModeTables,
    mode: int,
    crossing: int,
    count: int,
    tick: float,
    z_re: Floats,
    z_im: Floats,
    end_re: Floats,
    end_im: Floats,
) -> float:
    """Ticks (s) after coordinates (m,) of the first root, by parabolas through both ends of `count` ticks."""
    states, found = tables.mask[mode], 1.0 * count
    for j in range(tables.switch_re.shape[1]):
        if (crossing >> j) & 1 == 0:
            continue
        re, im = tables.switch_re[mode, j], tables.switch_im[mode, j]
        offset = GAP_TOLERANCE if state_of(states, j // 2) == OPEN else 0.0
        first, last = dot(re, im, z_re, z_im) + offset, dot(re, im, end_re, end_im) + offset
        if not first > 0.0:
            return 0.0
        rate = dot(tables.rate_re[mode, j], tables.rate_im[mode, j], z_re, z_im) * (tick * count)
        bend = last - first - rate  # the parabola first + rate x + bend x^2, x from 0 to 1
        root = np.sqrt(max(rate * rate - 4.0 * bend * first, 0.0))
        share = 2.0 * first / (root - rate) if rate <= 0.0 else (-rate - root) / (2.0 * bend)
        found = min(found, share * count)
    return found


@linked_sum
def approach_change(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    mode: int,
    crossing: int,
    overlap: float,
    count: int,
    z: Floats,
    work: Floats,
    now: int,
    known: Ints,
) -> tuple[int, int]:
    """Go to the last tick before a switch function is negative, within a step of `count` ticks.

    Parameters
    ----------
    crossing : int
        Bits of the switch functions that are negative at its end.
    overlap : float, m
        As of `find_change`.
    z : (2, m)
        Coordinates at its beginning; in place, those at that tick.
    work : (2, m)
        Those at its end; overwritten.
    now : int
        Tick at the beginning.
    known : (2, 2 q)
        As `event_bounds.free_until` fills it.

    Returns
    -------
    int
        Ticks passed.
    int
        Bits of the switch functions that are negative a tick later.
    """
    before, after = 0, count
    used = used_width(tables, mode)
    z_re, z_im, work_re, work_im = z[0, :used], z[1, :used], work[0, :used], work[1, :used]
    root = root_between(tables, mode, crossing, count, clock.tick, z_re, z_im, work_re, work_im)
    tried = 0
    while after - before > 1:
        tried += 1
        place = (before + after) // 2
        if tried <= NEWTON_TRIES and 1.0 * before <= root < 1.0 * after:
            place = min(max(int(root), before + 1), after - 1)
            if tried == 1:  # no more digits than are known
                place = max(place - place % (1 << floor_log2(max(1, place >> KNOWN_BITS))), 1)
        move_ticks(tables, bodies, mode, place - before, clock.tick, z, work)
        found, soon, is_clear, root = look_ahead(
            tables, mode, crossing, overlap, clock.tick, now + place, known, work_re, work_im
        )
        crossing = found if found != 0 else crossing
        root += place
        if found != 0:
            after = place
            continue
        before = place
        for k in range(used):
            z_re[k], z_im[k] = work_re[k], work_im[k]
        if soon != 0 and is_clear:
            return before, soon
        # Where the root is between this tick and the next one, that is looked at; then this.
        if place <= root < place + 1.0:
            root = place + 1.0
    return before, crossing
