"""Where an event falls within a step at whose end a switch function is found negative.

A bracket of whole ticks is narrowed by Newton's method on the closed-form switch functions, from a parabola
through what is known at both ends, and by bisection where that fails. Coordinates at a tick are reached by
powers of two of ticks, the shortest first, so that they are the same whatever was tried before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum
from rubhpc.kernels.contact_modes import ModeTables, dot, floor_log2, propagate
from rubhpc.kernels.event_bounds import FREE
from rubhpc.kernels.event_steps import GAP_TOLERANCE
from rubhpc.kernels.friction_coordinates import used_width
from rubhpc.kernels.friction_states import OPEN, STUCK, FrictionBodies, state_of, stuck_pairs

if TYPE_CHECKING:
    from rubhpc.kernels.case_progress import Clock

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEWTON_TRIES = 6  # places tried before the bracket is halved instead


@jit_inline_sum
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


@jit_inline_sum
def changes_at(tables: ModeTables, mode: int, z: Floats, overlap: float, tick: int, known: Ints) -> int:
    """Bits of the switch functions that are negative at coordinates (2, m)."""
    used = used_width(tables, mode)
    z_re, z_im = z[0, :used], z[1, :used]
    return int(
        find_change(
            tables.mask[mode],
            mode,
            tables.switch_re,
            tables.switch_im,
            z_re,
            z_im,
            tables.rate_re,
            tables.rate_im,
            overlap,
            tick,
            known,
        )
    )


@jit_inline_sum
def turn_by(re: Floats, im: Floats, z_re: Floats, z_im: Floats) -> None:
    """Take modal coordinates on by a tabulated step, in place."""
    for k in range(z_re.size):
        a, b = z_re[k], z_im[k]
        z_re[k] = re[k] * a - im[k] * b
        z_im[k] = re[k] * b + im[k] * a


@jit_inline_sum
def take_step(
    count: int,
    mode: int,
    power_re: Floats,
    power_im: Floats,
    z_re: Floats,
    z_im: Floats,
    re: Floats,
    im: Floats,
) -> None:
    """Fill `re` and `im` with modal coordinates `count` ticks later, at least one, as `move_ticks` does."""
    level = lowest_level(count)
    propagate(power_re[mode, level], power_im[mode, level], z_re, z_im, re, im)
    rest = count >> (level + 1)
    while rest > 0:
        level += 1
        if rest & 1 == 1:
            turn_by(power_re[mode, level], power_im[mode, level], re, im)
        rest >>= 1


@jit_inline_sum
def lowest_level(count: int) -> int:
    """Level of the shortest of the powers of two that make up a count of at least one."""
    level = 0
    while (count >> level) & 1 == 0:
        level += 1
    return level


@jit_inline_sum
def move_ticks(
    tables: ModeTables, bodies: FrictionBodies, mode: int, count: int, tick: float, z: Floats, target: Floats
) -> None:
    """Fill `target` (2, m) with the coordinates `count` ticks (s) after `z`, as many as are used."""
    used = used_width(tables, mode)
    z_re, z_im = target[0, :used], target[1, :used]
    for k in range(used):
        z_re[k], z_im[k] = z[0, k], z[1, k]
    q = bodies.rim_speed.size
    states, first = tables.mask[mode], tables.n_eigenmode[mode] + 2 + q
    for level in range(floor_log2(max(1, count)) + 1):  # downwards no compiler would prove them apart
        if (count >> level) & 1 == 1:
            turn_by(tables.power_re[mode, level], tables.power_im[mode, level], z_re, z_im)
            if stuck_pairs(states) != 0:
                for i in range(q):
                    if state_of(states, i) == STUCK:
                        z_re[first + i] += bodies.rim_speed[i] * ((1 << level) * tick)


@jit_inline_sum
def root_ahead(tables: ModeTables, mode: int, crossing: int, tick: float, z: Floats) -> float:
    """Ticks (s) to the first root of the switch functions `crossing`, by Newton's method from `z` (2, m).

    -inf where one is not falling.
    """
    states, used = tables.mask[mode], used_width(tables, mode)
    z_re, z_im = z[0, :used], z[1, :used]
    found = np.inf
    for j in range(tables.switch_re.shape[1]):
        if (crossing >> j) & 1 == 0:
            continue
        value = dot(tables.switch_re[mode, j], tables.switch_im[mode, j], z_re, z_im)
        value += GAP_TOLERANCE if state_of(states, j // 2) == OPEN else 0.0
        rate = dot(tables.rate_re[mode, j], tables.rate_im[mode, j], z_re, z_im) * tick
        found = min(found, -value / rate if rate < 0.0 else -np.inf)
    return found


@jit_inline_sum
def root_between(
    tables: ModeTables, mode: int, crossing: int, count: int, tick: float, z: Floats, end: Floats
) -> float:
    """Ticks (s) after `z` (2, m) of the first root, by parabolas through both ends of `count` ticks."""
    states, used = tables.mask[mode], used_width(tables, mode)
    z_re, z_im, end_re, end_im = z[0, :used], z[1, :used], end[0, :used], end[1, :used]
    found = 1.0 * count
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


@jit_inline_sum
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
    kept: Floats,
    now: int,
    known: Ints,
) -> tuple[int, int]:
    """Go to the last tick before a switch function is negative, within a step of `count` ticks.

    Parameters
    ----------
    crossing : int
        Bits of the switch functions that are negative at its end.
    overlap : float, m
        As in `find_change`.
    z : (2, m)
        Coordinates at its beginning; in place, those at that tick.
    work : (2, m)
        Those at its end; overwritten.
    kept : (2, m)
        Work space: those at the last tick that is known to lie before.
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
    root = root_between(tables, mode, crossing, after, clock.tick, z, work)
    tried = 0
    while after - before > 1:
        tried += 1
        place = (before + after) // 2
        if tried <= NEWTON_TRIES and 0.0 <= root < 1.0 * after:
            place = min(max(int(root), before + 1), after - 1)
        move_ticks(tables, bodies, mode, place, clock.tick, z, work)
        found = changes_at(tables, mode, work, overlap, now + place, known)
        if found != 0:
            after, crossing = place, found
        else:
            before = place
            for k in range(used):
                kept[0, k], kept[1, k] = work[0, k], work[1, k]
        # Where the root is between this tick and the next one, that is looked at; then this.
        root = place + root_ahead(tables, mode, crossing, clock.tick, work)
        if found == 0 and place <= root < place + 1.0:
            root = place + 1.0
    if before > 0:
        for k in range(used):
            z[0, k], z[1, k] = kept[0, k], kept[1, k]
    return before, crossing
