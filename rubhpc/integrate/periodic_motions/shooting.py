"""Periodic motions by shooting: Newton's method on the motion after a whole number of revolutions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.periodic_motions.piecewise_motion import MOST_EVENTS, Unfollowed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.collocated_motion import FollowedMotion

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]
    Revolutions = Sequence[Any]  # of one kind

MOST_ITERATIONS = 30
LEAST_STEP = 1 / 128  # share of Newton's step that is tried last
LESS = 0.25  # of a share of a step: by as much, of itself, it must make the residual less
FAST = 0.05  # ratio of two residuals up to which a derivative serves once more
NEAR_GRAZING = 1e-2  # of spin times clearance: a touch that is slower grazes


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
    monodromy : (2 n, 2 n)
        Derivative of the motion after a period by that before it.
    residual : float
        Distance of the two over the size of the motion.
    iterations : int
        Newton steps taken.
    """

    motion: Floats
    states: int
    revolutions: tuple[Any, ...]
    monodromy: Floats
    residual: float
    iterations: int

    @property
    def period(self) -> int:
        """Revolutions."""
        return len(self.revolutions)

    @cached_property
    def multipliers(self) -> Complexes:
        """Eigenvalues of the monodromy matrix, largest first, (2 n,)."""
        return floquet_multipliers(self.monodromy)


def floquet_multipliers(monodromy: Floats) -> Complexes:
    """Return the eigenvalues of a monodromy matrix (2 n, 2 n), largest modulus first, (2 n,)."""
    found = np.linalg.eigvals(monodromy).astype(np.complex128)
    return found[np.lexsort((-found.imag, -np.abs(found)))]


def shoot(
    followed: FollowedMotion,
    motion: Floats,
    states: int,
    period: int,
    *,
    most_iterations: int = MOST_ITERATIONS,
    least_step: float = LEAST_STEP,
    most_events: int = MOST_EVENTS,
    most_residual: float = math.inf,
) -> Orbit:
    """Find the periodic motion near a beginning, by Newton's method.

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
        No motion was found that closes as nearly as `Tolerances` says.
    """
    try:
        search = _Search(followed, motion, states, period, most_events)
        if search.residual > most_residual:
            raise NotConverged(f"the initial state is far from periodic, residual {search.residual:.2g}")
        problem = search.run(most_iterations, least_step)
        if not problem:
            return search.orbit()
    except Unfollowed as unfollowed:
        raise NotConverged(str(unfollowed)) from None
    usual = abs(followed.setup.spin * followed.bodies.clearance)
    grazing = _grazing(search.revolutions, usual)
    raise NotConverged(f"{problem} at a residual of {search.residual:.2g}{grazing}")


class _Search:
    """A search under way: the best beginning so far, the revolutions from there, and their residual.

    The derivative is that of an earlier motion as long as steps by it make the residual much smaller.
    """

    def __init__(
        self,
        followed: FollowedMotion,
        motion: Floats,
        states: int,
        period: int,
        most_events: int,
    ) -> None:
        """Follow the beginning; `Unfollowed` where it cannot be."""
        self._case, self._period, self._most_events = followed, period, most_events
        self._tolerances = followed.tolerances
        self._motion, self._states, self._iterations = motion, states, 0
        self.revolutions: Revolutions = followed.follow(motion, states, period, most_events)
        self.residual = self._residual(motion, self.revolutions)
        self._matrix: Floats | None = None  # derivative of the residual
        self._differs = np.inf  # how far from the present motion that derivative was found, over its size

    def run(self, most_iterations: int, least_step: float) -> str:
        """Take Newton steps, or shares of them; returns why the motion does not close, or ""."""
        tolerances = self._tolerances
        while self.residual > tolerances.closed or not self._repeats:
            is_enough = self.residual <= tolerances.enough and self._repeats
            if self._iterations == most_iterations:
                return "" if is_enough else f"no convergence within {most_iterations} iterations"
            self._iterations += 1
            matrix = self._find_derivative() if self._matrix is None else self._matrix
            before, defect = self.residual, self.revolutions[-1].end - self._motion
            step = np.linalg.lstsq(matrix, defect, rcond=1e-12)[0].astype(float)
            is_better = self._improve(step, least_step)
            if not is_better and self._differs == 0.0:
                return "" if is_enough else "Newton's method stalls"
            self._differs += self._case.size(step) / self._case.size(self._motion)
            if not is_better or self.residual > FAST * before:
                if is_enough:
                    break
                self._matrix = None
        return ""

    def orbit(self) -> Orbit:
        """The motion that was found, over its shortest period."""
        revolutions = self.revolutions[: self._shortest()]
        is_near = self._matrix is not None and self._differs <= self._tolerances.derivative
        if is_near and len(revolutions) == self._period:
            assert self._matrix is not None
            monodromy = np.eye(self._motion.size) - self._matrix
        else:
            monodromy = self._case.monodromy(revolutions)
        return Orbit(
            motion=self._motion,
            states=self._states,
            revolutions=tuple(revolutions),
            monodromy=monodromy,
            residual=self.residual,
            iterations=self._iterations,
        )

    @property
    def _repeats(self) -> bool:
        """Whether the pairs end in the states in which they begin, as far as steps decide that alike."""
        return not self._case.is_exact or self.revolutions[-1].states == self._states

    def _shortest(self) -> int:
        """Revolutions after which the motion closes: a divisor of the period."""
        most = self._tolerances.divides * self._case.size(self._motion)
        for d in range(1, self._period):
            if self._period % d == 0 and self._case.size(self.revolutions[d - 1].end - self._motion) <= most:
                return d
        return self._period

    def _find_derivative(self) -> Floats:
        self._matrix = np.eye(self._motion.size) - self._case.monodromy(self.revolutions)
        self._differs = 0.0
        return self._matrix

    def _improve(self, step: Floats, least_step: float) -> bool:
        """Take the largest share of a step that makes the residual less by enough.

        Each begins with the states with which the best trial ended, then with those with which it began.
        """
        share = 1.0
        while share >= least_step:
            motion = self._motion + share * step
            for states in dict.fromkeys((self.revolutions[-1].states, self._states)):
                try:
                    revolutions = self._case.follow(motion, states, self._period, self._most_events)
                except Unfollowed:
                    continue
                residual = self._residual(motion, revolutions)
                if residual < (1.0 - LESS * share) * self.residual:
                    self._motion, self._states = motion, states
                    self.revolutions, self.residual = revolutions, residual
                    return True
            share *= 0.5
        return False

    def _residual(self, motion: Floats, revolutions: Revolutions) -> float:
        size = max(self._case.size(motion), np.finfo(float).tiny)
        return self._case.size(revolutions[-1].end - motion) / size


def _grazing(revolutions: Revolutions, usual: Floats) -> str:
    """What a failure has to do with grazing; "" where nothing.

    `usual` (q,), m/s, are spin times clearance of each pair. A gap that opens where it is found closed, since
    the trial begins beyond a wall, grazes nothing.
    """
    slow = [
        float(speed)
        for revolution in revolutions
        for piece in revolution.pieces
        for pair, speed in zip(piece.touching, piece.approach, strict=True)
        if 0.0 <= speed < NEAR_GRAZING * usual[pair]
    ]
    return f": a contact grazes, its speed of approach is {min(slow):.2g} m/s" if slow else ""
