"""Pieces of a run-up, one after the other, each at a speed to which the tables are tuned beforehand."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_lean_sum
from rubhpc.kernels.accumulators import Accumulator
from rubhpc.kernels.case_progress import (
    DIVERGED,
    FINISHED,
    LONG_AGO,
    MODE_WANTED,
    NONE,
    Clock,
    Progress,
)
from rubhpc.kernels.contact_modes import ModeTables, Reduced, dot, enter, find_mode, is_within
from rubhpc.kernels.event_loop import EventWork, advance
from rubhpc.kernels.penalty_events import pressed_pairs

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Samples
    from rubhpc.kernels.measuring import Recorder

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PIECE, PART, STAGE = range(3)  # of `Pieces.at`
TO_BEGIN, TO_ENTER, PART_TO_BEGIN, IN_PART = range(4)  # stages of a piece


class Pieces(NamedTuple):
    """Pieces that have matrices and a number of samples in common, k of them, in c parts each."""

    spin: Floats  # (k,), rad/s
    tick: Floats  # (k,), s
    search_level: Ints  # (k,)
    force: Floats  # (k, 2, n), of the unbalance: times cosine and sine of the shaft's angle
    since: Floats  # (k,), s, from the beginning of the piece before to that of this one
    table: Ints  # (p,), set of closed pairs of each of the tables, NONE for one that is not tuned
    n_room: int  # tables of each set, one a piece
    n_sample: int  # of a piece
    n_part_sample: int  # of each of its parts, which have sums of their own
    energy_limit: float  # J
    at: Ints  # (3,), which piece, which part of it, and the stage that it is in
    motion: Floats  # (k + 1, 2 n), at the beginning of each piece; of the first one given
    pressing: Floats  # (k + 1, q), N, contact forces there
    seen: Floats  # (2, 3 + places), `Recorder.last` at the beginning of the piece under way
    n_step: Ints  # (k,), steps taken
    whole: Floats  # (o, k n_sample), samples


@jit_lean_sum
def advance_pieces(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    pieces: Pieces,
    progress: Progress,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    work: EventWork,
    recorder: Recorder,
    samples: Samples,
    sums: Accumulator,
) -> int:
    """Advance a case through pieces, from where `pieces.at` says, with every sample recorded.

    Parameters
    ----------
    tables : ModeTables
        Their masks are set to those of the piece under way.
    reduced : Reduced
        Its unbalance and rim speeds are set.
    clock : Clock
        Of any piece; `n_sample` is that of all.
    samples : Samples
        Of one piece.
    sums : Accumulator
        (1 + k c, ...) each: of what came before, then of every part of the pieces; at zero.

    Returns
    -------
    int
        FINISHED, or what `event_loop.advance` stopped with in the piece under way. MODE_WANTED asks for the
        set `progress.wanted`, tuned to that piece and those after it.
    """
    at, n_part = pieces.at, pieces.n_sample // pieces.n_part_sample
    while at[PIECE] < pieces.spin.size:
        piece = at[PIECE]
        set_masks(tables.mask, pieces.table, pieces.n_room, piece)
        spin, tick = pieces.spin[piece], pieces.tick[piece]
        now = Clock(
            spin,
            tick,
            clock.sample_level,
            clock.samples_per_revolution,
            pieces.search_level[piece],
            clock.contact_level,
            pieces.n_sample,
        )
        if at[STAGE] == TO_BEGIN:
            for k in range(reduced.force_cosine.size):
                reduced.force_cosine[k], reduced.force_sine[k] = (
                    pieces.force[piece, 0, k],
                    pieces.force[piece, 1, k],
                )
            for i in range(reduced.radius.size):
                reduced.rim_speed[i] = reduced.radius[i] * abs(spin)
            for row in range(2):
                for j in range(pieces.seen.shape[1]):
                    pieces.seen[row, j] = recorder.last[row, j]
            for row in range(samples.whole.shape[0]):
                for j in range(pieces.n_sample):
                    samples.whole[row, j] = 0.0
            progress.wanted = first_set(reduced, pieces.motion[piece], pieces.pressing[piece])
            at[STAGE] = TO_ENTER
        if at[STAGE] == TO_ENTER:
            if not begin_piece(tables, reduced, pieces.motion[piece], progress, z):
                return MODE_WANTED
            at[PART], at[STAGE] = 0, PART_TO_BEGIN
        while at[PART] < n_part:
            place = 1 + piece * n_part + at[PART]
            part = row_of(sums, place)
            if at[STAGE] == PART_TO_BEGIN:
                since = pieces.since[piece] if at[PART] == 0 else 0.0
                begin_part(part, row_of(sums, place - 1), since, tables.mask[progress.mode])
                progress.next_sample, progress.n_event = at[PART] * pieces.n_part_sample, 0
                at[STAGE] = IN_PART
            last_tick = ((at[PART] + 1) * pieces.n_part_sample) << clock.sample_level
            outcome = advance(
                tables,
                reduced,
                now,
                last_tick,
                True,
                progress,
                z,
                z_next,
                motion,
                work,
                recorder,
                samples,
                part,
            )
            if outcome != FINISHED:
                return outcome
            read_motion(tables, progress.mode, z, pieces.motion[piece + 1])
            if not is_within(
                pieces.motion[piece + 1],
                reduced.translations,
                reduced.stiffness,
                part.highest,
                part.lowest,
                reduced.displacement_limit,
                pieces.energy_limit,
            ):
                return DIVERGED
            at[PART] += 1
            at[STAGE] = PART_TO_BEGIN
        read_forces(tables, progress.mode, z, pieces.pressing[piece + 1])
        pieces.n_step[piece] = progress.n_step
        first = piece * pieces.n_sample
        for row in range(samples.whole.shape[0]):
            for j in range(pieces.n_sample):
                pieces.whole[row, first + j] = samples.whole[row, j]
        at[PIECE], at[STAGE] = piece + 1, TO_BEGIN
    return FINISHED


@jit_inline_sum
def set_masks(mask: Ints, table: Ints, n_room: int, piece: int) -> None:
    """Show the tables that are tuned to a piece, and no others."""
    for place in range(mask.size):
        mask[place] = table[place] if place % n_room == piece else NONE


@jit_lean_sum
def first_set(reduced: Reduced, motion: Floats, pressing: Floats) -> int:
    """Set of closed pairs with which a piece begins, in a motion (2 n,) with contact forces (q,), N."""
    if reduced.spring > 0.0:
        return pressed_pairs(reduced, motion)
    found = int(np.int64(0))  # no literal: callers are compiled for one type
    for i in range(pressing.size):
        if pressing[i] > 0.0:
            found |= 1 << i
    return found


@jit_lean_sum
def begin_piece(tables: ModeTables, reduced: Reduced, motion: Floats, progress: Progress, z: Floats) -> bool:
    """Begin in the set wanted, at the shaft's angle 0; False where it is not tuned."""
    mode = find_mode(tables.mask, progress.wanted)
    if mode < 0:
        return False
    enter(tables, mode, reduced.clearance, 1.0, 0.0, motion, z)
    progress.tick, progress.mode, progress.wanted, progress.n_step = 0, mode, NONE, 0
    progress.n_event, progress.counted_from, progress.next_sample = 0, 0, 0
    progress.entered, progress.energy_from, progress.contact_age = LONG_AGO, NONE, NONE
    progress.resolved_level, progress.halving_level, progress.is_after_event = 0, NONE, 0
    return True


