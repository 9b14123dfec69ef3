"""Further results of a case in closed form: tangent, Lyapunov exponents, periodic motions nearby."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, cast

from rubhpc.integrate.lyapunov import Marches
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.measuring.regimes import LEAST_REVOLUTIONS
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.periodic_motions.lyapunov_spectrum import spectrum_of
from rubhpc.integrate.periodic_motions.proof import Solver
from rubhpc.integrate.tangent_motion import TangentMotion
from rubhpc.schema import lyapunov_variables

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.integrate.lyapunov import Neighbours
    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.shooting import Orbit
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import Setup
    from rubhpc.kernels.trail import Trail
    from rubhpc.study.study import Recording

_spare: list[Trail] = []  # arrays of the last case, unless another one uses them


def exponents_of(
    march: March, begin: Callable[[State], PiecewiseMotion], final: State, n_exponent: int
) -> dict[str, float]:
    """Lyapunov exponents from where a march has ended; NaN where it has no closed form."""
    if isinstance(march, EventDrivenMarch) and march.has_closed_form:
        found = spectrum_of(partial(begin, final), n_exponent)
        largest = found["lyapunov_1"]
        return found if math.isnan(largest) else found | {"lyapunov_exponent": largest}
    return dict.fromkeys(lyapunov_variables(n_exponent), math.nan)


def solver_of(
    march: March,
    setup: Setup,
    clearance: float,
    friction: float,
    final: State,
    begun_on: tuple[PiecewiseMotion, Orbit] | None,
) -> Solver | None:
    """Solver for periodic motions near the end of a march; None where it has no closed form."""
    if isinstance(march, EventDrivenMarch) and march.has_closed_form and isinstance(setup, ModalSetup):
        return Solver(setup, clearance, friction, final, begun_on, march)
    return None


def trail_of(march: March, recording: Recording) -> Trail | None:
    """Record the events of a record where its tangent may be propagated along them."""
    if (
        isinstance(march, EventDrivenMarch)
        and march.has_closed_form
        and recording.revolutions >= LEAST_REVOLUTIONS
    ):
        trail = _kept(march) or march.new_trail()
        march.keep(trail)
        return trail
    return None


def give_back(march: March, trail: Trail | None) -> None:
    """Keep the arrays of a trail for the next case, when nothing reads or writes them any more.

    The system clears new memory page by page, which takes longer than following the tangent.
    """
    if trail is not None:
        cast("EventDrivenMarch", march).keep(None)
        _spare[:] = [trail]


def _kept(march: EventDrivenMarch) -> Trail | None:
    """Kept arrays, if they fit a march."""
    try:
        trail = _spare.pop()
    except IndexError:
        return None
    width = trail.begun.shape[2], trail.given.shape[2]
    return trail if width == march.width else None


def neighbours_of(
    march: March,
    trail: Trail | None,
    start: Callable[[State], March],
    final: State,
    setup: Setup,
    recording: Recording,
) -> Neighbours:
    """A motion next to the one from the end of a march."""
    if isinstance(march, EventDrivenMarch) and march.has_closed_form:
        return TangentMotion(
            cast("Callable[[State], EventDrivenMarch]", start), final, setup, recording, trail, march
        )
    return Marches(start, final, setup, recording)
