"""Stable periodic motions of an operating point, solved once, that any number of starts may settle on."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.periodic_motions.powers import Powers
from rubhpc.integrate.periodic_motions.saltation import monodromy

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.shooting import Orbit
    from rubhpc.integrate.record import Record, State

    Floats = NDArray[np.float64]

MOST_SQUARINGS = 60  # of the monodromy matrix, until nothing is left of it
ROUNDING = float(np.finfo(float).eps)
MOST_PERIODS = 4000  # that the linear theory is followed
NEAR = 0.5  # of a motion's size, within which a case is looked at
WATCHED = 2  # revolutions, at least, over which it must do as the linear theory says
SHARE = 0.5  # of what that takes from the square of its distance, that it loses at least
LINEAR = 0.1  # of its distance, by which it may differ from that then
HALF = 1 / 4  # of the square of its distance, that is left when it has drawn near
THERE = 1e-8  # of the motion's size: a case as near as that has arrived
TICKS = 4  # times what a point of the orbit turns in the resolution of events: nearer no simulation comes
SAME = 1e-7  # of the motion's size: motions as near as that are one


def nothing(setup: ModalSetup) -> float:
    """Distance of a case from a motion, over the size of that, at which it has arrived."""
    return max(THERE, TICKS * abs(setup.spin) * setup.tick)


class Approach:
    """How far a motion is from a stable periodic one, in a norm that falls while the distance is small.

    Its square is `d'P d` with `P = sum over k of (M^k)'W M^k`: the sum over all periods to come of the energy
    of the disturbance d, where M is the monodromy matrix and W the energy's. It falls by `d'W d` in a period.

    Parameters
    ----------
    powers : Powers
        Of the monodromy matrix (2 n, 2 n), whose eigenvalues lie within the unit circle.
    energy : (2 n,)
        Diagonal of W.
    """

    def __init__(self, powers: Powers, energy: Floats) -> None:
        """Sum the energies, twice as many periods at a time."""
        self._powers, self._n_power = powers, 1
        form = np.diag(energy)
        for k in range(MOST_SQUARINGS):
            power = powers.of(k)
            more = power.T @ (form @ power)
            form = form + more
            self._n_power = k + 1
            if more.diagonal().max() <= ROUNDING * form.diagonal().max():  # no entry is larger
                break
        self._form = form

    def square(self, apart: Floats) -> float:
        """Square of the distance (2 n,)."""
        return float(apart @ self._form @ apart)

    def squares(self, apart: Floats) -> list[float]:
        """Squares of k distances (k, 2 n)."""
        found: list[float] = np.einsum("ki,ki->k", apart @ self._form, apart).tolist()
        return found

    def periods_to(self, share: float, apart: Floats) -> int:
        """Periods until the linear theory leaves no more than a share of the square."""
        least, n_period = share * self.square(apart), 0
        if self.square(apart) <= least:
            return 0
        for k in range(self._n_power - 1, -1, -1):  # the square falls in every period
            moved = self._powers.of(k) @ apart
            if n_period + (1 << k) < MOST_PERIODS and self.square(moved) > least:
                apart, n_period = moved, n_period + (1 << k)
        return n_period + 1

    def obeys(self, before: Floats, after: Floats, n_period: int) -> bool:
        """Whether the distance (2 n,) some periods later is what the linear theory says, and falls like that.

        It strays from it by a tenth at most of the distance before, and its square has lost half at least.
        """
        predicted = before
        for _ in range(n_period):
            predicted = self._powers.of(0) @ predicted
        three = np.array([before, after, predicted, after - predicted])
        begun, ended, expected, strays = np.einsum("ki,ij,kj->k", three, self._form, three)
        return bool(strays <= LINEAR**2 * begun and begun - ended >= SHARE * (begun - expected))


class Place(NamedTuple):
    """Where a known motion begins one of its revolutions.

    Attributes
    ----------
    motion : (2 n,)
        Reduced displacements and velocities.
    state : State
        The same of all bodies.
    period : int
        Revolutions.
    size : float
        Of the motion, as `PiecewiseMotion.size` has it.
    approach : Approach
        Of cases that are as near to it as to no other, whole periods later.
    """

    motion: Floats
    state: State
    period: int
    size: float
    approach: Approach

    @property
    def n_period(self) -> int:
        """Periods over which a case is compared with the linear theory."""
        return -(-WATCHED // self.period)


class KnownMotions:
    """Motions as they are found; it keeps no set-up, so that it may be kept as long as that.

    Parameters
    ----------
    setup : ModalSetup
    """

    def __init__(self, setup: ModalSetup) -> None:
        energy = np.repeat([setup.spin**2, 1.0], setup.reduced.stiffness.shape[0])
        self._energy, self._nothing = energy, nothing(setup)
        self._places: list[Place] = []
        self._sections = np.zeros((0, energy.size))
        self._sizes = np.zeros(0)
        self._records: dict[int, Record] = {}

    def __len__(self) -> int:
        """Revolutions of all motions."""
        return len(self._places)

    def add(self, piecewise: PiecewiseMotion, orbit: Orbit) -> None:
        """Keep a stable motion."""
        turns, motion, states = orbit.revolutions, orbit.motion, orbit.states
        for k, turn in enumerate(turns):
            powers = Powers(monodromy(piecewise, (*turns[k:], *turns[:k]))) if k else orbit.powers
            state = piecewise.march.state_of(motion, piecewise.contact_force(states, motion))
            approach = Approach(powers, self._energy)
            self._places.append(Place(motion, state, orbit.period, piecewise.size(motion), approach))
            motion, states = turn.end, turn.states
        self._sections = np.array([place.motion for place in self._places])
        self._sizes = np.array([place.size for place in self._places])

    def nearest(self, motion: Floats, within: float = NEAR) -> int | None:
        """Number of the place that a motion (2 n,) is nearest to, within a share of its size; None: none."""
        if not self._places:
            return None
        apart = np.sqrt((self._sections - motion) ** 2 @ self._energy)
        found = int((apart / self._sizes).argmin())
        return found if apart[found] <= within * self._sizes[found] else None

    def place(self, number: int) -> Place:
        """The place of a number."""
        return self._places[number]

    def is_at(self, place: Place, apart: Floats) -> bool:
        """Whether a distance (2 n,) from a place is nothing."""
        return bool(apart**2 @ self._energy <= (self._nothing * place.size) ** 2)

    def record(self, number: int, make: Callable[[State], Record]) -> Record:
        """The record that begins at a place, made when it is first asked for."""
        if number not in self._records:
            self._records[number] = make(self._places[number].state)
        return self._records[number]
