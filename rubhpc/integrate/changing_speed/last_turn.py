"""Braking of the shaft one revolution ago: rub recurs at the same angle, and is predicted from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray  # noqa: TC002


class LastTurn:
    """Braking over the last revolution, by the samples in it."""

    def __init__(self, per_revolution: int) -> None:
        """Start without braking."""
        self._torque, self._rubbed = np.zeros((2, per_revolution))

    def torque(self, at: int, length: int) -> float:
        """Mean braking torque over so many samples from `at` on, N m."""
        return _mean(self._torque[self._part(at, length)])

    def rubbed(self, at: int, length: int) -> float:
        """Friction loss over so many samples from `at` on, J."""
        return _mean(self._rubbed[self._part(at, length)]) * length

    def note_torque(self, at: int, length: int, torque: float) -> None:
        """Store the mean braking torque of a piece, N m, also for samples not reached yet."""
        part = self._part(at, length)
        self._torque[part.start : None if at < self._torque.size else part.stop] = torque

    def note_rub(self, at: int, length: int, rubbed: float) -> None:
        """Store the friction loss of a piece, J."""
        self._rubbed[self._part(at, length)] = rubbed / length

    def _part(self, at: int, length: int) -> slice:
        first = at % self._torque.size
        return slice(first, min(first + length, self._torque.size))


def _mean(part: NDArray[np.float64]) -> float:
    return float(part.sum()) / part.size  # `mean` takes three times as long for a few
