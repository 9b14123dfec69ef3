"""Periodic motions by shooting: Newton's method on the motion after a whole number of revolutions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.periodic_motions.piecewise_motion import MOST_EVENTS, PiecewiseMotion, Unfollowed
from rubhpc.integrate.periodic_motions.powers import Powers
from rubhpc.integrate.periodic_motions.saltation import tangents

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.revolution import Revolution

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

CONVERGED = 1e-10  # residual over the size of the motion
MOST_ITERATIONS = 30
FAST = 0.05  # ratio of two residuals below which the derivative of the iteration before serves once more
LEAST_STEP = 1 / 128  # share of Newton's step that is tried last
SAME = 1e-7  # of the motion's size: sections that close are no farther apart


class NotConverged(Exception):  # noqa: N818 - a state of the search; `periodic` raises an error for users
    """No periodic motion was found from a beginning: the text says why."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Orbit:
    """A periodic motion of n reduced degrees and q pairs.

    Attributes
    ----------
    motion : (2 n,)
        Reduced displacements and velocities with the shaft at its angle 0, and the states of the pairs then.
    revolutions : tuple of Revolution
        As many as its period.
    tangents : list of (2 n, 2 n)
        Derivatives of the motion after each piece of its period by that at the beginning; the last one is the
        monodromy matrix.
    residual : float
        Distance of the two over the size of the motion.
    iterations : int
        Newton steps taken.
    """

    motion: Floats
    states: int
    revolutions: tuple[Revolution, ...]
    tangents: list[Floats]
    residual: float
    iterations: int

    @property
    def period(self) -> int:
        """Revolutions."""
        return len(self.revolutions)

    @property
    def monodromy(self) -> Floats:
        """Derivative of the motion after a period by that before it, (2 n, 2 n)."""
        return self.tangents[-1]

    @cached_property
    def powers(self) -> Powers:
        """Powers of the monodromy matrix."""
        return Powers(self.monodromy)

    @cached_property
    def multipliers(self) -> Complexes:
        """Eigenvalues of the monodromy matrix, largest first, (2 n,)."""
        return floquet_multipliers(self.monodromy)


def floquet_multipliers(monodromy: Floats) -> Complexes:
    """Return the eigenvalues of a monodromy matrix (2 n, 2 n), largest modulus first, (2 n,)."""
    found = np.linalg.eigvals(monodromy).astype(np.complex128)
    return found[np.lexsort((-found.imag, -np.abs(found)))]


class _Trial:
    """A beginning, where it leads in the revolutions asked for, and how far that is from it."""

    def __init__(
        self, piecewise: PiecewiseMotion, motion: Floats, states: int, period: int, most_events: int
    ) -> None:
        self.motion, self.states = motion, states
        self.revolutions = piecewise.follow(motion, states, period, most_events)
        self.end, self.end_states = self.revolutions[-1].end, self.revolutions[-1].states
        self.defect = self.end - motion
        scale = max(piecewise.size(self.end), np.finfo(float).tiny)
        self.residual = piecewise.size(self.defect) / scale


