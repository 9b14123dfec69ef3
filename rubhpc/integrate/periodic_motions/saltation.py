"""Derivative of a piecewise motion by its beginning: exponentials, and saltation matrices at events."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.kernels.small_changes import ALL_CARRIED, carry_pieces, impulses_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.revolution import Piece, Revolution
    from rubhpc.kernels.revolutions import PieceRows

    Floats = NDArray[np.float64]


def monodromy(motion: PiecewiseMotion, revolutions: Sequence[Revolution]) -> Floats:
    """Derivative (2 n, 2 n) of a motion's end by its beginning.

    The product of `exp(A tau)` over the pieces and of the saltation matrices of the events between.
    """
    columns = np.eye(2 * motion.n)
    for revolution in revolutions:
        _carry(motion, revolution.rows, columns, _no_pieces(columns))
    return columns


def tangents(motion: PiecewiseMotion, revolutions: Sequence[Revolution]) -> list[Floats]:
    """Derivatives (2 n, 2 n) by the beginning, of the motion after each piece and the event that ends it."""
    columns, found = np.eye(2 * motion.n), []
    for revolution in revolutions:
        kept = np.empty((len(revolution.rows.times), *columns.shape))
        _carry(motion, revolution.rows, columns, kept)
        found += list(kept)
    return found


def carried(motion: PiecewiseMotion, revolution: Revolution, columns: Floats) -> Floats:
    """What becomes of small changes (2 n, k) of a revolution's beginning."""
    moved = np.array(columns, order="C")
    _carry(motion, revolution.rows, moved, _no_pieces(moved))
    return moved


def _carry(motion: PiecewiseMotion, rows: PieceRows, columns: Floats, kept: Floats) -> None:
    """Carry small changes through pieces, in place (`kernels.small_changes.carry_pieces`)."""
    piece = 0
    while True:
        motion.mode(int(rows.states[piece, 0]))
        room = motion.change_room(columns.shape[1])
        piece = carry_pieces(
            motion.known,
            motion.bodies,
            motion.has_states,
            rows,
            piece,
            len(rows.times),
            room,
            columns,
            kept[piece:],
        )
        if piece == ALL_CARRIED:
            return


def _no_pieces(columns: Floats) -> Floats:
    return np.empty((0, *columns.shape))


def by_clearance(motion: PiecewiseMotion, revolutions: Iterable[Revolution]) -> Floats:
    """Derivative (2 n,) of a motion's end by the clearance of all pairs, its beginning held.

    A clearance is a coordinate of the contact modes: it enters each piece, and moves each event.
    """
    moved = np.zeros(2 * motion.n)
    for revolution in revolutions:
        for piece, following in pairwise([*revolution.pieces, None]):
            assert piece is not None
            mode = motion.mode(piece.states)
            clearance_re, clearance_im = motion.unit_clearance(mode)
            tables = mode.tables
            begun_re = moved @ tables.enter_re + clearance_re
            begun_im = moved @ tables.enter_im + clearance_im
            size, turn = np.exp(tables.exponent[0] * piece.duration), tables.exponent[1] * piece.duration
            re, im = size * np.cos(turn), size * np.sin(turn)
            z_re, z_im = re * begun_re - im * begun_im, re * begun_im + im * begun_re
            moved = tables.shape_re @ z_re - tables.shape_im @ z_im
            if following is None or (not motion.has_states and not piece.touching.size):
                continue
            impact = Impact(motion, piece)
            switched = motion.switch(mode, piece.crossing, z_re, z_im)
            jump = following.rate_begun - impact.apply(piece.rate_ended)
            moved = impact.apply(moved) + jump * (switched / piece.switch_rate)
    return moved


def saltate(motion: PiecewiseMotion, piece: Piece, following: Piece, tangent: Floats) -> Floats:
    """Apply the saltation matrix of the event between two pieces to columns (2 n, k).

    `S = DR + (f+ - DR f-) (grad h)^T / (dh/dt)`, with h the switch function that vanishes, dh/dt its rate
    before the event, f the rate of the motion and DR the derivative of the impact (Leine and Nijmeijer 2004).
    """
    if not motion.has_states and not piece.touching.size:
        return tangent  # a release: the forces are continuous
    impact = Impact(motion, piece)
    jump = following.rate_begun - impact.apply(piece.rate_ended)
    return impact.apply(tangent) + np.multiply.outer(jump, (piece.gradient / piece.switch_rate) @ tangent)


class Impact:
    """Derivative of the velocities after an event by those before: `dv+ = dv- - F (R F)^-1 R dv-`.

    With R and F as `kernels.small_changes.impulses_of` has them.
    """

    def __init__(self, motion: PiecewiseMotion, piece: Piece) -> None:
        """Find the impulses behind the change of the velocities."""
        self._n, room, n_impulse = motion.n, motion.change_room(1), 0
        if piece.touching.size:
            n_impulse = impulses_of(
                motion.bodies, motion.has_states, piece.given, piece.after[motion.n :], room
            )
        self._direction = room.direction[:n_impulse].T.copy()
        self._gain = room.rows[:n_impulse, 2 * motion.q :].copy()

    def apply(self, columns: Floats) -> Floats:
        """Return columns (2 n, ...) of displacements and velocities after the impact."""
        moved = columns.copy()
        moved[self._n :] -= self._direction @ (self._gain @ columns[self._n :])
        return moved
