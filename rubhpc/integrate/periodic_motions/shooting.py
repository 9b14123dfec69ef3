"""Periodic motions by shooting: Newton's method on the motion after a whole number of revolutions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.periodic_motions.collocated_motion import CollocatedMotion
from rubhpc.integrate.periodic_motions.piecewise_motion import (
    FEW_PIECES,
    MOST_EVENTS,
    PiecewiseMotion,
    Unfollowed,
)
from rubhpc.integrate.periodic_motions.revolution import copied, longer, whole_revolutions
from rubhpc.integrate.periodic_motions.shooting_by_revolutions import Search
from rubhpc.kernels.revolutions import (
    FULL,
    MODE_UNKNOWN,
    STATES,
    begin_passage,
    new_passage,
    piece_rows,
)
from rubhpc.kernels.shooting import (
    BEGINS,
    BEST,
    CARRIED,
    FAR,
    FOLLOWING,
    FOUND,
    ITERATION,
    LOST,
    N_PIECE,
    N_SHORTEST,
    NEXT,
    RESIDUAL,
    SINGULAR,
    STALLED,
    STEPPING,
    TOO_LONG,
    TRIED,
    new_search,
    search_period,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.collocated_motion import CollocatedRevolution
    from rubhpc.integrate.periodic_motions.revolution import Revolution
    from rubhpc.kernels.flow import Timing
    from rubhpc.kernels.shooting import Search as KernelSearch

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

MOST_ITERATIONS = 30
LEAST_STEP = 1 / 128  # share of Newton's step that is tried last
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
    piecewise: PiecewiseMotion | CollocatedMotion,
    motion: Floats,
    states: int,
    period: int,
    *,
    most_iterations: int = MOST_ITERATIONS,
    least_step: float = LEAST_STEP,
    most_events: int = MOST_EVENTS,
    most_residual: float = math.inf,
    watches_turns: bool = True,
) -> Orbit:
    """Find the periodic motion near a beginning, by Newton's method (`kernels.shooting.search_period`).

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
    watches_turns : bool
        Whether steps are short enough for `least_gap` and `least_force` of the revolutions.

    Returns
    -------
    Orbit
        Its period is the shortest after which the motion closes, a divisor of the one asked for.

    Raises
    ------
    NotConverged
        No motion was found that closes to 1e-10 of its size.
    """
    if isinstance(piecewise, CollocatedMotion):
        given = motion, states, period
        return _shoot_by_revolutions(
            piecewise, *given, most_iterations, least_step, most_events, most_residual
        )
    longest = piecewise.longest if watches_turns else piecewise.highest
    search = new_search(motion.size, most_iterations, least_step, most_residual)
    shot = _Shot(piecewise, motion, states, period, piecewise.timing(longest, most_events), search)
    try:
        outcome = shot.run()
    except Unfollowed as problem:
        raise NotConverged(str(problem)) from None
    residual, now = float(shot.search.share[RESIDUAL]), shot.search.now
    if outcome == FOUND:
        return shot.orbit()
    if outcome == FAR:
        raise NotConverged(f"the initial state is far from periodic, residual {residual:.2g}")
    if outcome == STALLED:
        usual = abs(piecewise.setup.spin * piecewise.bodies.clearance)
        grazing = _grazing(shot.revolutions(int(now[N_PIECE])), usual)
        raise NotConverged(f"Newton's method stalls at a residual of {residual:.2g}{grazing}")
    if outcome == TOO_LONG:
        raise NotConverged(f"no convergence within {most_iterations} iterations, residual {residual:.2g}")
    raise NotConverged(piecewise.why_unfollowed(outcome, most_events))


def _shoot_by_revolutions(
    followed: CollocatedMotion,
    motion: Floats,
    states: int,
    period: int,
    most_iterations: int,
    least_step: float,
    most_events: int,
    most_residual: float,
) -> Orbit:
    """Search as `shoot` does, for a motion without closed form."""
    try:
        search = Search(followed, motion, states, period, most_events)
        if search.residual > most_residual:
            raise NotConverged(f"the initial state is far from periodic, residual {search.residual:.2g}")
        problem = search.run(most_iterations, least_step)
    except Unfollowed as unfollowed:
        raise NotConverged(str(unfollowed)) from None
    if problem:
        usual = abs(followed.setup.spin * followed.bodies.clearance)
        grazing = _grazing(search.revolutions, usual)
        raise NotConverged(f"{problem} at a residual of {search.residual:.2g}{grazing}")
    revolutions = search.revolutions[: search.shortest()]
    return Orbit(
        motion=search.motion,
        states=search.states,
        revolutions=tuple(revolutions),
        monodromy=search.monodromy(len(revolutions)),
        residual=search.residual,
        iterations=search.iterations,
    )


class _Shot:
    """A search under way: what its kernel works with."""

    def __init__(
        self,
        piecewise: PiecewiseMotion,
        motion: Floats,
        states: int,
        period: int,
        timing: Timing,
        search: KernelSearch,
    ) -> None:
        self._piecewise, self._timing, self.search = piecewise, timing, search
        self._passage = new_passage(motion.size)
        begin_passage(self._passage, motion, states, timing.begin)
        self._least = np.full((period, 2, piecewise.q), np.inf)
        k = FEW_PIECES * period
        self._rows = [piece_rows(k, motion.size, piecewise.q) for _ in range(2)]
        search.tried[:] = motion
        search.now[TRIED] = states

    def run(self) -> int:
        """Search to an outcome, and do on the way what the kernel leaves to its caller.

        Raises
        ------
        Unfollowed
            The beginning cannot be followed.
        """
        now = self.search.now
        while True:
            outcome = self._call()
            under_way = 1 - int(now[BEST])
            try:
                if outcome == MODE_UNKNOWN:
                    self._piecewise.mode(self._wanted())
                elif outcome == FULL:
                    self._rows[under_way] = longer(self._rows[under_way])
                elif outcome == SINGULAR:  # at a fold
                    matrix = np.eye(len(self.search.step)) - self.search.columns
                    self.search.step[:] = np.linalg.lstsq(matrix, self.search.defect, rcond=1e-12)[0]
                    now[NEXT] = STEPPING
                else:
                    return outcome
            except Unfollowed:
                if now[N_PIECE] == 0 or now[NEXT] != FOLLOWING:
                    raise
                now[NEXT] = LOST

    def orbit(self) -> Orbit:
        """The motion that was found, over its shortest period."""
        now = self.search.now
        return Orbit(
            motion=self.search.motion,
            states=int(now[BEGINS]),
            revolutions=tuple(self.revolutions(int(now[N_SHORTEST]))),
            monodromy=self.search.columns,
            residual=float(self.search.share[RESIDUAL]),
            iterations=int(now[ITERATION]),
        )

    def revolutions(self, n_piece: int) -> list[Revolution]:
        """Those of the best trial, up to a piece."""
        return whole_revolutions(copied(self._rows[int(self.search.now[BEST])], n_piece), self._least)

    def _wanted(self) -> int:
        """States of the pairs whose contact mode the kernel asks for."""
        now = self.search.now
        if now[NEXT] == FOLLOWING:
            return int(self._passage.reached[STATES])
        return int(self._rows[int(now[BEST])].states[now[CARRIED], 0])

    def _call(self) -> int:
        piecewise = self._piecewise
        return search_period(
            piecewise.known,
            piecewise.bodies,
            piecewise.room,
            self._timing,
            self.search,
            piecewise.change_room(self.search.step.size),
            self._passage,
            self._rows[0],
            self._rows[1],
            self._least,
            *piecewise.march.change_work,
        )


def _grazing(revolutions: Sequence[Revolution | CollocatedRevolution], usual: Floats) -> str:
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
