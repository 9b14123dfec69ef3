"""Derivative of a piecewise motion by its beginning: exponentials, and saltation matrices at events."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.kernels.mode_change import AT_REST

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.revolution import Piece, Revolution

    Floats = NDArray[np.float64]

NO_IMPULSE = 1e-12  # of the largest impulse of an event
STOPPED = 1e-9  # of the rim's speed: what slips less after an impact sticks


def monodromy(motion: PiecewiseMotion, revolutions: Iterable[Revolution]) -> Floats:
    """Derivative (2 n, 2 n) of a motion's end by its beginning.

    The product of `exp(A tau)` over the pieces and of the saltation matrices of the events between.
    """
    return tangents(motion, revolutions)[-1]


def tangents(motion: PiecewiseMotion, revolutions: Iterable[Revolution]) -> list[Floats]:
    """Derivatives (2 n, 2 n) by the beginning, of the motion after each piece and the event that ends it."""
    found: list[Floats] = []
    for revolution in revolutions:
        _carry(motion, revolution, found[-1] if found else None, found)
    return found


def carried(motion: PiecewiseMotion, revolution: Revolution, columns: Floats | None) -> Floats:
    """What becomes of small changes (2 n, k) of a revolution's beginning; by default of all unit ones."""
    found: list[Floats] = []
    _carry(motion, revolution, columns, found)
    return found[-1]


def _carry(
    motion: PiecewiseMotion, revolution: Revolution, columns: Floats | None, found: list[Floats]
) -> None:
    """Add to a list what becomes of small changes after each piece."""
    for piece, following in pairwise([*revolution.pieces, None]):
        assert piece is not None
        moved = motion.mode(piece.states).propagator(piece.duration)
        columns = moved if columns is None else moved @ columns
        if following is not None:
            columns = saltate(motion, piece, following, columns)
        found.append(columns)


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

    The rows R are those of the gap velocities that impulses change, each times 1 + restitution where the pair
    parts, and of the slips that they stop; F (n, r) are the directions of these impulses, friction in
    proportion included.
    """

    def __init__(self, motion: PiecewiseMotion, piece: Piece) -> None:
        """Find the impulses behind the change of the velocities."""
        self._n = motion.n
        self._gain: Floats | None = None
        if piece.touching.size and piece.given.any():
            made = _with_states if motion.has_states else _sliding
            self._direction, self._gain = made(motion, piece.given, piece.after[self._n :])

    def apply(self, columns: Floats) -> Floats:
        """Return columns (2 n, ...) of displacements and velocities after the impact."""
        if self._gain is None:
            return columns
        moved = columns.copy()
        moved[self._n :] -= self._direction @ (self._gain @ columns[self._n :])
        return moved


def _sliding(motion: PiecewiseMotion, given: Floats, velocity: Floats) -> tuple[Floats, Floats]:
    """Directions F and `(R F)^-1 R` of impulses (2, q) that leave a velocity (n,), of sliding."""
    bodies = motion.bodies
    normal = bodies.gap_jacobian
    if motion.q == 1:
        pressing = bool(given[0, 0] > 0.0)
        parted = pressing and bool(abs(normal[0] @ velocity) > AT_REST)
        key = bytes((pressing, parted))
        if key in motion.impacts:
            return motion.impacts[key]
    hit = _pressing(given[0])
    has_parted = hit & (np.abs(normal @ velocity) > AT_REST)
    key = hit.tobytes() + has_parted.tobytes()
    if key not in motion.impacts:
        direction, scale = bodies.force_direction[hit].T, 1.0 + bodies.restitution * has_parted[hit]
        gain = np.asarray(np.linalg.solve(normal[hit] @ direction, scale[:, None] * normal[hit]), np.float64)
        motion.impacts[key] = direction, gain
    return motion.impacts[key]


def _with_states(motion: PiecewiseMotion, given: Floats, velocity: Floats) -> tuple[Floats, Floats]:
    """The same under set-valued friction, whose impulses are in proportion or stop a slip."""
    bodies = motion.bodies
    normal, along = bodies.gap_jacobian, -bodies.slip
    force, traction = given
    hit = np.flatnonzero(_pressing(force))
    share = traction[hit] / force[hit]
    moved = bodies.slip[hit] @ velocity
    held = np.abs(motion.rim_speed[hit] + moved) <= STOPPED * motion.rim_speed[hit]
    direction = normal[hit] + np.where(held, 0.0, share)[:, None] * along[hit]
    direction = np.concatenate([direction, along[hit[held]]])
    stopped = np.concatenate([normal[hit], along[hit[held]]])
    scale = np.ones(len(stopped))
    has_parted = np.abs(normal[hit] @ velocity) > AT_REST
    scale[: hit.size] += np.where(has_parted, bodies.restitution, 0.0)
    return direction.T, np.linalg.solve(stopped @ direction.T, scale[:, None] * stopped)


def _pressing(force: Floats) -> NDArray[np.bool_]:
    """Pairs with an impulse that is not nothing beside the others'."""
    return np.asarray(force > NO_IMPULSE * np.abs(force).max())
