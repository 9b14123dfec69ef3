"""Derivative of a piecewise motion by its beginning: exponentials, and saltation matrices at events."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from rubhpc.kernels.closed_form.small_changes import ALL_CARRIED, carry_pieces

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.piece_mode import Mode
    from rubhpc.integrate.periodic_motions.revolution import Revolution
    from rubhpc.kernels.closed_form.revolutions import PieceModes, PieceRows
    from rubhpc.kernels.closed_form.small_changes import ChangeRoom
    from rubhpc.kernels.contact_modes import Reduced

    Floats = NDArray[np.float64]


class Followed(Protocol):
    """A case in closed form, as `piecewise_motion.PiecewiseMotion`."""

    n: int
    bodies: Reduced
    known: PieceModes

    def mode(self, states: int) -> Mode:
        """Contact mode with these states."""

    def change_room(self, k: int) -> ChangeRoom:
        """Room in which k small changes are carried."""


def monodromy(motion: Followed, revolutions: Sequence[Revolution]) -> Floats:
    """Derivative (2 n, 2 n) of a motion's end by its beginning.

    The product of `exp(A tau)` over the pieces and of the saltation matrices of the events between.
    """
    columns = np.eye(2 * motion.n)
    for revolution in revolutions:
        _carry(motion, revolution.rows, columns, _no_pieces(columns))
    return columns


def tangents(motion: Followed, revolutions: Sequence[Revolution]) -> list[Floats]:
    """Derivatives (2 n, 2 n) by the beginning, of the motion after each piece and the event that ends it."""
    columns, found = np.eye(2 * motion.n), []
    for revolution in revolutions:
        kept = np.empty((len(revolution.rows.times), *columns.shape))
        _carry(motion, revolution.rows, columns, kept)
        found += list(kept)
    return found


def carried(motion: Followed, rows: PieceRows, columns: Floats) -> Floats:
    """What becomes of small changes (2 n, k) of the beginning of some pieces."""
    moved = np.array(columns, order="C")
    _carry(motion, rows, moved, _no_pieces(moved))
    return moved


def _carry(motion: Followed, rows: PieceRows, columns: Floats, kept: Floats) -> None:
    """Carry small changes through pieces, in place (`kernels.closed_form.small_changes.carry_pieces`)."""
    piece = 0
    while True:
        motion.mode(int(rows.states[piece, 0]))
        room = motion.change_room(columns.shape[1])
        piece = carry_pieces(
            motion.known,
            motion.bodies,
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
