"""Rayleigh coefficients from ratios: the ratios that they give back."""

import math

import numpy as np
import pytest

from rubhpc.fem.beam import rayleigh_coefficients
from rubhpc.rig.parts import Damping


def ratio(coefficients, frequency):
    alpha, beta = coefficients
    omega = 2 * math.pi * frequency
    return alpha / (2 * omega) + beta * omega / 2


def test_one_ratio_is_met_by_the_mass_alone():
    alpha, beta = rayleigh_coefficients(Damping(ratios=((31.56, 0.08),)))
    assert beta == 0.0
    assert alpha == pytest.approx(31.73, abs=0.005)


@pytest.mark.parametrize("wanted", [((20.0, 0.02), (300.0, 0.05)), ((5.0, 0.01), (8000.0, 0.01))])
def test_two_ratios_are_met_exactly(wanted):
    coefficients = rayleigh_coefficients(Damping(ratios=wanted))
    assert min(coefficients) >= 0.0
    for frequency, expected in wanted:
        assert ratio(coefficients, frequency) == pytest.approx(expected, rel=1e-9)


def test_ratios_that_fall_too_fast_do_not_drive_high_modes():
    # met exactly they would ask for beta = -4.8e-7 s, and a mode at 62 kHz would grow at 9 % of critical
    coefficients = rayleigh_coefficients(Damping(ratios=((31.56, 0.09), (128.05, 0.022))))
    assert coefficients[1] == 0.0
    assert ratio(coefficients, 31.56) == pytest.approx(0.09, rel=0.01)
    assert ratio(coefficients, 128.05) == pytest.approx(0.022, rel=0.01)


def test_more_ratios_are_met_in_the_least_squares():
    wanted = ((10.0, 0.05), (50.0, 0.02), (200.0, 0.03), (800.0, 0.09))
    coefficients = np.array(rayleigh_coefficients(Damping(ratios=wanted)))

    def misfit(trial):
        return sum((ratio(trial, frequency) - expected) ** 2 for frequency, expected in wanted)

    for factor in (0.99, 1.01):
        assert misfit(coefficients * [factor, 1]) > misfit(coefficients)
        assert misfit(coefficients * [1, factor]) > misfit(coefficients)
