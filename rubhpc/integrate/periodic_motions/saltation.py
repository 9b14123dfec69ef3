"""Derivative of a piecewise motion by its beginning: exponentials, and saltation matrices at events."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.kernels.mode_change import AT_REST

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.piecewise_motion import Mode, Piece, PiecewiseMotion, Revolution

    Floats = NDArray[np.float64]

NO_IMPULSE = 1e-12  # of the largest impulse of an event
STOPPED = 1e-9  # of the rim's speed: what slips less after an impact sticks


def monodromy(motion: PiecewiseMotion, revolutions: Iterable[Revolution]) -> Floats:
    """Derivative (2 n, 2 n) of a motion's end by its beginning.

    The product of `exp(A tau)` over the pieces and of the saltation matrices of the events between.
    """
    tangent: Floats | None = None
    for revolution in revolutions:
        tangent = carried(motion, revolution, tangent)
    assert tangent is not None
    return tangent


def carried(motion: PiecewiseMotion, revolution: Revolution, columns: Floats | None) -> Floats:
    """What becomes of small changes (2 n, k) of a revolution's beginning; by default of all unit ones."""
    for piece, following in pairwise([*revolution.pieces, None]):
        assert piece is not None
        moved = propagator(motion.mode(piece.states), piece.duration)
        columns = moved if columns is None else moved @ columns
        if following is not None:
            columns = saltate(motion, piece, following, columns)
    assert columns is not None
    return columns


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
            begun_re = moved @ mode.enter_re + clearance_re
            begun_im = moved @ mode.enter_im + clearance_im
            size, turn = np.exp(mode.exponent[0] * piece.duration), mode.exponent[1] * piece.duration
            re, im = size * np.cos(turn), size * np.sin(turn)
            z_re, z_im = re * begun_re - im * begun_im, re * begun_im + im * begun_re
            moved = mode.shape_re @ z_re - mode.shape_im @ z_im
            if following is None or (not motion.has_states and not piece.touching.size):
                continue
            impact = Impact(motion, piece)
            switched = motion.switch(mode, piece.crossing, z_re, z_im)
            jump = motion.rate_begun(following) - impact.apply(motion.rate_ended(piece))
            moved = impact.apply(moved) + jump * (switched / motion.switch_rate(piece))
    return moved


def propagator(mode: Mode, duration: float) -> Floats:
    """Derivative (2 n, 2 n) of the motion by that a time (s) before; it keeps closed gaps closed."""
    size, turn = np.exp(mode.exponent[0] * duration), mode.exponent[1] * duration
    re, im = size * np.cos(turn), size * np.sin(turn)
    moved_re, moved_im = mode.shape_re * re - mode.shape_im * im, mode.shape_re * im + mode.shape_im * re
    return np.asarray(moved_re @ mode.enter_re.T - moved_im @ mode.enter_im.T)


def saltate(motion: PiecewiseMotion, piece: Piece, following: Piece, tangent: Floats) -> Floats:
    """Apply the saltation matrix of the event between two pieces to columns (2 n, k).

    `S = DR + (f+ - DR f-) (grad h)^T / (dh/dt)`, with h the switch function that vanishes, dh/dt its rate
    before the event, f the rate of the motion and DR the derivative of the impact (Leine and Nijmeijer 2004).
    """
    if not motion.has_states and not piece.touching.size:
        return tangent  # a release: the forces are continuous
    gradient = motion.gradient(motion.mode(piece.states), piece.crossing) @ tangent
    impact = Impact(motion, piece)
    jump = motion.rate_begun(following) - impact.apply(motion.rate_ended(piece))
    return impact.apply(tangent) + np.multiply.outer(jump, gradient / motion.switch_rate(piece))


class Impact:
    """Derivative of the velocities after an event by those before: `dv+ = dv- - F (R F)^-1 R dv-`.

    The rows R are those of the gap velocities that impulses change, each times 1 + restitution where the pair
    parts, and of the slips that they stop; F (n, r) are the directions of these impulses, friction in
    proportion included.
    """

    def __init__(self, motion: PiecewiseMotion, piece: Piece) -> None:
        """Find the impulses behind the change of the velocities."""
        self._n, bodies = motion.n, motion.bodies
        change = (piece.after - piece.before)[self._n :]
        self._direction: Floats | None = None
        if not piece.touching.size or not change.any():
            return
        normal, along = bodies.gap_jacobian, -bodies.slip
        if motion.has_states:
            both = np.linalg.lstsq(np.concatenate([normal, along]).T, change, rcond=1e-12)[0]
            force, traction = np.split(both, 2)
        elif len(normal) == 1:
            force = normal @ change / bodies.delassus[0]
        else:
            force = np.linalg.lstsq(bodies.delassus, normal @ change, rcond=1e-12)[0]
        hit = np.flatnonzero(force > NO_IMPULSE * np.abs(force).max())
        rows = normal[hit]
        if motion.has_states:
            share = traction[hit] / force[hit]
            moved = bodies.slip[hit] @ piece.after[self._n :]
            held = np.abs(motion.rim_speed[hit] + moved) <= STOPPED * motion.rim_speed[hit]
            direction = normal[hit] + np.where(held, 0.0, share)[:, None] * along[hit]
            direction = np.concatenate([direction, along[hit[held]]])
            stopped = np.concatenate([rows, along[hit[held]]])
        else:
            direction, stopped = bodies.force_direction[hit], rows
        scale = np.ones(len(stopped))
        has_parted = np.abs(normal[hit] @ piece.after[self._n :]) > AT_REST
        scale[: hit.size] += np.where(has_parted, bodies.restitution, 0.0)
        self._direction = direction.T
        self._gain = np.linalg.solve(stopped @ direction.T, scale[:, None] * stopped)

    def apply(self, columns: Floats) -> Floats:
        """Return columns (2 n, ...) of displacements and velocities after the impact."""
        if self._direction is None:
            return columns
        moved = columns.copy()
        moved[self._n :] -= self._direction @ (self._gain @ columns[self._n :])
        return moved
