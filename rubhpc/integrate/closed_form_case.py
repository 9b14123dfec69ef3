"""Further results of a case in closed form: tangent, Lyapunov exponents, periodic motions nearby."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, cast

from rubhpc.integrate.lyapunov import Growth, Marches
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.measuring.orbit_measures import period
from rubhpc.integrate.measuring.regimes import LASTING, LEAST_REVOLUTIONS, by_growth, regime
from rubhpc.integrate.measuring.settling import is_steady
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.periodic_motions.lyapunov_spectrum import spectrum_of
from rubhpc.integrate.periodic_motions.proof import Solver
from rubhpc.integrate.tangent_motion import TangentMotion
from rubhpc.kernels.trail import BROKEN
from rubhpc.schema import REGIME, lyapunov_variables

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.integrate.lyapunov import Neighbours
    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.measuring.measures import Judge
    from rubhpc.integrate.measuring.regimes import Verdict
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import Setup
    from rubhpc.kernels.trail import Trail
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]

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


def judge_of(
    march: March,
    start: Callable[[State], March],
    setup: Setup,
    clearance: float,
    friction: float,
    recording: Recording,
    final: State,
    trail: Trail | None,
) -> Judge:
    """What judges a simulated record: its orbit, neighbouring motions and periodic ones."""
    solver = solver_of(march, setup, clearance, friction, final)
    growth = Growth(lambda: neighbours_of(march, trail, start, final, setup, recording))

    def lasts(exponent: float) -> bool:
        """Whether chaos was followed to the end of what is followed, does not drift and is chaos there."""
        if solver is None or solver.followed is None:
            return False
        energy, end = solver.followed
        if not is_steady(energy):
            return False
        if trail is not None:
            trail.n_event[0] = BROKEN  # its room alone is used again
        try:
            flag, later = by_growth(Growth(lambda: neighbours_of(march, trail, start, end, setup, recording)))
        except NoClosedForm:
            return False
        return flag == REGIME.index("chaotic") and exponent + later >= 2.0 * LASTING

    def judge(vertical: Floats, horizontal: Floats, per_revolution: int, is_contact: bool) -> Verdict:
        return regime(
            vertical,
            horizontal,
            per_revolution,
            period=period(vertical, horizontal, per_revolution),
            is_contact=is_contact,
            growth=growth,
            within=growth.within,
            solve=solver,
            later=solver.later if solver is not None else None,
            lasts=lasts if solver is not None else None,
            n_event=trail.n_event[0] / recording.revolutions if trail is not None else 0.0,
        )

    return judge


def solver_of(
    march: March,
    setup: Setup,
    clearance: float,
    friction: float,
    final: State,
) -> Solver | None:
    """Solver for periodic motions near the end of a march; None where it has no closed form."""
    if isinstance(march, EventDrivenMarch) and march.has_closed_form and isinstance(setup, ModalSetup):
        return Solver(setup, clearance, friction, final, march)
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
