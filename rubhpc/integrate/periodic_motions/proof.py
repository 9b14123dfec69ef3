"""The periodic motion next to the end of a record: whether there is one, and whether it is stable."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.measuring.orbit_measures import PERIOD_TOLERANCE
from rubhpc.integrate.measuring.regimes import MOST_DOUBLED, Solution, closest_return
from rubhpc.integrate.packing import output_degrees
from rubhpc.integrate.periodic_motions.known_motions import nothing
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.shooting import NotConverged, Orbit, shoot
from rubhpc.integrate.transient import idle_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import ModalSetup

    Floats = NDArray[np.float64]

MOST_ITERATIONS, LEAST_STEP = 6, 1.0  # a record that looks periodic is near the solution
MOST_EVENTS = 160  # in a period; the time that a proof takes goes with them
# Where that finds no stable motion that the record agrees with: with shorter steps, and from further on.
PATIENT_ITERATIONS, PATIENT_STEP = 12, 1 / 8
FURTHER = 64, 192  # revolutions


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
        self._found: dict[int, Solution | None] = {}  # by the period asked for
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
        except NoClosedForm:
            return None
        self._found[period] = _solution(self._piecewise, period, MOST_ITERATIONS, LEAST_STEP)
        return self._found[period]

    def _patiently(self, piecewise: PiecewiseMotion, period: int) -> Solution | None:
        """The same with shorter steps, where longer ones found nothing."""
        return self._found.get(period) or _solution(piecewise, period, PATIENT_ITERATIONS, PATIENT_STEP)

    def further(self, period: int) -> Iterator[tuple[int, Callable[[int], Solution | None]]]:
        """Where to look for a motion that was not found, in turn: a period, and what solves for it.

        First this period with shorter steps, then those at which the motion returns 64 and 256 revolutions
        on. Sections begin at the end of the record.
        """
        if self._piecewise is None:
            return
        piecewise = self._piecewise
        yield period, partial(self._patiently, piecewise)
        setup, clearance, friction, state = self._case
        n_on = 0
        for n_revolution in FURTHER:
            try:
                march = PiecewiseMotion(setup, clearance, friction, state).march
                passed, reason = march.pass_sections(n_revolution, *idle_of(march))
                if reason is not None:
                    return
                state, n_on = march.final(), n_on + n_revolution
                later = PiecewiseMotion(setup, clearance, friction, state)
            except NoClosedForm:
                return
            yield _return_of(later, passed), partial(_solved_later, later, n_on)

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
        section = np.roll(_section(piecewise, orbit), -k, axis=0)
        return Solution(orbit.period, complex(orbit.multipliers[0]), section)


def _solution(
    piecewise: PiecewiseMotion, period: int, most_iterations: int, least_step: float
) -> Solution | None:
    """Motion that closes after a period, or after a divisor of it; None where none is found."""
    try:
        orbit = shoot(
            piecewise,
            piecewise.start,
            piecewise.states,
            period,
            most_iterations=most_iterations,
            least_step=least_step,
            most_events=MOST_EVENTS // period,
        )
    except (NoClosedForm, NotConverged):
        return None
    away = piecewise.size(piecewise.start - orbit.motion)
    return Solution(
        orbit.period,
        complex(orbit.multipliers[0]),
        _section(piecewise, orbit),
        is_led_to=away <= PERIOD_TOLERANCE * piecewise.size(orbit.motion),
    )


def _solved_later(piecewise: PiecewiseMotion, n_revolution: int, period: int) -> Solution | None:
    """Motion found from so many revolutions behind the end of a record, its section turned back to that."""
    found = _solution(piecewise, period, PATIENT_ITERATIONS, PATIENT_STEP)
    return found and found._replace(section=np.roll(found.section, n_revolution, axis=0))


def _return_of(piecewise: PiecewiseMotion, passed: Floats) -> int:
    """Revolutions after which the last motions (k, 2 n) return nearest."""
    longest = min(MOST_DOUBLED, len(passed) // 2)
    energy = np.repeat([piecewise.setup.spin**2, 1.0], piecewise.n)
    back = [((passed[n:] - passed[:-n])[-longest:] ** 2 @ energy).mean() for n in range(1, longest + 1)]
    return closest_return(np.array(back), piecewise.size(passed[-1]))


def _section(piecewise: PiecewiseMotion, orbit: Orbit) -> Floats:
    """Displacement of the output node where revolutions begin."""
    setup = piecewise.setup
    rows = output_degrees(setup.model)[:2]
    sag = np.where(rows >= 0, setup.model.sag[rows], 0.0)
    begun = [orbit.motion, *(revolution.end for revolution in orbit.revolutions[:-1])]
    return np.array([setup.reduced.output[:2] @ motion[: piecewise.n] + sag for motion in begun])
