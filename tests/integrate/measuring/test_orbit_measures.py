"""Spectra, periods and whirl of signals whose answers are known."""

import math

import numpy as np
import pytest

from rubhpc.integrate.measuring.orbit_measures import period, whirl_ratio
from rubhpc.spectra import amplitude_spectrum

SAMPLES = 64  # a revolution


def angles(revolutions):
    """Shaft angle at each sample, rad."""
    return 2 * math.pi * np.arange(revolutions * SAMPLES) / SAMPLES


def test_spectrum_gives_the_amplitude_of_every_sine():
    turn = angles(8)
    signal = -3.0 + 2.0 * np.cos(turn + 0.3) + 0.5 * np.sin(1.5 * turn) + 0.25 * np.cos(SAMPLES / 2 * turn)
    spectrum = amplitude_spectrum(signal)
    expected = np.zeros(8 * SAMPLES // 2 + 1)
    expected[0] = 3.0  # the size of the mean
    expected[8], expected[12] = 2.0, 0.5  # line k is order k / 8
    expected[-1] = 0.25  # as fast as the samples can show
    assert spectrum == pytest.approx(expected, abs=1e-12)


def test_spectrum_of_stators_is_taken_one_by_one():
    turn = angles(4)
    signals = np.stack([np.cos(turn), 7 * np.sin(3 * turn)])
    spectrum = amplitude_spectrum(signals)
    assert spectrum.shape == (2, 4 * SAMPLES // 2 + 1)
    assert spectrum[:, [4, 12]] == pytest.approx(np.array([[1.0, 0.0], [0.0, 7.0]]), abs=1e-12)


def orbit(n, revolutions=40, amount=0.1):
    """Vertical and horizontal motion of period n: forward whirl with a part of order 1 / n."""
    turn = angles(revolutions)
    whirl = np.exp(1j * turn)
    if n > 1:
        whirl += amount * np.exp(1j * turn / n + 0.4j)
    return whirl.real, whirl.imag


@pytest.mark.parametrize("n", [1, 2, 3, 5, 16])
def test_period_of_a_subharmonic_orbit(n):
    assert period(*orbit(n), SAMPLES) == n


def test_periods_beyond_sixteen_are_not_sought():
    assert period(*orbit(17, revolutions=51), SAMPLES) == 0


@pytest.mark.parametrize(("amount", "expected"), [(0.004, 1), (0.02, 2)])
def test_difference_of_a_hundredth_of_the_orbit_distinguishes_two_revolutions(amount, expected):
    """Revolutions of a half-order part a differ by 2 a everywhere: 0.008 and 0.04 of the orbit's size."""
    assert period(*orbit(2, amount=amount), SAMPLES) == expected


def test_period_two_that_comes_back_to_one_point():
    """The stroboscopic point repeats every revolution; the orbit in between does not."""
    turn = angles(20)
    vertical = np.cos(turn) + 0.1 * np.sin(turn / 2)
    horizontal = np.sin(turn)
    assert np.ptp(vertical[::SAMPLES]) < 1e-12
    assert period(vertical, horizontal, SAMPLES) == 2


def test_two_orders_without_common_period_have_none():
    turn = angles(40)
    whirl = np.exp(1j * turn) + 0.2 * np.exp(1j * turn * (math.sqrt(5) - 1) / 2)
    assert period(whirl.real, whirl.imag, SAMPLES) == 0


def test_chaotic_amplitudes_have_no_period():
    """An orbit whose size follows the logistic map."""
    size = [0.3]
    for _ in range(39):
        size.append(4 * size[-1] * (1 - size[-1]))
    growth = 1 + 0.2 * np.repeat(size, SAMPLES)
    turn = angles(40)
    assert period(growth * np.cos(turn), growth * np.sin(turn), SAMPLES) == 0


def test_orbit_off_centre_is_measured_by_its_own_size():
    """A half order part of 0.1 um on an orbit of 1 um, 1 mm off the centre."""
    vertical, horizontal = orbit(2)
    assert period(1e-3 + 1e-6 * vertical, 1e-6 * horizontal - 5e-4, SAMPLES) == 2


def test_short_record_shows_only_short_periods():
    assert period(*orbit(2, revolutions=3), SAMPLES) == 2
    assert period(*orbit(5, revolutions=4), SAMPLES) == 0
    assert period(*orbit(1, revolutions=1), SAMPLES) == 0  # nothing to compare with


@pytest.mark.parametrize("spin", [120.0, -120.0])
@pytest.mark.parametrize(
    ("forward", "backward"), [(1.0, 0.0), (0.0, 1.0), (3.0, 1.0), (1.0, 3.0), (1.0, 1.0)]
)
def test_whirl_has_the_sense_of_the_larger_circle(forward, backward, spin):
    """Other orders do not count, and forward is the sense of the spin, whichever that is."""
    turn = math.copysign(1.0, spin) * angles(6)
    whirl = forward * np.exp(1j * (turn + 0.7)) + backward * np.exp(-1j * (turn - 0.2))
    whirl += 4 * np.exp(-2j * turn) + 5 * np.exp(-0.5j * turn) + 6
    expected = (forward - backward) / (forward + backward)
    assert whirl_ratio(whirl.real, whirl.imag, SAMPLES, spin) == pytest.approx(expected, abs=1e-12)


def test_no_motion_has_no_whirl():
    assert math.isnan(whirl_ratio(np.zeros(2 * SAMPLES), np.zeros(2 * SAMPLES), SAMPLES, 1.0))
