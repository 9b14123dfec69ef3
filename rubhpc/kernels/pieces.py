"""Pieces of a run-up with the same matrices: common parts of the loops over them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import inlined, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.accumulators import Accumulator
from rubhpc.kernels.case_progress import LONG_AGO, NONE, Clock, Progress
from rubhpc.kernels.contact_modes import DYING, ModeTables, Reduced, enter, find_mode, is_within, leave
from rubhpc.kernels.force_average import LOUD

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Samples
    from rubhpc.kernels.sampling import Recorder

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PIECE, PART, STAGE, STANDING = range(4)  # of `Pieces.at`
TO_BEGIN, TO_ENTER, PART_TO_BEGIN, IN_PART = range(4)  # stages of a piece
# Frequency of a mode over the spin, and times the duration of a piece, above which it continues unchanged
# where the speed changes.
FAST, QUICK = 3.0, 0.5 * np.pi


class Pieces(Struct):
    """The k pieces with the same matrices and number of samples, in c parts each."""

    spin: Floats  # (k,), rad/s
    growth: Floats  # (k,), 1/s, of the unbalance force
    tick: Floats  # (k,), s
    search_level: Ints  # (k,)
    force: Floats  # (k, 2, n), of the unbalance: times cosine and sine of the shaft's angle
    since: Floats  # (k,), s, from the beginning of the previous piece to that of this one
    table: Ints  # (p,), set of closed pairs of each of the tables, NONE for one that is not tuned
    n_room: int  # tables of each set, for as many consecutive pieces
    n_sample: int  # of a piece
    n_part_sample: int  # of each of its parts, which have their own sums
    energy_limit: float  # J
    at: Ints  # (4,), piece, part of it, stage, set of contacts before it
    follows: bool  # whether modes follow the speed
    left: Floats  # (2, m), coordinates at the end of the previous piece
    motion: Floats  # (k + 1, 2 n), at the beginning of each piece; given for the first one
    pressing: Floats  # (k + 1, q), N, contact forces there
    seen: Floats  # (2, 3 + places), `Recorder.last` at the beginning of the current piece
    n_step: Ints  # (k,), steps taken
    whole: Floats  # (o, k n_sample), samples


@inlined
def clock_of(clock: Clock, pieces: Pieces, piece: int) -> Clock:
    """Clock of a piece, from that of any other."""
    return Clock(
        pieces.spin[piece],
        pieces.tick[piece],
        clock.sample_level,
        clock.samples_per_revolution,
        pieces.search_level[piece],
        clock.contact_level,
        pieces.n_sample,
        pieces.growth[piece],
    )


@linked_sum
def start_piece(reduced: Reduced, pieces: Pieces, piece: int, recorder: Recorder, samples: Samples) -> None:
    """Set unbalance and rims to the speed of a piece, and clear the arrays for its samples."""
    for k in range(reduced.force_cosine.size):
        reduced.force_cosine[k], reduced.force_sine[k] = pieces.force[piece, 0, k], pieces.force[piece, 1, k]
    for i in range(reduced.radius.size):
        reduced.rim_speed[i] = reduced.radius[i] * abs(pieces.spin[piece])
    for row in range(2):
        for j in range(pieces.seen.shape[1]):
            pieces.seen[row, j] = recorder.last[row, j]
    for row in range(samples.whole.shape[0]):
        for j in range(pieces.n_sample):
            samples.whole[row, j] = 0.0


@linked_sum
def end_piece(pieces: Pieces, piece: int, n_step: int, standing: int, z: Floats, samples: Samples) -> None:
    """Store the samples of a piece and continue with the next."""
    pieces.n_step[piece] = n_step
    pieces.at[STANDING] = standing
    for row in range(2):
        for k in range(z.shape[1]):
            pieces.left[row, k] = z[row, k]
    first = piece * pieces.n_sample
    for row in range(samples.whole.shape[0]):
        for j in range(pieces.n_sample):
            pieces.whole[row, first + j] = samples.whole[row, j]
    pieces.at[PIECE], pieces.at[STAGE] = piece + 1, TO_BEGIN


@linked_sum
def set_masks(mask: Ints, table: Ints, n_room: int, piece: int) -> None:
    """Enable only the tables that are tuned to a piece."""
    for place in range(mask.size):
        mask[place] = table[place] if place % n_room == piece % n_room else NONE


@linked_sum
def begin_piece(
    tables: ModeTables,
    reduced: Reduced,
    pieces: Pieces,
    sample_level: int,
    progress: Progress,
    z: Floats,
) -> bool:
    """Begin in the set wanted, at the shaft's angle 0; False where it is not tuned.

    In the set of the previous piece fast modes continue unchanged: the speed changes linearly, so that shapes
    which follow it do not make them ring.
    """
    piece = pieces.at[PIECE]
    lasts = pieces.n_sample * pieces.tick[piece] * (1 << sample_level)
    least = max(FAST * abs(pieces.spin[piece]), QUICK / lasts)
    mode = find_mode(tables.mask, progress.wanted)
    if mode < 0:
        return False
    goes_on = pieces.follows and pieces.at[STANDING] == progress.wanted
    enter(tables, mode, reduced.clearance, 1.0, 0.0, pieces.motion[piece], z)
    if goes_on:
        for k in range(tables.n_eigenmode[mode]):
            if tables.pace[mode, k] > least or tables.pace[mode, k] == DYING:
                z[0, k], z[1, k] = pieces.left[0, k], pieces.left[1, k]
    progress.tick, progress.mode, progress.wanted, progress.n_step = 0, mode, NONE, 0
    progress.n_event, progress.counted_from, progress.next_sample = 0, 0, 0
    progress.entered, progress.energy_from, progress.contact_age = LONG_AGO, NONE, NONE
    progress.resolved_level, progress.halving_level, progress.is_after_event = 0, NONE, 0
    return True


@linked_sum
def begin_part(
    pieces: Pieces, progress: Progress, part: Accumulator, before: Accumulator, closed: int
) -> None:
    """Continue from the sums before; pairs of `closed` are touching."""
    since = pieces.since[pieces.at[PIECE]] if pieces.at[PART] == 0 else 0.0  # s, when their clock began
    progress.next_sample, progress.n_event = pieces.at[PART] * pieces.n_part_sample, 0
    pieces.at[STAGE] = IN_PART
    q, n_row, n = part.force_piece.shape
    for i in range(q):
        for row in range(n_row):
            for k in range(n):
                part.force_piece[i, row, k] = before.force_piece[i, row, k]
        for k in range(2):
            part.force_held[i, k] = before.force_held[i, k]
        part.force_piece[i, LOUD, 0] = np.inf  # relative to a peak that is reset
    part.origin[0] = before.origin[0] + since
    for i in range(part.is_touching.size):
        part.is_touching[i] = (closed >> i) & 1 == 1


@linked_sum
def end_part(
    tables: ModeTables, reduced: Reduced, pieces: Pieces, mode: int, z: Floats, part: Accumulator
) -> bool:
    """Go on to the next part, with the motion of coordinates (2, m); False where it is beyond the limits."""
    motion = pieces.motion[pieces.at[PIECE] + 1]
    leave(tables, mode, z, motion)
    if not is_within(
        motion,
        reduced.translations,
        reduced.stiffness,
        part.highest,
        part.lowest,
        reduced.displacement_limit,
        pieces.energy_limit,
    ):
        return False
    pieces.at[PART] += 1
    pieces.at[STAGE] = PART_TO_BEGIN
    return True


@inlined
def row_of(sums: Accumulator, i: int) -> Accumulator:
    """The sums of one part."""
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
        sums.turned[i],
        sums.peak_force[i],
        sums.force_piece[i],
        sums.force_held[i],
        sums.origin[i],
        sums.peak_lateral[i],
        sums.energy[i],
        sums.pivots[i],
        sums.residual[i],
    )
