"""Samples taken at even times in each piece come to the angles of a shaft whose speed changes."""

import itertools

import numpy as np
import pytest

from rubhpc.integrate.changing_speed.turns import bring_to_angles
from rubhpc.kernels.resampling import resample
from rubhpc.study.speed_law import SpeedLaw

PER_REVOLUTION = 64


@pytest.mark.parametrize("swing", [0.2, -0.1])
def test_cubics_of_the_time_are_brought_to_even_angles_exactly(swing):
    cubics, time = ([1.0, -2.0, 0.5, 3.0], [0.0, 1.0, 2.0, 1.0]), np.arange(8.0) / 8
    rows = np.array([np.polyval(c, time) for c in cubics])
    resample(rows, np.array([swing]), np.array([0, 8]))
    every = np.linspace(0.0, 1.0, 200_001)
    at = np.interp(time, (1.0 - swing) * every + swing * every**2, every)  # when the shaft is at even angles
    assert np.abs(at - time).max() > 0.2 * abs(swing)
    for row, c in zip(rows, cubics, strict=True):
        np.testing.assert_allclose(row, np.polyval(c, at), atol=1e-9)


@pytest.mark.parametrize("stop", [100.0, 40.0])
@pytest.mark.parametrize("pieces", [1, 4])
def test_a_signal_of_the_time_is_brought_to_the_angles_of_the_shaft(pieces, stop):
    law = SpeedLaw(time=(0.0, 1.0), speed=(60.0, stop))
    n = law.n_revolution * PER_REVOLUTION
    cuts = np.arange(0, n + 1, PER_REVOLUTION // pieces)
    exact, _, _ = law.at_angle(2.0 * np.pi * np.arange(n) / PER_REVOLUTION)
    begins, speeds, _ = law.at_angle(2.0 * np.pi * cuts / PER_REVOLUTION)
    parts = [np.linspace(a, b, cuts[1], endpoint=False) for a, b in itertools.pairwise(begins)]
    even = np.concatenate(parts)
    whole = np.tile(np.sin(90.0 * even), (8, 1))  # four rows of the rotor, three of a stator, a probe
    bring_to_angles(whole, np.diff(speeds) / (speeds[1:] + speeds[:-1]), cuts, 1)
    for row in (*range(6), 7):
        assert np.abs(whole[row] - np.sin(90.0 * exact)).max() < 5e-5
    assert np.array_equal(whole[6], np.sin(90.0 * even))  # a mean over intervals stays
