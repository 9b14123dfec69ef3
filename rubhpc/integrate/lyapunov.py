"""Growth of the distance of two neighbouring motions of a case, for its largest Lyapunov exponent."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from rubhpc.integrate.measuring.regimes import N_ALL
from rubhpc.integrate.transient import pass_revolutions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]


SPAN = 4  # revolutions: few enough that neighbours stay close
N_ALIGNING = 4  # spans in which the displacement turns into the direction of largest growth
DISPLACED = 1e-5  # of the motion: far above the resolution of events, far below details of the motion
LOST = 1e-6  # of the displacement: less is rounding


class Neighbours(Protocol):
    """A motion and a second one close to it.

    Attributes
    ----------
    n_aligning, most_spans : int
        Spans in which their displacement turns into the direction of largest growth, and most spans to
        follow, including these.
    """

    n_aligning: int
    most_spans: int

    def part(self, n_revolution: int) -> float | None:
        """Continue both; return the growth of the logarithm of their distance, or None at an end.

        The second motion is then moved back to the initial distance, in the same direction.
        """


class Growth:
    """Logarithm of how much a small displacement grows per revolution, in spans of 4.

    Iteration yields spans from the end of a record on. After each the displacement is rescaled to its first
    size (Benettin, Galgani, Giorgilli and Strelcyn 1980). The mean tends to the largest Lyapunov exponent per
    revolution. Iteration ends where a motion cannot continue, or after the most spans.

    Parameters
    ----------
    begin : callable
        Makes the motion and its displacement when the first span is read.
    """

    def __init__(self, begin: Callable[[], Neighbours]) -> None:
        """Begin when the first span is read."""
        self._begin = begin

    @cached_property
    def _neighbours(self) -> Neighbours:
        return self._begin()

    def __iter__(self) -> Iterator[float]:
        """Yield span by span."""
        neighbours = self._neighbours
        for i in range(neighbours.most_spans):
            grown = neighbours.part(SPAN)
            if grown is None:
                return
            if i >= neighbours.n_aligning:
                yield grown / SPAN


class Marches:
    """Neighbours by any integrator: two marches from nearby states.

    Their distance is the root of v'M v + spin^2 u'M u over all bodies.

    Parameters
    ----------
    start : callable
        Makes the case's march from a state.
    """

    def __init__(
        self, start: Callable[[State], March], state: State, setup: Setup, recording: Recording
    ) -> None:
        """Start at `state` and next to it."""
        self.n_aligning = N_ALIGNING
        self.most_spans = N_ALIGNING + N_ALL  # of small steps; more may take minutes
        self._start, self._recording = start, recording
        self._model, self._spin = setup.model, setup.spin
        self._state = state
        self._kept: list[March] = []  # of the last span
        self._other, self._size = self._displaced()

    def part(self, n_revolution: int) -> float | None:
        """Restart both marches, one after the other, and compare their ends."""
        ends = []
        for k, state in enumerate((self._state, self._other)):  # the first may empty the tables of the second
            march = self._started(k, state)
            if pass_revolutions(march, self._recording, n_revolution) is not None:
                return None
            ends.append(march.final())
        self._state, self._other = ends
        ratio = self._distance(self._state, self._other) / self._size
        if ratio > LOST:
            self._other = _between(self._state, self._other, 1.0 / ratio)
        else:
            self._other, self._size = self._displaced()
        return math.log(max(ratio, LOST))

    def _started(self, k: int, state: State) -> March:
        """March of the first or second motion, restarted at a new state, or a new one."""
        if k == len(self._kept):
            self._kept.append(self._start(state))
        elif not self._kept[k].start_again(state):
            self._kept[k] = self._start(state)
        return self._kept[k]

    def _displaced(self) -> tuple[State, float]:
        """State with slightly larger velocities, so that closed gaps stay closed, and its distance."""
        state = self._state
        still = replace(
            state,
            rotor_velocity=np.zeros_like(state.rotor_velocity),
            stator_velocity=tuple(map(np.zeros_like, state.stator_velocity)),
        )
        other = _between(state, still, -DISPLACED)
        return other, self._distance(state, other)

    def _distance(self, one: State, other: State) -> float:
        model = self._model
        displacements = model.split(other.displacement - one.displacement)
        velocities = model.split(other.velocity - one.velocity)
        return math.sqrt(
            sum(
                v @ body.mass @ v + self._spin**2 * (u @ body.mass @ u)
                for body, u, v in zip(model.bodies, displacements, velocities, strict=True)
            )
        )


def _between(one: State, other: State, share: float) -> State:
    """State at a share of the way between two states; beyond them below 0 or above 1."""

    def at(a: Floats, b: Floats) -> Floats:
        return a + share * (b - a)

    return replace(
        one,
        rotor_displacement=at(one.rotor_displacement, other.rotor_displacement),
        rotor_velocity=at(one.rotor_velocity, other.rotor_velocity),
        stator_displacement=tuple(map(at, one.stator_displacement, other.stator_displacement)),
        stator_velocity=tuple(map(at, one.stator_velocity, other.stator_velocity)),
        contact_force=np.maximum(at(one.contact_force, other.contact_force), 0.0),
    )
