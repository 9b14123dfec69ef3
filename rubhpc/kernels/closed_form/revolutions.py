"""Whole revolutions of a motion, piece by piece, and the events between the pieces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.accumulators import Accumulator  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.closed_form.flow import BEFORE, PieceRoom, PieceTables, Timing, follow_piece
from rubhpc.kernels.closed_form.mode_change import EventWork, change_contacts
from rubhpc.kernels.contact_modes import Reduced, find_mode

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Outcomes: all revolutions are followed; a contact mode is missing; the rows are full; a displacement passes
# its limit; no contact forces satisfy the laws; too many events in a revolution.
FOLLOWED, MODE_UNKNOWN, FULL, BEYOND, UNSOLVED, TOO_MANY = range(6)
PIECE, STATES, REVOLUTION, BEGUN = range(4)  # items of `reached`
AFTER = 4  # row of the motions of a piece, after those of `flow.follow_piece`


class PieceModes(Struct):
    """The p contact modes of a case, with the fields of `flow.PieceTables`."""

    mask: Ints  # (p,)
    is_known: Flags  # (p,), whether the mode's row is filled in
    n_moving: Ints  # (p,), first coordinates that move with the motion; the others do not
    switch_re: Floats  # (p, q, m)
    switch_im: Floats
    rate_re: Floats  # (p, q, m)
    rate_im: Floats
    bound: Floats  # (p, q, m)
    power_re: Floats  # (p, levels, m)
    power_im: Floats
    exponent: Floats  # (p, 2, m)
    enter_re: Floats  # (p, 2 n, m)
    enter_im: Floats
    offset: Floats  # (p, 2, 3, m)
    shape_re: Floats  # (p, 2 n, m)
    shape_im: Floats


class PieceRows(Struct):
    """Pieces of a motion, one per row."""

    states: Ints  # (k, 4), pairs closed in the piece, `crossing`, gaps among these, pairs closed afterwards
    times: Floats  # (k, 2), s, beginning after the shaft's angle 0, and duration
    motions: Floats  # (k, 5, 2 n), those of `flow.follow_piece`, then the motion after the event
    rates: Floats  # (k, q), of the switch functions at the end
    given: Floats  # (k, q), normal impulses of the event, N s


class Passage(Struct):
    """How far a motion has been followed; all changes in place."""

    reached: Ints  # (4,), pieces filled in, closed pairs, revolution, and pieces before that
    passed: Floats  # (1,), s, time reached in the revolution
    motion: Floats  # (2 n,)


def new_passage(width: int) -> Passage:
    """Arrays for motions of this width (2 n)."""
    return Passage(reached=np.zeros(4, dtype=np.int64), passed=np.zeros(1), motion=np.zeros(width))


def begin_passage(passage: Passage, motion: Floats, states: int, begin: float) -> None:
    """Begin with a motion (2 n,) and these pairs closed, a time (s) after the shaft's angle 0."""
    passage.reached[:] = 0, states, 0, 0
    passage.passed[0], passage.motion[:] = begin, motion


def piece_rows(k: int, width: int, q: int) -> PieceRows:
    """Arrays for k pieces of motions of this width (2 n) with q pairs."""
    return PieceRows(
        states=np.empty((k, 4), dtype=np.int64),
        times=np.empty((k, 2)),
        motions=np.empty((k, 5, width)),
        rates=np.empty((k, q)),
        given=np.empty((k, q)),
    )


@jit_sum
def follow_revolutions(
    modes: PieceModes,
    reduced: Reduced,
    room: PieceRoom,
    timing: Timing,
    passage: Passage,
    rows: PieceRows,
    least: Floats,
    work: EventWork,
    accumulator: Accumulator,
) -> int:
    """Follow a motion from one event to the next through several revolutions.

    Parameters
    ----------
    least : (r, 2, q)
        As in `flow.follow_piece`, for each of the r revolutions.
    work : EventWork, accumulator : Accumulator
        Work space; the accumulator is not changed.
    """
    reached, passed, motion = passage.reached, passage.passed, passage.motion
    while reached[REVOLUTION] < least.shape[0]:
        k, states = reached[PIECE], reached[STATES]
        if k - reached[BEGUN] > timing.most_events:
            return TOO_MANY
        if k == rows.times.shape[0]:
            return FULL
        place = find_mode(modes.mask, states)
        if place < 0 or not modes.is_known[place]:
            return MODE_UNKNOWN
        tables = PieceTables(
            modes.mask[place],
            modes.switch_re[place],
            modes.switch_im[place],
            modes.rate_re[place],
            modes.rate_im[place],
            modes.bound[place],
            modes.power_re[place],
            modes.power_im[place],
            modes.exponent[place],
            modes.enter_re[place],
            modes.enter_im[place],
            modes.offset[place],
            modes.shape_re[place],
            modes.shape_im[place],
            reduced.translations,
            reduced.displacement_limit,
        )
        begun = passed[0]
        duration, crossing = follow_piece(
            tables,
            room,
            timing,
            motion,
            begun,
            rows.motions[k],
            rows.rates[k],
            least[reached[REVOLUTION]],
        )
        if crossing < 0:
            return BEYOND
        after, given = rows.motions[k, AFTER], rows.given[k]
        for i in range(given.size):
            given[i] = 0.0
        for i in range(motion.size):
            after[i] = rows.motions[k, BEFORE, i]
        passed[0] = begun + duration
        states_after = states
        if crossing != 0:
            angle = timing.spin * passed[0]
            states_after = change_contacts(
                reduced,
                states,
                crossing,
                timing.spin,
                timing.moment,
                np.cos(angle),
                np.sin(angle),
                after,
                bool(np.bool_(False)),  # no literal, for which it would be compiled again
                work,
                accumulator,
            )
            for i in range(given.size):
                given[i] = work.given[i]
            if states_after < 0:
                return UNSOLVED
        rows.states[k, 0], rows.states[k, 1] = states, crossing
        rows.states[k, 2], rows.states[k, 3] = crossing & ~states, states_after
        rows.times[k, 0], rows.times[k, 1] = begun, duration
        for i in range(motion.size):
            motion[i] = after[i]
        reached[PIECE], reached[STATES] = k + 1, states_after
        if crossing == 0:
            reached[REVOLUTION] += 1
            reached[BEGUN] = k + 1
            passed[0] = timing.begin
    return FOLLOWED
