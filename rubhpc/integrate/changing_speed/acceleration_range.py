"""Accelerations that contact modes of a range of speeds may follow."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from rubhpc.integrate.changing_speed.mode_courses import between
from rubhpc.integrate.changing_speed.range_errors import (
    PASSING,
    PLACES,
    inverse_of,
    inverses_of,
    lost_by,
    resonances,
    signal_error,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.integrate.changing_speed.range_errors import Rotor

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

BY_ACCELERATION = 1.0  # error by the acceleration over the accuracy, at the ends of its range
LEAK = 1.0  # of it by which an event may change a motion, over the accuracy


class AtPlace(NamedTuple):
    """What a range has at one of its speeds."""

    speed: float  # rad/s
    matrices: tuple[Floats, Floats]  # stiffness and damping
    modes: tuple[Complexes, Complexes]  # exponents and shapes that follow the speed
    inverse: Complexes  # of the shapes, as it follows


class Judge:
    """Says which accelerations, rad/s^2, modes may follow that go evenly from one acceleration to another.

    Parameters
    ----------
    nodes : list of (exponents, shapes)
        Modes at `NODES`, the middle first, and last those in the middle at the other acceleration.
    momentum : (n, n)
        Change of the stiffness with the acceleration, per rad/s^2.
    at : (float, float, float)
        Speed in the middle and half of the range, rad/s, and acceleration there, rad/s^2.
    rise : float, rad/s^2
        Other acceleration less that.
    accuracy : float
        Relative error of each signal.
    """

    def __init__(
        self,
        rotor: Rotor,
        nodes: list[tuple[Complexes, Complexes]],
        momentum: Floats,
        at: tuple[float, float, float],
        *,
        rise: float,
        accuracy: float,
    ) -> None:
        self.rise = rise
        self._rotor, self._nodes, self._momentum = rotor, nodes, momentum
        self._middle, self._half, self._acceleration = at
        self._accuracy = accuracy
        self._known: dict[float, bool] = {}

    def serves(self, acceleration: float) -> bool:
        """Whether modes hold their accuracy all over the range."""
        if 0.0 <= (acceleration - self._acceleration) / self.rise <= 1.0 and self._serves_all:
            return True
        if acceleration not in self._known:
            self._known[acceleration] = self._holds(acceleration)
        return self._known[acceleration]

    @cached_property
    def _serves_all(self) -> bool:
        """Whether modes hold their accuracy up to the other acceleration: errors are convex over it."""
        return all(self._holds(self._acceleration + share * self.rise) for share in (0.5, 1.0))

    def _holds(self, acceleration: float) -> bool:
        return self.error(acceleration) <= BY_ACCELERATION * self._accuracy

    def error(self, acceleration: float) -> float:
        """Relative error of the worst signal in the range."""
        change = acceleration - self._acceleration
        share = change / self.rise
        (exponent_by, shape_by), inverse_by = self._risen_by
        worst = 0.0
        for speed, (stiffness, damping), (exponent, shape), inverse in self._at_places:
            matrices = stiffness + change * self._momentum, damping
            modes = exponent + share * exponent_by, shape + share * shape_by
            worst = max(worst, lost_by(modes[1], inverse + share * inverse_by, self._middle) / LEAK)
            growth = min(PASSING * speed, abs(acceleration) / self._half)
            worst = max(worst, signal_error(self._rotor, matrices, modes, speed, growth))
        return worst

    @cached_property
    def _risen_by(self) -> tuple[tuple[Complexes, Complexes], Complexes]:
        """Change of exponents, shapes and their inverse to the other acceleration."""
        (exponent, shape), risen = self._nodes[0], self._nodes[-1]
        return (risen[0] - exponent, risen[1] - shape), inverse_of(risen[1]) - inverse_of(shape)

    @cached_property
    def _at_places(self) -> list[AtPlace]:
        """What the range has where it is judged, at the acceleration in its middle."""
        nodes, middle, half = self._nodes[:-1], self._middle, self._half
        exponents, shapes = [node[0] for node in nodes], [node[1] for node in nodes]
        inverses, found = inverses_of(shapes), []
        for place in (*PLACES, 0.0, *resonances(nodes, middle, half)):
            speed = middle + place * half
            modes = between(exponents, place), between(shapes, place)
            found.append(AtPlace(speed, self._rotor.matrices(speed), modes, between(inverses, place)))
        return found
