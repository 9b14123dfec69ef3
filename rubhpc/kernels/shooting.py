"""Newton's method on the motion after whole revolutions: trials, tangents and steps in one call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.accumulators import Accumulator  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.contact_modes import Reduced  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.elimination import eliminate
from rubhpc.kernels.flow import PieceRoom, Timing  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.mode_change import EventWork, product
from rubhpc.kernels.revolutions import (
    AFTER,
    BEGUN,
    FOLLOWED,
    FULL,
    MODE_UNKNOWN,
    PIECE,
    REVOLUTION,
    STATES,
    UNSOLVED,
    Passage,
    PieceModes,
    PieceRows,
    follow_revolutions,
)
from rubhpc.kernels.small_changes import ALL_CARRIED, ChangeRoom, carry_pieces
from rubhpc.kernels.tangent import size_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CONVERGED = 1e-10  # residual over the size of the motion
FAST = 0.05  # ratio of two residuals below which the derivative of the iteration before serves once more
TINY = float(np.finfo(float).tiny)
SAME = 1e-7  # of the motion's size: sections that close are no farther apart

# Outcomes besides those of `revolutions.follow_revolutions`: it is found, the beginning is far from closing,
# no share of a step is better, all iterations are taken, and the matrix of a step is singular.
FOUND, FAR, STALLED, TOO_LONG, SINGULAR = range(16, 21)
# What comes next: a trial is followed, or cannot be; its derivative is carried for a step, or for the end; a
# step is solved for, or has been.
FOLLOWING, LOST, CARRYING, ENDING, SOLVING, STEPPING = range(6)
# Items of `Search.now`: what comes next; which rows hold the best trial; its pieces (0: none yet), states at
# its beginning and end; iterations; states of the trial under way; whether a derivative is there, and whether
# it is that of the best trial; the next piece to carry; and the pieces of the shortest period.
NEXT, BEST, N_PIECE, BEGINS, ENDS, ITERATION, TRIED, HAS_DERIVATIVE, IS_FRESH, CARRIED, N_SHORTEST = range(11)
RESIDUAL, SHARE = range(2)  # items of `Search.share`


class Search(Struct):
    """A search under way; n reduced degrees."""

    most_iterations: int
    least_step: float  # share of a step that is tried last
    most_residual: float  # of the beginning; from a larger one nothing is sought
    now: Ints  # (11,)
    share: Floats  # (2,), residual of the best trial, and share of the step that is tried
    motion: Floats  # (2 n,), beginning of the best trial
    defect: Floats  # (2 n,), its end less its beginning
    step: Floats  # (2 n,)
    tried: Floats  # (2 n,), beginning of the trial under way
    columns: Floats  # (2 n, 2 n), derivative of the end by the beginning
    kept: Floats  # (0, 2 n, 2 n)
    rows: Floats  # (2 n, 4 n), inverse of the identity less the derivative, behind a matrix


def new_search(width: int, most_iterations: int, least_step: float, most_residual: float) -> Search:
    """Room for a search among motions of this width (2 n), within limits."""
    return Search(
        most_iterations=most_iterations,
        least_step=least_step,
        most_residual=most_residual,
        now=np.zeros(11, dtype=np.int64),
        share=np.zeros(2),
        motion=np.empty(width),
        defect=np.empty(width),
        step=np.empty(width),
        tried=np.empty(width),
        columns=np.empty((width, width)),
        kept=np.empty((0, width, width)),
        rows=np.empty((width, 2 * width)),
    )


@jit_sum
def search_period(
    modes: PieceModes,
    reduced: Reduced,
    room: PieceRoom,
    timing: Timing,
    search: Search,
    changes: ChangeRoom,
    passage: Passage,
    first_rows: PieceRows,
    second_rows: PieceRows,
    least: Floats,
    work: EventWork,
    accumulator: Accumulator,
) -> int:
    """Search for a motion that closes after as many revolutions as `least` has rows.

    Newton's method on `P(x) - x = 0`. A step is shortened until the residual falls; each share of it begins
    with the states of the pairs with which the best trial ended, then with those with which it began. As long
    as a step divides the residual by 20, the derivative serves once more.

    Parameters
    ----------
    search : Search
        In place.
    passage, least
        Of the trial under way, as `follow_revolutions` has them.
    first_rows, second_rows : PieceRows
        Of the best trial and of the one under way, by turns.

    Returns
    -------
    int
        An outcome. After `FOUND`, `search.columns` is the derivative over the shortest period after which the
        motion closes.
    """
    now, spin = search.now, timing.spin
    reached, motion = passage.reached, passage.motion
    while True:
        if now[NEXT] == FOLLOWING or now[NEXT] == LOST:
            outcome = UNSOLVED
            if now[NEXT] == FOLLOWING:
                outcome = follow_revolutions(
                    modes,
                    reduced,
                    room,
                    timing,
                    passage,
                    second_rows if now[BEST] == 0 else first_rows,
                    least,
                    work,
                    accumulator,
                )
                if outcome in (MODE_UNKNOWN, FULL):
                    return outcome
            is_first = now[N_PIECE] == 0
            if is_first and outcome != FOLLOWED:
                return outcome
            if outcome == FOLLOWED and take_trial(spin, search, int(reached[PIECE]), reached[STATES], motion):
                if is_first and not search.share[RESIDUAL] <= search.most_residual:
                    return FAR
                if now[ENDS] == now[BEGINS] and search.share[RESIDUAL] <= CONVERGED:
                    now[N_SHORTEST] = shortest_period(
                        first_rows if now[BEST] == 0 else second_rows,
                        int(now[N_PIECE]),
                        least.shape[0],
                        spin,
                        search,
                    )
                    begin_carrying(ENDING, search)
                elif now[ITERATION] >= search.most_iterations:
                    return TOO_LONG
                elif now[HAS_DERIVATIVE] != 0:
                    now[NEXT] = SOLVING
                else:
                    begin_carrying(CARRYING, search)
            elif now[TRIED] == now[ENDS] and now[ENDS] != now[BEGINS]:
                begin_trial(int(now[BEGINS]), search, passage, least)
            else:
                search.share[SHARE] *= 0.5
                if search.share[SHARE] >= search.least_step:
                    begin_trial(int(now[ENDS]), search, passage, least)
                elif now[IS_FRESH] != 0:
                    return STALLED
                else:
                    now[ITERATION] += 1
                    if now[ITERATION] >= search.most_iterations:
                        return TOO_LONG
                    begin_carrying(CARRYING, search)
        if now[NEXT] == CARRYING or now[NEXT] == ENDING:
            is_end = now[NEXT] == ENDING
            piece = carry_pieces(
                modes,
                reduced,
                first_rows if now[BEST] == 0 else second_rows,
                int(now[CARRIED]),
                int(now[N_SHORTEST] if is_end else now[N_PIECE]),
                changes,
                search.columns,
                search.kept,
            )
            if piece != ALL_CARRIED:
                now[CARRIED] = piece
                return MODE_UNKNOWN
            if is_end:
                return FOUND
            now[HAS_DERIVATIVE], now[IS_FRESH], now[NEXT] = 1, 1, SOLVING
            if not invert(search):
                return SINGULAR
        if now[NEXT] == SOLVING:
            for i in range(motion.size):
                search.step[i] = product(search.rows[i, motion.size :], search.defect)
            now[NEXT] = STEPPING
        if now[NEXT] == STEPPING:
            search.share[SHARE] = 1.0
            begin_trial(int(now[ENDS]), search, passage, least)


@linked_sum
def take_trial(spin: float, search: Search, n_piece: int, states: int, motion: Floats) -> bool:
    """Make the trial that has come to `motion` the best one, if its residual is less by enough."""
    now, tried = search.now, search.tried
    residual = distance(motion, tried, spin) / max(size_of(motion, spin), TINY)
    is_first, before = now[N_PIECE] == 0, search.share[RESIDUAL]
    if not is_first:
        if not residual < (1.0 - 0.25 * search.share[SHARE]) * before:
            return False
        if residual > FAST * before:
            now[HAS_DERIVATIVE] = 0
        now[IS_FRESH] = 0
        now[ITERATION] += 1
    for i in range(motion.size):
        search.motion[i], search.defect[i] = tried[i], motion[i] - tried[i]
    search.share[RESIDUAL] = residual
    now[BEST], now[N_PIECE] = 1 - now[BEST], n_piece
    now[BEGINS], now[ENDS] = now[TRIED], states
    return True


@linked_sum
def distance(first: Floats, second: Floats, spin: float) -> float:
    """Root of v'v + spin^2 u'u of the difference of two motions (2 n,)."""
    n = first.size // 2
    square = 0.0
    for i in range(n):
        u, v = spin * (first[i] - second[i]), first[n + i] - second[n + i]
        square += v * v + u * u
    return float(np.sqrt(square))


@linked_sum
def begin_carrying(next_one: int, search: Search) -> None:
    """Carry the derivative from the first piece on: that of no piece is the identity."""
    now, columns = search.now, search.columns
    now[NEXT], now[CARRIED] = next_one, 0
    for i in range(columns.shape[0]):
        for j in range(columns.shape[0]):
            columns[i, j] = 0.0
        columns[i, i] = 1.0


@linked_sum
def invert(search: Search) -> bool:
    """Invert the identity less the derivative; False where it is singular."""
    rows, columns = search.rows, search.columns
    n = columns.shape[0]
    for i in range(n):
        for j in range(n):
            rows[i, j], rows[i, n + j] = -columns[i, j], 0.0
        rows[i, i] += 1.0
        rows[i, n + i] = 1.0
    return eliminate(rows, n)


@linked_sum
def begin_trial(states: int, search: Search, passage: Passage, least: Floats) -> None:
    """Begin a share of a step from the best trial, with the pairs in these states."""
    reached, motion = passage.reached, passage.motion
    search.now[NEXT], search.now[TRIED] = FOLLOWING, states
    for i in range(motion.size):
        search.tried[i] = search.motion[i] + search.share[SHARE] * search.step[i]
        motion[i] = search.tried[i]
    reached[PIECE], reached[STATES], reached[REVOLUTION], reached[BEGUN] = 0, states, 0, 0
    passage.passed[0] = 0.0
    least[:] = np.inf


@linked_sum
def shortest_period(rows: PieceRows, n_piece: int, period: int, spin: float, search: Search) -> int:
    """Pieces of the best trial until it closes for the first time, after a divisor of the period."""
    same, n_revolution = SAME * size_of(search.motion, spin), 0
    for k in range(n_piece):
        if rows.states[k, 1] == 0:
            n_revolution += 1
            apart = distance(rows.motions[k, AFTER], search.motion, spin)
            if period % n_revolution == 0 and apart <= same:
                return k + 1
    return n_piece
