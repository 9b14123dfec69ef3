"""Newton's method for points of branches, each in a plane across its branch."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.integrate.branches.point import Point, away_from_events
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.shooting import NotConverged, shoot

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.family import Family

    Floats = NDArray[np.float64]

MOST_ITERATIONS = 7
SOON = 1e-4  # residual below which a slow iteration may continue
FAST = 0.02  # ratio of two residuals below which a derivative is used again
LESS = 0.7  # ratio of a residual to the least before it that counts as progress
MORE, PATIENCE = (2.0, 10.0), (2, 3)  # allowed ratio to the one before, and iterations without progress
STEEP = 0.4  # share of the parameter in a step below which it is an unknown


class Branching:
    """Finds points of one family of cases.

    Parameters
    ----------
    step : float
        Change of the parameter that counts as one step.
    check : callable, optional
        Called before every search for a motion; what it raises ends the search for branches.
    say : callable, optional
        Called then with the number of motions found, and the parameter near which the next is sought.
    """

    def __init__(
        self,
        family: Family,
        step: float,
        check: Callable[[], None] | None = None,
        say: Callable[[int, float], None] | None = None,
    ) -> None:
        """Take the cases."""
        self.family, self.step, self._check, self._say = family, step, check, say
        self._n_found = 0

    def begin(self, value: float, motion: Floats, states: int, period: int) -> Point:
        """Solve at a value of the parameter from a motion at the angle 0; the section is then moved.

        Raises
        ------
        NotConverged
            No motion was found.
        """
        case = self.family.at(value)
        orbit = shoot(case, motion, states, period)
        point = Point(
            value=value,
            phase=0.0,
            motion=orbit.motion,
            states=orbit.states,
            revolutions=list(orbit.revolutions),
            family=self.family,
        )
        return self.moved(point, away_from_events(point))

    def moved(self, point: Point, ahead: float) -> Point:
        """The same motion from a section some revolutions ahead, a number from 0 to its period."""
        if ahead == 0.0:
            return point
        motion, states, phase = point.after(ahead)
        return Point(
            value=point.value,
            phase=phase,
            motion=motion,
            states=states,
            revolutions=point.case.follow(motion, states, point.period, phase=phase),
            family=point.family,
        )

    def located(self, point: Point) -> float:
        """How near to its event, in the parameter, a point is to be."""
        return point.case.tolerances.located * self.family.span

    def repeated(self, point: Point, times: int) -> Point:
        """The same motion over several of its periods."""
        if times == 1:
            return point
        n = times * point.period
        revolutions = point.case.follow(point.motion, point.states, n, phase=point.phase)
        return replace(point, revolutions=revolutions)

    def direction(self, point: Point, change: Floats) -> Floats:
        """A change (2 n,) of the motion alone, in steps, of length 1 (2 n + 1,)."""
        scaled = np.append(point.scale * change, 0.0)
        return np.asarray(scaled / np.linalg.norm(scaled))

    def difference(self, a: Point, b: Point) -> Floats:
        """From one point to another in steps: (2 n + 1,), the parameter last."""
        motion = self.family.carry(a.motion, a.case, b.case)
        return np.append(b.scale * (b.motion - motion), (b.value - a.value) / self.step)

    def is_same(self, a: Point, b: Point) -> bool:
        """Whether two motions of a case are the same up to a shift by revolutions."""
        if a.motion.size != b.motion.size or a.period != b.period:
            return False
        limit = a.case.tolerances.same * a.case.size(a.motion)
        for k in range(b.period):
            moved = self.moved(b, (a.phase - b.phase) % 1.0 + k)
            if a.case.size(moved.motion - a.motion) <= limit:
                return True
        return False

    def rate(self, point: Point, share: float | None = None) -> tuple[Floats, list[Any]]:
        """Derivative (2 n,) by the parameter, per step, of what a period leaves, at a fixed beginning.

        Returned with the revolutions from this beginning a share of a step ahead, by which it is found.
        """
        step = None if share is None else share * self.step
        given = point.value, point.motion, point.states, point.revolutions, point.phase
        rate, followed = self.family.derivative(*given, step)
        return rate * self.step, followed

    def tangent(self, point: Point, toward: Floats) -> Floats:
        """Direction of the branch at a point, in steps, of length 1 (2 n + 1,), in the sense of `toward`."""
        rate, _ = self.rate(point)
        moving = (point.monodromy - np.eye(point.motion.size)) / point.scale
        matrix = np.column_stack([moving, rate])
        along: Floats = np.linalg.svd(matrix / np.abs(matrix).max(axis=1, keepdims=True))[2][-1]
        return along if along @ toward >= 0.0 else -along

    def correct(
        self,
        base: Point,
        guess: Floats,
        along: Floats,
        *,
        period: int = 0,
        most: int = MOST_ITERATIONS,
        is_free: bool = False,
        in_plane: float = 0.0,
    ) -> Point:
        """Find the motion in the plane through a guess across a direction.

        Parameters
        ----------
        base : Point
            Its scale and section are those of guess and direction.
        guess, along : (2 n + 1,)
            From the base, in steps; the direction has length 1. Where it is mainly along the parameter, the
            parameter is held, which costs less, except near a fold.
        period : int
            Revolutions; by default that of the base.
        most : int
            Iterations; up to twice as many where the end is near.
        is_free : bool
            The parameter is never held: around a fold several motions have the same parameter.
        in_plane : float
            Allowed distance from the plane, in steps, or that of `Tolerances` if it is more: the last
            iterations hold the parameter where it moves by less, since every new value needs its own contact
            modes.

        Raises
        ------
        NotConverged
            Newton's method does not converge.
        """
        period = period or base.period
        is_asked = not np.any(along[:-1])
        if is_asked or (abs(along[-1]) > STEEP and not is_free and not base.is_near_fold):
            try:
                found = self._corrected(base, guess, along, period, most, is_held=True, in_plane=0.0)
                if is_asked or not found.is_near_fold:
                    return found
            except NotConverged:
                if is_asked or not base.may_fold:
                    raise
        return self._corrected(base, guess, along, period, most, is_held=False, in_plane=in_plane)

    def _corrected(
        self,
        base: Point,
        guess: Floats,
        along: Floats,
        period: int,
        most: int,
        *,
        is_held: bool,
        in_plane: float,
    ) -> Point:
        """Newton's method, with the parameter held or an unknown."""
        family, phase, states = self.family, base.phase, base.states
        if self._say is not None:
            self._say(self._n_found, base.value)
        if self._check is not None:
            self._check()
        scale = base.scale
        value = base.value + guess[-1] * self.step
        before = base.motion + guess[:-1] / scale
        origin, rate, derivative, last = base.case, None, None, math.inf
        least, n_worse, tolerances = math.inf, 0, origin.tolerances
        in_plane = max(in_plane, tolerances.in_plane)
        try:
            case = family.at(value)
            motion = family.carry(before, origin, case)
            for iteration in range(2 * most):
                revolutions: list[Any] = case.follow(motion, states, period, phase=phase)
                defect = revolutions[-1].end - motion
                residual = case.size(defect) / max(case.size(motion), np.finfo(float).tiny)
                n_worse = 0 if residual < LESS * least else n_worse + 1
                closed = tolerances.enough if n_worse else tolerances.closed
                if residual <= closed and revolutions[-1].states == states:
                    self._n_found += 1
                    return Point(
                        value=value, phase=phase, motion=motion, states=states, revolutions=revolutions,
                        family=family,
                    )  # fmt: skip
                states = revolutions[-1].states
                is_late = iteration >= most and residual > SOON
                least = min(least, residual)
                is_stuck = n_worse > PATIENCE[is_held] and residual > tolerances.rounding
                is_lost = residual > MORE[is_held] * last or is_stuck
                if is_lost or is_late or not math.isfinite(residual):
                    break
                if derivative is None or residual > FAST * last:
                    derivative = case.monodromy(revolutions) - np.eye(motion.size)
                last = residual
                if is_held:
                    motion = motion - np.linalg.solve(derivative, defect)
                    continue
                if scale.size != motion.size:
                    break
                here = np.linalg.solve(derivative, -defect)
                if np.linalg.norm(scale * here) <= in_plane:  # other cases have other rounding errors
                    motion = motion + here
                    continue
                if rate is None or rate.size != motion.size:
                    rate = family.derivative(value, motion, states, revolutions, phase)[0] * self.step
                ahead = np.append(
                    scale * (motion - family.carry(base.motion, base.case, case)),
                    (value - base.value) / self.step,
                )
                row = np.append(along[:-1] * scale, along[-1])
                matrix = np.block([[derivative, rate[:, None]], [row[None, :]]])
                change = np.linalg.solve(matrix, np.append(-defect, along @ (guess - ahead)))
                if n_worse and residual <= tolerances.rounding:  # at a fold the rest is rounding
                    motion = motion + change[:-1]
                    continue
                value += float(change[-1]) * self.step
                moved = motion + change[:-1]
                case, origin = family.at(value), case
                motion = family.carry(moved, origin, case)
        except (Unfollowed, InputError, np.linalg.LinAlgError) as problem:
            raise NotConverged(str(problem)) from None
        raise NotConverged(f"no convergence, residual {last:.2g}")
