"""Samples at fixed angles of a shaft whose speed changes within a piece.

A piece is sampled at even times. At the acceleration a the shaft is there behind the even angles, by up to
`a T^2 / 8`, and comes to them later.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.kernels.resampling import resample

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.study.speed_law import SpeedLaw

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


def late_under(law: SpeedLaw, cuts: Ints, per_revolution: int) -> Floats:
    """By how many intervals of sampling the shaft comes late to the angles of the samples, (n_sample,).

    `cuts` (n_piece + 1,) are the samples between which the pieces lie.
    """
    sample = np.arange(cuts[-1])
    reached, _, _ = law.at_angle(2.0 * np.pi / per_revolution * np.arange(cuts[-1] + 1))
    sizes = np.diff(cuts)
    begins, sizes_there = np.repeat(cuts[:-1], sizes), np.repeat(sizes, sizes)
    interval = np.repeat(np.diff(reached[cuts]) / sizes, sizes)
    late = (reached[:-1] - reached[begins]) / interval - (sample - begins)
    late[(sample == begins) | (sizes_there == 1)] = 0.0
    return late


def late_in_piece(speed: float, acceleration: float, turned: float, n_sample: int) -> Floats:
    """The same in a piece that begins at a speed (rad/s), of `n_sample` samples over an angle (rad)."""
    sample = np.arange(n_sample + 1)
    angle = turned * sample / n_sample
    time = 2.0 * angle / (speed + np.sqrt(speed**2 + 2.0 * acceleration * angle))
    late: Floats = (time * n_sample / time[-1] - sample)[:-1]
    return late


def bring_to_angles(whole: Floats, late: Floats, cuts: Ints, n_place: int) -> None:
    """Bring samples (`Samples.whole`) to the angles of the shaft that they are meant for, in place.

    `cuts` (n_piece + 1,) are the samples between which the pieces lie. Contact forces, which are means over
    the intervals, stay.
    """
    if late.any():
        first_force = 4 + 2 * n_place
        resample(whole[:first_force], late, cuts)
        resample(whole[first_force + n_place :], late, cuts)
