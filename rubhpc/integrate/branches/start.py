"""Motions from which branches are followed: those reached by sweeps up and down and random disturbances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.integrate.initial_state import fit_to_gaps
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion, Unfollowed
from rubhpc.integrate.periodic_motions.shooting import NotConverged
from rubhpc.integrate.start import start_of
from rubhpc.integrate.transient import pass_revolutions
from rubhpc.study.initial import Initial

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point
    from rubhpc.integrate.record import State
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]

SEED = 1  # of the disturbances: the same in every run


def starts(
    branching: Branching, values: Sequence[float], periods: Sequence[int], recording: Recording
) -> Iterator[Point]:
    """Yield motions at some values of the parameter, for each requested period.

    The case is simulated with rising parameter, each time from the final state of the one before, then with
    falling parameter, then from rest with a random lateral velocity of up to that of a whirl in the gap.
    """
    rising = sorted(values)
    for order in (rising, rising[::-1]):
        state: State | Initial = Initial()
        for value in order:
            ended = simulated(branching, value, state, recording)
            if ended is None:
                state = Initial()
                continue
            state, piecewise = ended
            yield from _of_each_period(branching, value, piecewise, periods)
    random = np.random.default_rng(SEED)
    for value in rising:
        setup, clearance, _ = branching.family.settings(value)
        speed, angle = random.random() * abs(setup.spin) * clearance, 2 * np.pi * random.random()
        disturbed = Initial(
            vertical_velocity=float(speed * np.cos(angle)), horizontal_velocity=float(speed * np.sin(angle))
        )
        ended = simulated(branching, value, disturbed, recording)
        if ended:
            yield from _of_each_period(branching, value, ended[1], periods)


def _of_each_period(
    branching: Branching, value: float, piecewise: PiecewiseMotion, periods: Sequence[int]
) -> Iterator[Point]:
    """Motions with exactly these periods that Newton's method finds from a start."""
    for period in periods:
        point = shot(branching, value, piecewise, (period,))
        if point is not None and point.period == period:
            yield point


def simulated(
    branching: Branching, value: float, initial: State | Initial, recording: Recording
) -> tuple[State, PiecewiseMotion] | None:
    """State of a case after the transient; None where it has no closed form."""
    setup, clearance, friction = branching.family.settings(value)
    try:
        state = (
            start_of(initial, setup, clearance)
            if isinstance(initial, Initial)
            else fit_to_gaps(initial, setup, clearance)
        )
        march = PiecewiseMotion(setup, clearance, friction, state).march
        if pass_revolutions(march, recording, recording.longest_transient) is not None:
            return None
        state = fit_to_gaps(march.final(), setup, clearance)
        return state, PiecewiseMotion(setup, clearance, friction, state)
    except (NoClosedForm, InputError):
        return None


def shot(
    branching: Branching, value: float, piecewise: PiecewiseMotion, periods: Sequence[int]
) -> Point | None:
    """The first motion found from a start, among some periods."""
    for period in periods:
        try:
            return branching.begin(value, piecewise.start, piecewise.states, period)
        except (NotConverged, Unfollowed):
            continue
    return None
