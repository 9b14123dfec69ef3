"""The periodic motion next to the end of a record: whether there is one, and whether it is stable."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.measuring.orbit_measures import PERIOD_TOLERANCE, closest_return
from rubhpc.integrate.measuring.regimes import MOST_DOUBLED, MOST_EVENTS, Solution
from rubhpc.integrate.packing import output_degrees
from rubhpc.integrate.periodic_motions.shooting import NotConverged, Orbit, shoot
from rubhpc.integrate.transient import idle_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.modal import ModalMarch
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.collocated_motion import FollowedMotion
    from rubhpc.integrate.record import State

    Floats = NDArray[np.float64]

MOST_ITERATIONS, LEAST_STEP = 6, 1.0  # a record that looks periodic is near the solution
PATIENT_ITERATIONS, PATIENT_STEP = 12, 1 / 8  # with shorter steps, from a motion that has come to it
# Where that finds no stable motion that the record agrees with: revolutions after which it is looked at; the
# distance, of its size, in which the motion then returns if it has come to one, and in which it does if it
# draws near.
LATER = 64, 64, 128, 256, 512, 512
# How often it is looked at: where it looks periodic, or there are few pairs; where there are more; where
# there are many. Twice more where it looks chaotic.
N_LOOKS, N_SHORT, N_MORE = 4, 2, 2
FEW_PAIRS, MANY_PAIRS = 2, 6
ARRIVED, DRAWING_NEAR, NEARER = 1e-4, PERIOD_TOLERANCE, 0.5
NEAR_ENOUGH = 2.0 * DRAWING_NEAR  # of its size: what returns within that is looked at closely


class Solver:
    """Solves for periodic motions from where a case has ended."""

    def __init__(
        self,
        motion_of: Callable[[State, ModalMarch | None], FollowedMotion],
        final: State,
        march: ModalMarch | None = None,
    ) -> None:
        """Take the end of a case; a march of it that is needed no more is started again.

        `motion_of` makes what follows its motions from a state, with such a march.
        """
        self._motion_of, self._final, self._march = motion_of, final, march
        self._followed: FollowedMotion | None = None
        self.followed: tuple[Floats, State] | None = None  # energies at revolutions, and the end

    def __call__(self, period: int) -> Solution | None:
        """Return the motion that closes after this many revolutions, or fewer; None where none is found."""
        try:
            if self._followed is None:
                self._followed = self._motion_of(self._final, self._march)
        except NoClosedForm:
            return None
        return _solution(self._followed, period, MOST_ITERATIONS, LEAST_STEP)

    def later(
        self, looks_periodic: bool, looks_chaotic: bool
    ) -> Iterator[tuple[int, Callable[[int], Solution | None]]]:
        """Where to look for a motion that is not found at the end: a period, and what solves for it.

        A case that looks periodic goes on for 512 revolutions, as does one of one or two pairs. Else one of
        three to five pairs goes on for 128 and one of more not at all, for the time that it takes. A case
        that looks chaotic goes on for longer: 1536, 512 or 128 revolutions. Where its last revolutions return
        within 1e-4 of the motion's size, and in half the distance of the search before, it may have come to a
        periodic motion; at the end also where they return within 1 %, nearer than ever and in half the
        distance of the beginning. A case that reaches the end is in `followed`.
        """
        n_on, tried = 0, ARRIVED / NEARER
        energy: list[Floats] = []
        returned: list[float] = []
        try:
            followed = self._followed or self._motion_of(self._final, self._march)
            n_looks = N_LOOKS if looks_periodic or followed.q <= FEW_PAIRS else N_SHORT
            if followed.q >= MANY_PAIRS and not looks_periodic:
                n_looks = 0  # what is not recorded may need contact modes of its own
            spans = LATER[: n_looks + N_MORE * looks_chaotic]
            march, setup = followed.march, followed.setup
            march.start_again(self._final)
            for n_revolution in spans:
                passed, reason = march.pass_sections(n_revolution, *idle_of(march))
                if reason is not None:
                    return
                n_on += n_revolution
                weights = _energy(setup, passed)
                energy.append(passed**2 @ weights)
                period, apart = _return_of(passed, weights)
                returned.append(apart)
                draws_near = n_on == sum(spans) and apart <= DRAWING_NEAR and _falls(returned)
                if apart > NEARER * tried and not draws_near:
                    continue
                tried, state = apart, march.final()
                yield period, partial(_solved_later, self._motion_of(state, None), n_on)
                march.start_again(state)
            if energy:
                self.followed = np.concatenate(energy), march.final()
        except NoClosedForm:
            return


def _solution(
    followed: FollowedMotion, period: int, most_iterations: int, least_step: float
) -> Solution | None:
    """Motion that closes after a period, or after a divisor of it; None where none is found."""
    try:
        orbit = shoot(
            followed,
            followed.start,
            followed.states,
            period,
            most_iterations=most_iterations,
            least_step=least_step,
            most_events=MOST_EVENTS // period,
        )
    except (NoClosedForm, NotConverged):
        return None
    away = followed.size(followed.start - orbit.motion)
    return Solution(
        orbit.period,
        complex(orbit.multipliers[0]),
        _section(followed, orbit),
        is_led_to=away <= PERIOD_TOLERANCE * followed.size(orbit.motion),
    )


def _solved_later(followed: FollowedMotion, n_revolution: int, period: int) -> Solution | None:
    """Motion found from so many revolutions behind the end of a record, its section turned back to that."""
    found = _solution(followed, period, PATIENT_ITERATIONS, PATIENT_STEP)
    return found and found._replace(section=np.roll(found.section, n_revolution, axis=0))


def _energy(setup: ModalSetup, passed: Floats) -> Floats:
    """Twice the energy of unit motions, (2 n,)."""
    return np.repeat([setup.spin**2, 1.0], passed.shape[1] // 2)


def _return_of(passed: Floats, energy: Floats) -> tuple[int, float]:
    """Revolutions after which the last motions (k, 2 n) return nearest, and how near, over their size."""
    longest = min(MOST_DOUBLED, len(passed) // 2)
    ends, place = passed[-2 * longest :], np.arange(longest)
    size = math.sqrt(passed[-1] ** 2 @ energy)
    weighed = ends * energy  # products find what does not return, and nothing nearer than 1e-8
    square = np.einsum("ij,ij->i", weighed, ends)
    before = longest + place - place[:, np.newaxis] - 1
    product = weighed[longest:] @ ends.T
    back = (square[longest:] + square[before] - 2.0 * product[place, before]).mean(axis=1)
    if back.min() <= NEAR_ENOUGH**2 * size**2:
        back = ((ends[longest:] - ends[before]) ** 2 @ energy).mean(axis=1)
    return closest_return(back, size), math.sqrt(max(back.min(), 0.0)) / size


def _falls(apart: list[float]) -> bool:
    """Whether the last of these distances is the least, and half of the first or less."""
    return apart[-1] <= NEARER * apart[0] and apart[-1] == min(apart)


def _section(followed: FollowedMotion, orbit: Orbit) -> Floats:
    """Displacement of the output node where revolutions begin."""
    setup = followed.setup
    rows = output_degrees(setup.model)[:2]
    sag = np.where(rows >= 0, setup.model.sag[rows], 0.0)
    begun = [orbit.motion, *(revolution.end for revolution in orbit.revolutions[:-1])]
    return np.array([setup.reduced.output[:2] @ motion[: followed.n] + sag for motion in begun])
