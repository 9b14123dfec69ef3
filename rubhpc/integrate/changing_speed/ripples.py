"""Sidebands of the unbalance force by the pieces of a run-up, and the allowed length of pieces.

Within a piece of duration T at constant speed the error of the shaft's angle is a parabola with mean zero,
from `lag = a T^2 / 12` at both ends to `-lag / 2` in the middle. Pieces of equal length repeat it. Besides
the force at the speed W there are forces at `W +- k D`, `D = 2 pi / T`, each `3 lag / (pi k)^2` times as
large. The error of a signal is its response to these over its response to the force itself. It is large where
a sideband meets a resonance, or where a node hardly moves at W.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.study.speed_law import LAG, cut

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from rubhpc.study.speed_law import SpeedLaw

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]
    Ints = NDArray[np.int64]

SIDEBANDS, HIGHEST = 3, 2.0  # on either side: least number, and largest distance over the speed
SHARE = 0.75  # of the requested accuracy: error of a signal in its 1X
NEXT_SPEED = 0.02  # relative step between speeds for which pieces are assessed
STILL = 1e-12  # of the largest degree; a smaller one counts as unmoved
PASSING = 0.01  # growth over the speed, 1/rad, at which a passage meets a resonance
LEAST = LAG / 64.0  # rad, for signals of nodes that do not move with the shaft
PROMISED = 5e-3  # relative error of a signal without contact, above which a case warns


class Linear(NamedTuple):
    """A rotor without contact at a speed, in the reduced degrees that the unbalance moves."""

    stiffness: Floats  # (n, n)
    damping: Floats  # (n, n)
    phasor: Complexes  # (n,), unbalance
    seen: Floats  # (3, n_signal, n), what signals see of displacements, velocities and accelerations

    def signals(self, exponents: Complexes) -> Complexes:
        """Signals (n_exponent, n_signal) under the unbalance times `exp(exponent t)`, 1/s."""
        s = exponents[:, np.newaxis, np.newaxis]
        n = self.phasor.size
        matrices = self.stiffness + s * self.damping + s**2 * np.eye(n)
        motion = np.linalg.solve(matrices, np.broadcast_to(self.phasor[:, np.newaxis], (s.size, n, 1)))
        rows = self.seen[0] + s * self.seen[1] + s**2 * self.seen[2]
        found: Complexes = (rows @ motion)[..., 0]
        return found

    @classmethod
    def of_moved(
        cls, stiffness: Floats, damping: Floats, phasor: Complexes, seen: Floats, speed: float
    ) -> Linear:
        """The same in the degrees that the unbalance moves at a speed, rad/s."""
        motion = np.abs(np.linalg.solve(stiffness + 1j * speed * damping, phasor))
        moved = np.flatnonzero(motion > STILL * motion.max(initial=0.0))
        both = np.ix_(moved, moved)
        return cls(stiffness[both], damping[both], phasor[moved], seen[..., moved])


class Ripples:
    """Allowed lag of the shaft within the pieces of a run-up.

    Parameters
    ----------
    linear : callable
        The rotor at a speed, rad/s.
    accuracy : float
        Relative.
    """

    def __init__(self, linear: Callable[[float], Linear], accuracy: float) -> None:
        self._linear, self._accuracy = linear, accuracy
        self._known: dict[int, Linear] = {}
        self._errors: dict[tuple[int, float], Floats] = {}
        self._cuts: dict[tuple[SpeedLaw, int, int | None], Ints] = {}

    def allowed(self, speed: float, turns: float) -> float:
        """Allowed lag (rad) of a piece at a speed, rad/s, over so many revolutions."""
        error = self._per_lag(speed, turns).max(initial=0.0) / (SHARE * self._accuracy)
        return max(LAG / max(LAG * float(error), 1.0), LEAST)

    def cut(self, law: SpeedLaw, per_revolution: int, pieces_per_revolution: int | None) -> Ints:
        """Samples between which the pieces of a law lie (`speed_law.cut`), also for other cases."""
        asked = law, per_revolution, pieces_per_revolution
        if asked not in self._cuts:
            self._cuts[asked] = cut(law, per_revolution, pieces_per_revolution, self.allowed)
        return self._cuts[asked]

    def advice(self, speed: Floats, turns: Floats, lag: Floats, names: Sequence[str]) -> str:
        """Advice where pieces, (n,) each, are too long for a signal; else "".

        `names` are those of the signals, `lag` (rad) that of the pieces.
        """
        worst = np.zeros(len(names))
        for at, lasts, late in zip(speed.tolist(), turns.tolist(), np.abs(lag).tolist(), strict=True):
            worst = np.maximum(worst, late * self._per_lag(at, lasts))
        error = worst.max()
        if error <= max(PROMISED, self._accuracy):
            return ""
        return (
            f"its pieces are too long for the change of speed: {names[int(worst.argmax())]} may err by "
            f"{100 * error:.2g} %; take more samples_per_revolution (a power of 2), no pieces_per_revolution"
        )

    def _per_lag(self, speed: float, turns: float) -> Floats:
        """Relative error of each signal over the lag, 1/rad; 0 for those that unbalance does not excite."""
        place = round(math.log(speed) / NEXT_SPEED)
        if (place, turns) not in self._errors:
            self._errors[place, turns] = self._error(place, turns)
        return self._errors[place, turns]

    def _error(self, place: int, turns: float) -> Floats:
        speed = math.exp(place * NEXT_SPEED)
        if place not in self._known:
            self._known[place] = self._linear(speed)
        count = np.arange(1, max(SIDEBANDS, math.ceil(HIGHEST * turns)) + 1)
        count = np.concatenate([-count, count])
        at = np.concatenate([[1.0], 1.0 + count / turns])
        signals = np.abs(self._known[place].signals((1j * at + PASSING) * speed))
        own, sides = signals[0], signals[1:] * (3.0 / (np.pi * count[:, np.newaxis]) ** 2)
        error: Floats = np.zeros_like(own)
        np.divide(np.linalg.norm(sides, axis=0), own, out=error, where=own > 0.0)
        return error