@jit_lean_sum
def read_motion(tables: ModeTables, mode: int, z: Floats, motion: Floats) -> None:
    """Fill in the reduced motion (2 n,) of coordinates (2, m)."""
    for row in range(motion.size):
        motion[row] = dot(tables.motion_re[mode, row], tables.motion_im[mode, row], z[0], z[1])


@jit_lean_sum
def read_forces(tables: ModeTables, mode: int, z: Floats, force: Floats) -> None:
    """Fill in the contact forces (q,), N, of coordinates (2, m)."""
    for i in range(force.size):
        force[i] = 0.0
        if (tables.mask[mode] >> i) & 1:
            force[i] = dot(tables.switch_re[mode, i], tables.switch_im[mode, i], z[0], z[1])


@jit_inline_sum
def begin_part(part: Accumulator, before: Accumulator, since: float, closed: int) -> None:
    """Go on from the sums before, whose clock began `since` (s) ago, with the pairs of `closed` touching."""
    q, n_row, n = part.force_piece.shape
    for i in range(q):
        for row in range(n_row):
            for k in range(n):
                part.force_piece[i, row, k] = before.force_piece[i, row, k]
        for k in range(2):
            part.force_held[i, k] = before.force_held[i, k]
    part.origin[0] = before.origin[0] + since
    for i in range(part.is_touching.size):
        part.is_touching[i] = (closed >> i) & 1 == 1


@jit_inline_sum
def row_of(sums: Accumulator, i: int) -> Accumulator:
    """Those of one part."""
    return Accumulator(
        sums.highest[i],
        sums.lowest[i],
        sums.is_touching[i],
        sums.n_contact[i],
        sums.contact_time[i],
        sums.impulse[i],
        sums.stick_time[i],
        sums.sense[i],
        sums.reversals[i],
        sums.friction_work[i],
        sums.least_slip[i],
        sums.peak_force[i],
        sums.force_piece[i],
        sums.force_held[i],
        sums.origin[i],
        sums.peak_lateral[i],
        sums.energy[i],
        sums.pivots[i],
        sums.residual[i],
    )
