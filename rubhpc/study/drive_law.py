"""A drive's torque over the speed, and how fast a rotor can turn by it."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

TRIED = 4096  # steps over the angle in which the highest speed is looked for
MARGIN = 1.05  # vibration may give back to the spin what it holds


@dataclass(frozen=True, kw_only=True)
class DriveLaw:
    """Drive of a rotor whose speed is not prescribed.

    Attributes
    ----------
    torque : tuple of float, N m
        One value, or one for each of the speeds: linear between them, constant beyond.
    speed : tuple of float, rad/s
        Rising; () for a torque that holds at all speeds.
    start : float, rad/s
        Spin speed at the beginning.
    n_revolution : int
        Revolutions recorded, at most.
    inertia : float or None, kg m^2
        Of the drive.
    lowest, highest : float, rad/s
        The record ends where the spin leaves this range.
    """

    torque: tuple[float, ...]
    speed: tuple[float, ...] = ()
    start: float
    n_revolution: int
    inertia: float | None = None
    lowest: float
    highest: float = math.inf

    def at(self, speed: float) -> float:
        """Torque at a speed (rad/s), N m."""
        if len(self.torque) == 1:
            return self.torque[0]
        i = min(max(bisect_right(self.speed, speed), 1), len(self.speed) - 1)
        low, high = self.speed[i - 1], self.speed[i]
        share = min(max((speed - low) / (high - low), 0.0), 1.0)
        return self.torque[i - 1] + share * (self.torque[i] - self.torque[i - 1])

    def slope(self, speed: float) -> float:
        """Change of the torque with the speed (rad/s), N m s."""
        if not self.speed or not self.speed[0] <= speed < self.speed[-1]:
            return 0.0
        i = bisect_right(self.speed, speed)
        return (self.torque[i] - self.torque[i - 1]) / (self.speed[i] - self.speed[i - 1])

    def fastest(self, inertia: float) -> float:
        """Speed, rad/s, that a rotor of this inertia (kg m^2, drive included) cannot pass by its torque.

        Without losses `d(W^2) / d(angle) = 2 T(W) / J`; what brakes leaves less.
        """
        step = 2.0 * math.pi * self.n_revolution / TRIED
        square = greatest = self.start**2
        for _ in range(TRIED):
            ahead = square + step * self.at(math.sqrt(square)) / inertia
            square += 2.0 * step * self.at(math.sqrt(max(ahead, 0.0))) / inertia
            if square <= self.lowest**2:
                break
            greatest = max(greatest, square)
        return min(MARGIN * math.sqrt(greatest), max(self.highest, self.start))
