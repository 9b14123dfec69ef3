"""Samples taken at even times in each piece come to the angles of a shaft whose speed changes."""

import itertools

import numpy as np
import pytest

from rubhpc.integrate.changing_speed.sample_times import bring_to_angles, late_in_piece, late_under
from rubhpc.kernels.resampling import resample
from rubhpc.study.speed_law import SpeedLaw

LAW = SpeedLaw(time=(0.0, 0.8, 1.0), speed=(60.0, 100.0, 90.0))
PER_REVOLUTION = 64


def test_cubics_are_brought_to_other_instants_exactly():
    late = np.array([0.0, 0.4, -0.3, 1.7, 0.2, 0.9, -2.1, 0.3])
    instant = np.arange(8.0)
    rows = np.array([np.polyval(c, instant) for c in ([1.0, -2.0, 0.5, 3.0], [0.0, 1.0, 2.0, 1.0])])
    resample(rows, late, np.array([0, 8]))
    for row, c in zip(rows, ([1.0, -2.0, 0.5, 3.0], [0.0, 1.0, 2.0, 1.0]), strict=True):
        np.testing.assert_allclose(row, np.polyval(c, instant + late), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("pieces", [1, 4])
def test_a_signal_of_the_time_is_brought_to_the_angles_of_the_shaft(pieces):
    n = LAW.n_revolution * PER_REVOLUTION
    cuts = np.arange(0, n + 1, PER_REVOLUTION // pieces)
    exact, _, _ = LAW.at_angle(2.0 * np.pi * np.arange(n) / PER_REVOLUTION)
    begins, _, _ = LAW.at_angle(2.0 * np.pi * cuts / PER_REVOLUTION)
    parts = [np.linspace(a, b, cuts[1], endpoint=False) for a, b in itertools.pairwise(begins)]
    even = np.concatenate(parts)
    whole = np.tile(np.sin(90.0 * even), (8, 1))  # four rows of the rotor, three of a stator, a probe
    bring_to_angles(whole, late_under(LAW, cuts, PER_REVOLUTION), cuts, 1)
    for row in (*range(6), 7):
        assert np.abs(whole[row] - np.sin(90.0 * exact)).max() < 2e-5
    assert np.array_equal(whole[6], np.sin(90.0 * even))  # a mean over intervals stays


def test_a_driven_piece_comes_as_late_as_one_under_a_law():
    law = SpeedLaw(time=(0.0, 1.0), speed=(60.0, 100.0))
    cuts = np.arange(0, 3 * PER_REVOLUTION + 1, PER_REVOLUTION)
    late = late_under(law, cuts, PER_REVOLUTION)
    _, speed, _ = law.at_angle(2.0 * np.pi * np.arange(3))
    for i in range(3):
        found = late_in_piece(speed[i], 40.0, 2.0 * np.pi, PER_REVOLUTION)
        np.testing.assert_allclose(found, late[i * PER_REVOLUTION : (i + 1) * PER_REVOLUTION], atol=1e-9)
