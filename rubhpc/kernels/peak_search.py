"""The force of a pair under set-valued friction in short pieces, where it may be larger than ever before."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.accumulators import observe_force
from rubhpc.kernels.contact_modes import DYING, RESOLVED, ModeTables, copy_coordinates, dot
from rubhpc.kernels.coordinate_steps import floor_log2
from rubhpc.kernels.event_search import longest_move, move_ticks
from rubhpc.kernels.force_average import AVERAGING_TIME, BEGIN, COUNT, END, IMPULSE, OLDEST
from rubhpc.kernels.friction_states import STUCK, FrictionBodies, state_of
from rubhpc.kernels.friction_work import gains

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator
    from rubhpc.kernels.case_progress import Clock
    from rubhpc.kernels.sampling import Measured

Floats = NDArray[np.float64]

# Of the averaging time: until that age of a contact, pieces may miss more of what lasts for a shorter time.
SETTLED = 0.125
FIRST = 1 / 32  # of the averaging time: length of the first piece after an event, if that follows the force


@linked_sum
def resolved_force(tables: ModeTables, mode: int, i: int, age: float, z: Floats) -> float:
    """Time, s, over which a parabola with its impulse follows the force of closed pair i from (2, m).

    As `contact_modes.resolved_time`, but for what an event has set off less than a share of the averaging
    time ago: of that, impulses are asked for, not values, and the shorter the `age` (s) of the contact, the
    less of them can be missed. Sizes are bounded by those of real and imaginary parts.
    """
    is_stuck = state_of(tables.mask[mode], i) == STUCK
    re, im, pace = tables.switch_re[mode, 2 * i], tables.switch_im[mode, 2 * i], tables.pace[mode]
    next_re, next_im = tables.switch_re[mode, 2 * i + 1], tables.switch_im[mode, 2 * i + 1]
    both, whole, bend = 1.0 if is_stuck else 0.0, 0.0, 0.0
    for k in range(z.shape[1]):
        if pace[k] > DYING:
            size = abs(re[k] + both * next_re[k]) + abs(im[k] + both * next_im[k])
            part, square = size * (abs(z[0, k]) + abs(z[1, k])), pace[k] * pace[k]
            whole += part
            bend += part * square * square
    spared = max(1.0, SETTLED * AVERAGING_TIME / age)
    return float(np.sqrt(np.sqrt(0.25 * RESOLVED * spared * whole / bend))) if bend > 0.0 else np.inf


@linked_sum
def recent_impulse(i: int, time: float, accumulator: Accumulator) -> float:
    """What impacts have given to pair i within the averaging time before a `time` (s), N s."""
    piece, most = accumulator.force_piece[i], accumulator.force_piece.shape[2]
    oldest, count = accumulator.force_held[i, OLDEST], accumulator.force_held[i, COUNT]
    begin, given = time + accumulator.origin[0] - AVERAGING_TIME, 0.0
    for back in range(1, count + 1):
        k = (oldest + count - back) % most
        if piece[END, k] <= begin:
            break
        given += piece[IMPULSE, k] if piece[END, k] == piece[BEGIN, k] else 0.0
    return given


@linked_sum
def follow_force(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    mode: int,
    i: int,
    begin: int,
    now: int,
    stop: int,
    calm_from: int,
    calm_to: int,
    z: Floats,
    measured: Measured,
) -> None:
    """Add the force of closed pair i between two ticks of a span, at the first of them with `z` (2, m).

    What an event sets off is fast at first: no piece but the first is longer than the contact mode has
    lasted. From `calm_from` to `calm_to` pieces are long.
    """
    at, ahead = measured.recorder.path[2], measured.recorder.path[3]
    copy_coordinates(z, at)
    copy_coordinates(z, ahead)
    first = int(FIRST * AVERAGING_TIME / clock.tick) + 1
    is_stuck = state_of(tables.mask[mode], i) == STUCK
    share = 0.5 / bodies.static[i] if is_stuck else 1.0
    before = force_at(tables, mode, i, share, is_stuck, at)
    while now < stop:
        if calm_from <= now < calm_to:
            longest = min(calm_to - now, longest_move(tables))
        else:
            age = max(now - begin, first)
            resolved = resolved_force(tables, mode, i, age * clock.tick, at) / clock.tick
            longest = 1 << floor_log2(int(max(1.0, min(resolved, 1.0 * age, 1.0 * (stop - now)))))
        count = min(longest, stop - now)
        move_ticks(tables, bodies, mode, count, clock.tick, at, ahead)
        after = force_at(tables, mode, i, share, is_stuck, ahead)
        time = count * clock.tick
        gained, other = gains(tables, mode, i, time, at, ahead)
        impulse = share * (gained + other) if is_stuck else gained
        observe_force(i, now * clock.tick, time, impulse, before, after, measured.accumulator)
        before, now = after, now + count
        at, ahead = ahead, at


@linked_sum
def force_at(tables: ModeTables, mode: int, i: int, share: float, is_stuck: bool, z: Floats) -> float:
    """Normal force of closed pair i, N, at coordinates (2, m)."""
    force = dot(tables.switch_re[mode, 2 * i], tables.switch_im[mode, 2 * i], z[0], z[1])
    if is_stuck:
        force += dot(tables.switch_re[mode, 2 * i + 1], tables.switch_im[mode, 2 * i + 1], z[0], z[1])
    return share * force
