"""What braked the shaft a revolution ago: rub comes back at the same angle, and is predicted by it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray  # noqa: TC002


class LastTurn:
    """Braking over the last revolution, by the samples in it."""

    def __init__(self, per_revolution: int) -> None:
        """Start with nothing that brakes."""
        self._torque, self._rubbed = np.zeros((2, per_revolution))

    def torque(self, at: int, length: int) -> float:
        """Mean torque that braked over so many samples from `at` on, N m."""
        return _mean(self._torque[self._part(at, length)])

    def rubbed(self, at: int, length: int) -> float:
        """What friction took over so many samples from `at` on, J."""
        return _mean(self._rubbed[self._part(at, length)]) * length

    def note_torque(self, at: int, length: int, torque: float) -> None:
        """Note the mean torque, N m, that braked a piece; what was not reached yet is taken for as much."""
        part = self._part(at, length)
        self._torque[part.start : None if at < self._torque.size else part.stop] = torque

    def note_rub(self, at: int, length: int, rubbed: float) -> None:
        """Note what friction took from a piece, J."""
        self._rubbed[self._part(at, length)] = rubbed / length

    def _part(self, at: int, length: int) -> slice:
        first = at % self._torque.size
        return slice(first, min(first + length, self._torque.size))


def _mean(part: NDArray[np.float64]) -> float:
    return float(part.sum()) / part.size  # `mean` takes three times as long for a few
