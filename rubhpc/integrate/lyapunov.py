"""How fast two neighbouring motions of a case part: the growth behind its largest Lyapunov exponent."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.settle import pass_revolutions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.march import March
    from rubhpc.integrate.record import State
    from rubhpc.study import Recording

    Floats = NDArray[np.float64]

DISPLACED = 1e-5  # of the motion: far above the resolution of events, far below the motion's features
LOST = 1e-6  # of the displacement: what is left is rounding
SPAN = 4  # revolutions between two beginnings: those cost as much as two revolutions
N_ALIGNING = 4  # spans in which the displacement turns into the direction that grows most


def growth(
    start: Callable[[State], March], state: State, model: Model, spin: float, recording: Recording
) -> Iterator[float]:
    """Yield the logarithm of how much a small displacement grows per revolution, over spans of 4.

    Two marches go on from `state`, one of them displaced; after each span both start anew, with the
    displacement brought back to its first size (Benettin, Galgani, Giorgilli and Strelcyn 1980). The mean of
    what is yielded tends to the largest Lyapunov exponent per revolution; it ends where a march cannot go on.
    Size is the root of v'M v + spin^2 u'M u over all bodies.

    Parameters
    ----------
    start : callable
        Makes the case's march from a state.
    spin : float, rad/s
    """
    other, size = _displaced(state, model, spin)
    for i in count():
        marches = start(state), start(other)
        for march in marches:
            if pass_revolutions(march, recording, SPAN) is not None:
                return
        state, other = (march.final() for march in marches)
        ratio = _distance(state, other, model, spin) / size
        if i >= N_ALIGNING:
            yield math.log(max(ratio, LOST)) / SPAN
        if ratio > LOST:
            other = _between(state, other, 1.0 / ratio)
        else:
            other, size = _displaced(state, model, spin)


def _displaced(state: State, model: Model, spin: float) -> tuple[State, float]:
    """State a little faster than another, so that closed gaps stay closed, and its distance."""
    still = replace(
        state,
        rotor_velocity=np.zeros_like(state.rotor_velocity),
        stator_velocity=tuple(map(np.zeros_like, state.stator_velocity)),
    )
    other = _between(state, still, -DISPLACED)
    return other, _distance(state, other, model, spin)


def _between(one: State, other: State, share: float) -> State:
    """State at a share of the way from one to the other; below 0 or above 1, beyond them."""

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


def _distance(one: State, other: State, model: Model, spin: float) -> float:
    """Root of v'M v + spin^2 u'M u of the difference."""
    bodies = (model.rotor, *(stator.body for stator in model.stators))
    displacements, velocities = (
        [b - a for a, b in zip(mine, theirs, strict=True)]
        for mine, theirs in (
            (
                (one.rotor_displacement, *one.stator_displacement),
                (other.rotor_displacement, *other.stator_displacement),
            ),
            ((one.rotor_velocity, *one.stator_velocity), (other.rotor_velocity, *other.stator_velocity)),
        )
    )
    return math.sqrt(
        sum(
            v @ body.mass @ v + spin**2 * (u @ body.mass @ u)
            for body, u, v in zip(bodies, displacements, velocities, strict=True)
        )
    )
