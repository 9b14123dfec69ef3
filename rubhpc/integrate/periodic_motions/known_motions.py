"""Stable periodic motions of an operating point, solved once, that any number of starts may settle on."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dgeev

from rubhpc.integrate.periodic_motions.saltation import monodromy
from rubhpc.kernels.linear_theory import Theory, fill_theory

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.periodic_motions.shooting import Orbit
    from rubhpc.integrate.record import Record, State

    Floats = NDArray[np.float64]

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

    Attributes
    ----------
    monodromy : (2 n, 2 n)
    theory : Theory
        The same, as far as anything is left of a disturbance after one period.
    is_stable : bool
        Whether the sum exists: all multipliers lie within the unit circle.

    Parameters
    ----------
    monodromy : (2 n, 2 n)
    energy : (2 n,)
        Diagonal of W.
    scale : (2 n,), optional
        What components are multiplied with, to be compared with one another.
    """

    def __init__(self, monodromy: Floats, energy: Floats, scale: Floats | None = None) -> None:
        """Sum the energies of all periods."""
        self.monodromy, m = monodromy, energy.size
        rooms = np.empty((8, m, m))
        weights = np.sqrt(energy) if scale is None else scale
        rank, self.is_stable = fill_theory(monodromy, weights, energy, rooms)
        self.theory = Theory(
            rooms[0, :rank].copy(),
            rooms[1, :rank].copy(),
            rooms[2, :rank, :rank].copy(),
            rooms[3, :rank, :rank].copy(),
        )
        self._energy = energy

    @classmethod
    def to(cls, piecewise: PiecewiseMotion, monodromy: Floats) -> Approach:
        """Distances from a motion of a case with this monodromy matrix."""
        square, pace = piecewise.setup.spin**2, piecewise.bodies.stiffness.diagonal()
        scale = np.ones(2 * piecewise.n)
        np.sqrt(np.maximum(pace, square), out=scale[: piecewise.n])
        return cls(monodromy, piecewise.energy, scale)

    @cached_property
    def multiplier(self) -> complex:
        """The largest; of a pair either."""
        if self.theory.onward.size == 0:
            return 0j
        real, imag, *_ = dgeev(self.theory.onward, compute_vl=0, compute_vr=0)
        k = int((real**2 + imag**2).argmax())
        return complex(real[k], imag[k])

    def square(self, apart: Floats) -> float:
        """Square of the distance (2 n,)."""
        read = self.theory.reading @ apart
        return float(apart**2 @ self._energy + read @ self.theory.sums @ read)

    def squares(self, apart: Floats) -> list[float]:
        """Squares of k distances (k, 2 n)."""
        read = apart @ self.theory.reading.T
        later = ((read @ self.theory.sums) * read).sum(axis=1)
        found: list[float] = (apart**2 @ self._energy + later).tolist()
        return found

    def obeys(self, before: Floats, after: Floats, n_period: int) -> bool:
        """Whether the distance (2 n,) some periods later is what the linear theory says, and falls like that.

        It strays from it by a tenth at most of the distance before, and its square has lost half at least.
        """
        predicted = before
        for _ in range(n_period):
            predicted = self.monodromy @ predicted
        begun, ended, expected, strays = self.squares(np.array([before, after, predicted, after - predicted]))
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
    multiplier : complex
        The largest.
    approach : Approach
        Of cases that are as near to it as to no other, whole periods later.
    """

    motion: Floats
    state: State
    period: int
    size: float
    multiplier: complex
    approach: Approach

    @property
    def n_period(self) -> int:
        """Periods over which a case is compared with the linear theory."""
        return -(-WATCHED // self.period)


class Found(NamedTuple):
    """A stable motion that was solved for, and the linear theory of cases near it."""

    piecewise: PiecewiseMotion
    orbit: Orbit
    approach: Approach


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

    def add(self, found: Found) -> None:
        """Keep a motion, with the linear theory from each of its revolutions."""
        piecewise, orbit, approach = found
        turns, motion, states = orbit.revolutions, orbit.motion, orbit.states
        multiplier = approach.multiplier
        for k, turn in enumerate(turns):
            if k:
                approach = Approach.to(piecewise, monodromy(piecewise, (*turns[k:], *turns[:k])))
            state = piecewise.march.state_of(motion, piecewise.contact_force(states, motion))
            size = piecewise.size(motion)
            self._places.append(Place(motion, state, orbit.period, size, multiplier, approach))
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