def shoot(
    piecewise: PiecewiseMotion,
    motion: Floats,
    states: int,
    period: int,
    *,
    most_iterations: int = MOST_ITERATIONS,
    least_step: float = LEAST_STEP,
    most_events: int = MOST_EVENTS,
    most_residual: float = math.inf,
) -> Orbit:
    """Find the periodic motion near a beginning.

    Newton's method on `P(x) - x = 0`, with the exact derivative of P, the motion after `period` revolutions.
    A step is shortened until the residual falls.

    Parameters
    ----------
    motion : (2 n,)
        Reduced displacements and velocities at the shaft's angle 0; `states` are those of the pairs.
    most_iterations : int
        Newton steps after which the search is given up.
    least_step : float
        Share of Newton's step that is tried last.
    most_events : int
        In a revolution; a motion with more is not followed.
    most_residual : float
        Of the beginning: from one that is farther from closing nothing is sought.

    Returns
    -------
    Orbit
        Its period is the shortest after which the motion closes, a divisor of the one asked for.

    Raises
    ------
    NotConverged
        No motion was found that closes to 1e-10 of its size.
    """
    identity = np.eye(2 * piecewise.n)
    try:
        trial = _Trial(piecewise, motion, states, period, most_events)
    except Unfollowed as problem:
        raise NotConverged(str(problem)) from None
    if not trial.residual <= most_residual:
        raise NotConverged(f"the initial state is far from periodic, residual {trial.residual:.2g}")
    derivative: list[Floats] | None = None
    is_fresh = False
    for iteration in range(most_iterations + 1):
        if trial.end_states == trial.states and trial.residual <= CONVERGED:
            return _settled(piecewise, trial, derivative if is_fresh else None, iteration)
        if iteration == most_iterations:
            break
        if derivative is None:
            derivative, is_fresh = tangents(piecewise, trial.revolutions), True
        step = _solved(identity - derivative[-1], trial.defect)
        better = _shortened(piecewise, trial, step, least_step, most_events)
        if better is None:
            if not is_fresh:
                derivative = None
                continue
            usual = abs(piecewise.setup.spin * piecewise.bodies.clearance)
            raise NotConverged(
                f"Newton's method stalls at a residual of {trial.residual:.2g}{_grazing(trial, usual)}"
            )
        if better.residual > FAST * trial.residual:
            derivative = None
        is_fresh, trial = False, better
    raise NotConverged(f"no convergence within {most_iterations} iterations, residual {trial.residual:.2g}")


def _solved(matrix: Floats, defect: Floats) -> Floats:
    """Newton's step; the shortest where the matrix is singular, at a fold."""
    try:
        return np.asarray(np.linalg.solve(matrix, defect))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, defect, rcond=1e-12)[0])


def _shortened(
    piecewise: PiecewiseMotion, trial: _Trial, step: Floats, least_step: float, most_events: int
) -> _Trial | None:
    """Return the trial a share of a step further that is nearer to closing; None where none is.

    It begins with the states of the trial before, or with those in which that ended.
    """
    share, period = 1.0, len(trial.revolutions)
    while share >= least_step:
        for states in dict.fromkeys((trial.end_states, trial.states)):
            try:
                found = _Trial(piecewise, trial.motion + share * step, states, period, most_events)
            except Unfollowed:
                continue
            if found.residual < (1.0 - 0.25 * share) * trial.residual:
                return found
        share *= 0.5
    return None


NEAR_GRAZING = 1e-2  # of spin times clearance: a touch that is slower grazes


def _grazing(trial: _Trial, usual: Floats) -> str:
    """What a failure has to do with grazing; "" where nothing.

    `usual` (q,), m/s, are spin times clearance of each pair. A gap that opens where it is found closed, since
    the trial begins beyond a wall, grazes nothing.
    """
    slow = [
        float(speed)
        for revolution in trial.revolutions
        for piece in revolution.pieces
        for pair, speed in zip(piece.touching, piece.approach, strict=True)
        if 0.0 <= speed < NEAR_GRAZING * usual[pair]
    ]
    return f": a contact grazes, its speed of approach is {min(slow):.2g} m/s" if slow else ""


def _settled(
    piecewise: PiecewiseMotion, trial: _Trial, derivative: list[Floats] | None, iterations: int
) -> Orbit:
    """Return the orbit of a converged trial, over its shortest period."""
    period = len(trial.revolutions)
    beginnings = [trial.motion, *(revolution.end for revolution in trial.revolutions)]
    size = SAME * piecewise.size(trial.motion)
    primitive = next(
        n
        for n in range(1, period + 1)
        if period % n == 0 and piecewise.size(beginnings[n] - trial.motion) <= size
    )
    revolutions = tuple(trial.revolutions[:primitive])
    if derivative is None or primitive != period:
        derivative = tangents(piecewise, revolutions)
    return Orbit(
        motion=trial.motion,
        states=trial.states,
        revolutions=revolutions,
        tangents=derivative,
        residual=trial.residual,
        iterations=iterations,
    )
