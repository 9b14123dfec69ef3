"""The periodic motion next to the end of a record: whether there is one, and whether it is stable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.event_driven import NoClosedForm
from rubhpc.integrate.measuring.regimes import Solution
from rubhpc.integrate.packing import output_degrees
from rubhpc.integrate.periodic_motions.known_motions import nothing
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.shooting import NotConverged, Orbit, shoot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import ModalSetup

    Floats = NDArray[np.float64]

MOST_ITERATIONS, LEAST_STEP = 6, 1.0  # a record that looks periodic is near the solution
MOST_EVENTS = 160  # in a period; the time that a proof takes goes with them


class Solver:
    """Solves for periodic motions from where a case has ended."""

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        final: State,
        known: tuple[PiecewiseMotion, Orbit] | None = None,
    ) -> None:
        """Take the end of a case in closed form, and the stable motion that it was begun on, if any."""
        self._case = setup, clearance, friction, final
        self._piecewise: PiecewiseMotion | None = None
        self._known = known

    @property
    def has_begun(self) -> bool:
        """Whether it has been asked for a motion."""
        return self._piecewise is not None

    def __call__(self, period: int) -> Solution | None:
        """Return the motion that closes after this many revolutions, or fewer; None where none is found."""
        if (held := self._held(period)) is not None:
            return held
        try:
            if self._piecewise is None:
                self._piecewise = PiecewiseMotion(*self._case)
            piecewise = self._piecewise
            orbit = shoot(
                piecewise,
                piecewise.start,
                piecewise.states,
                period,
                most_iterations=MOST_ITERATIONS,
                least_step=LEAST_STEP,
                most_events=MOST_EVENTS // period,
            )
        except (NoClosedForm, NotConverged):
            return None
        return Solution(orbit.period, complex(orbit.multipliers[0]), self._section(piecewise, orbit))

    def _held(self, period: int) -> Solution | None:
        """Return the motion that the case was begun on, if it has that period and still is there."""
        if self._known is None or period % self._known[1].period:
            return None
        piecewise, orbit = self._known
        end = piecewise.march.reduced(self._case[3])
        begun = [orbit.motion, *(revolution.end for revolution in orbit.revolutions[:-1])]
        away = [piecewise.size(end - motion) for motion in begun]
        k = int(np.argmin(away))
        if away[k] > nothing(piecewise.setup) * piecewise.size(begun[k]):
            return None
        section = np.roll(self._section(piecewise, orbit), -k, axis=0)
        return Solution(orbit.period, complex(orbit.multipliers[0]), section)

    def _section(self, piecewise: PiecewiseMotion, orbit: Orbit) -> Floats:
        """Displacement of the output node where revolutions begin."""
        setup = piecewise.setup
        rows = output_degrees(setup.model)[:2]
        sag = np.where(rows >= 0, setup.model.sag[rows], 0.0)
        begun = [orbit.motion, *(revolution.end for revolution in orbit.revolutions[:-1])]
        return np.array([setup.reduced.output[:2] @ motion[: piecewise.n] + sag for motion in begun])
