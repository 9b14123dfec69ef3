"""Consecutive pieces of a run-up, each at a speed to which the tables have been tuned."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels.case_progress import (
    DIVERGED,
    FINISHED,
    MODE_WANTED,
    Clock,
    Coordinates,
    Progress,
    Sections,
)
from rubhpc.kernels.contact_modes import ModeTables, Reduced, dot
from rubhpc.kernels.event_loop import advance
from rubhpc.kernels.pieces import (
    PART,
    PART_TO_BEGIN,
    PIECE,
    STAGE,
    TO_BEGIN,
    TO_ENTER,
    Pieces,
    begin_part,
    begin_piece,
    clock_of,
    end_part,
    end_piece,
    row_of,
    set_masks,
    start_piece,
)
from rubhpc.kernels.sampling import Measured

if TYPE_CHECKING:
    from rubhpc.kernels.mode_change import EventWork

Floats = NDArray[np.float64]


@jit_sum
def advance_pieces(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    pieces: Pieces,
    progress: Progress,
    coordinates: Coordinates,
    work: EventWork,
    measured: Measured,
    sections: Sections,
) -> int:
    """Advance a case through pieces, from `pieces.at` on, and record every sample.

    Parameters
    ----------
    tables : ModeTables
        Their masks are set to those of the current piece.
    reduced : Reduced
        Its unbalance and rim speeds are set.
    clock : Clock
        Of any piece; `n_sample` is that of all.
    measured : Measured
        Samples of one piece, and sums (1 + k c, ...): of the time before, then of every part of the pieces,
        zero on entry.
    sections : Sections
        None.

    Returns
    -------
    int
        FINISHED, or the outcome of `event_loop.advance` in the current piece. MODE_WANTED requests the set
        `progress.wanted`, tuned to that piece and those after it.
    """
    recorder, samples, sums = measured.recorder, measured.samples, measured.accumulator
    z = coordinates.z
    at, n_part = pieces.at, pieces.n_sample // pieces.n_part_sample
    while at[PIECE] < pieces.spin.size:
        piece = at[PIECE]
        set_masks(tables.mask, pieces.table, pieces.n_room, piece)
        now = clock_of(clock, pieces, piece)
        if at[STAGE] == TO_BEGIN:
            start_piece(reduced, pieces, piece, recorder, samples)
            progress.wanted = first_set(pieces.pressing[piece])
            at[STAGE] = TO_ENTER
        if at[STAGE] == TO_ENTER:
            if not begin_piece(tables, reduced, pieces, clock.sample_level, progress, z):
                return MODE_WANTED
            at[PART], at[STAGE] = 0, PART_TO_BEGIN
        while at[PART] < n_part:
            place = 1 + piece * n_part + at[PART]
            part = row_of(sums, place)
            if at[STAGE] == PART_TO_BEGIN:
                begin_part(pieces, progress, part, row_of(sums, place - 1), tables.mask[progress.mode])
            last_tick = ((at[PART] + 1) * pieces.n_part_sample) << clock.sample_level
            outcome = advance(
                tables,
                reduced,
                now,
                last_tick,
                True,
                progress,
                coordinates,
                work,
                Measured(recorder, samples, part),
                sections,
            )
            if outcome != FINISHED:
                return outcome
            if not end_part(tables, reduced, pieces, progress.mode, z, part):
                return DIVERGED
        read_forces(tables, progress.mode, z, pieces.pressing[piece + 1])
        end_piece(pieces, piece, progress.n_step, tables.mask[progress.mode], z, samples)
    return FINISHED


@linked_sum
def first_set(pressing: Floats) -> int:
    """Set of closed pairs with which a piece begins, under contact forces (q,), N."""
    found = int(np.int64(0))  # no literal: callers are compiled for one type
    for i in range(pressing.size):
        if pressing[i] > 0.0:
            found |= 1 << i
    return found


@linked_sum
def read_forces(tables: ModeTables, mode: int, z: Floats, force: Floats) -> None:
    """Fill in the contact forces (q,), N, of coordinates (2, m)."""
    for i in range(force.size):
        force[i] = 0.0
        if (tables.mask[mode] >> i) & 1:
            force[i] = dot(tables.switch_re[mode, i], tables.switch_im[mode, i], z[0], z[1])
