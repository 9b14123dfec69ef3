"""Amplification factor and separation margin: the Jeffcott rotor in closed form, the formulas of API 617."""

import math

import numpy as np
import pytest

from rubhpc import Rig, Unbalance, assemble
from rubhpc.fem.critical_speeds import find_critical_speeds
from rubhpc.fem.separation_margin import (
    ResponsePeak,
    amplitude_over_speed,
    grid_through,
    response_peaks,
    unbalance_response,
)

OMEGA, ECCENTRICITY = 100.0, 1e-5


def jeffcott(ratio, mass=3.0):
    """A disc on a massless shaft, in both planes; the unbalance is `ECCENTRICITY` times the mass."""
    plane = [(1, "v"), (1, "w")]
    return assemble(
        Rig.from_matrices(
            np.eye(2) * mass,
            np.eye(2) * 2 * ratio * OMEGA * mass,
            np.eye(2) * OMEGA**2 * mass,
            degrees=plane,
            unbalance=[Unbalance(node=1, mass=mass, radius=ECCENTRICITY)],
        )
    )


def peaks_of(model, low=1.0, high=400.0):
    critical = find_critical_speeds(model, np.linspace(low, high, 21))
    return response_peaks(amplitude_over_speed(model, 1), grid_through(low, high, critical))


@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 0.02, 0.1, 0.3])
def test_jeffcott_rotor_in_closed_form(ratio):
    """|u| = e r^2 / sqrt((1 - r^2)^2 + 4 z^2 r^2), in x = 1 / r^2: x^2 - 2 (1 - 2 z^2) x + 1 at its least.

    The peak is at x = 1 - 2 z^2, e / (2 z sqrt(1 - z^2)) high, and half as much power is at
    x = 1 - 2 z^2 -+ 2 z sqrt(1 - z^2).
    """
    (peak,) = peaks_of(jeffcott(ratio))
    middle, half = 1 - 2 * ratio**2, 2 * ratio * math.sqrt(1 - ratio**2)
    assert peak.speed == pytest.approx(OMEGA / math.sqrt(middle), rel=max(1e-8, 1e-4 * ratio))
    assert peak.amplitude == pytest.approx(ECCENTRICITY / half, rel=1e-8)
    below = OMEGA / math.sqrt(middle + half)
    assert peak.half_power_speeds[0] == pytest.approx(below, rel=1e-9)
    if middle - half > (OMEGA / 400.0) ** 2:
        above = OMEGA / math.sqrt(middle - half)
        assert peak.half_power_speeds[1] == pytest.approx(above, rel=1e-9)
        assert peak.amplification_factor == pytest.approx(peak.speed / (above - below), rel=1e-6)


def test_phase_lags_a_quarter_at_the_natural_frequency():
    """tan(lag) = 2 z r / (1 - r^2); w follows v by a quarter turn."""
    ratio, r = 0.05, np.array([0.1, 0.5, 1.0, 2.0, 3.9])
    found = unbalance_response(jeffcott(ratio), r * OMEGA)
    lag = np.arctan2(2 * ratio * r, 1 - r**2)
    assert found.phase.sel(node=1).values[:, 0] == pytest.approx(-lag)
    assert found.phase.sel(node=1).values[:, 1] == pytest.approx(-lag - math.pi / 2)
    size = ECCENTRICITY * r**2 / np.hypot(1 - r**2, 2 * ratio * r)
    for name in ("major_axis", "minor_axis"):  # a circle, forward
        assert found[name].sel(node=1).values == pytest.approx(size)
    assert found.amplitude.sel(node=1).values == pytest.approx(np.stack([size, size], axis=1))


def test_unlike_planes_have_an_elliptic_orbit():
    """Between its two critical speeds an undamped rotor of unlike stiffness whirls backward."""
    model = assemble(
        Rig.from_matrices(
            np.eye(2),
            None,
            np.diag([1.0, 4.0]),
            degrees=[(1, "v"), (1, "w")],
            unbalance=[Unbalance(node=1, mass=1.0, radius=1.0)],
        )
    )
    speeds = np.array([0.5, 1.5, 3.0])
    found = unbalance_response(model, speeds).sel(node=1)
    v, w = speeds**2 / (1.0 - speeds**2), speeds**2 / (4.0 - speeds**2)
    assert found.major_axis.values == pytest.approx(np.maximum(abs(v), abs(w)))
    assert found.minor_axis.values == pytest.approx(np.minimum(abs(v), abs(w)) * np.sign(v * w))


def peak(speed, factor):
    half = speed / factor / 2
    return ResponsePeak(speed=speed, amplitude=1e-5, half_power_speeds=(speed - half, speed + half))


@pytest.mark.parametrize(
    ("factor", "below", "above"),
    [
        (2.49, 0.0, 0.0),
        (2.51, 0.17 * (1 - 1 / 1.01), 0.10 + 0.17 * (1 - 1 / 1.01)),
        (5.0, 0.17 * (1 - 1 / 3.5), 0.10 + 0.17 * (1 - 1 / 3.5)),
        (10.0, 0.15, 0.25),
        (40.0, 0.16, 0.26),  # the formula would ask for 0.1656
    ],
)
def test_required_margin(factor, below, above):
    """Table of API 617: 17 (1 - 1 / (AF - 1.5)), at most 16 percent; 10 percent more above."""
    operating = (300.0, 400.0)
    assert peak(200.0, factor).required_margin(operating) == pytest.approx(below)
    assert peak(500.0, factor).required_margin(operating) == pytest.approx(above)


def test_separation_margin_counts_from_the_nearer_end():
    operating = (300.0, 400.0)
    assert peak(255.0, 10.0).separation_margin(operating) == pytest.approx(0.15)
    assert peak(255.1, 10.0).is_separated(operating) is False
    assert peak(254.9, 10.0).is_separated(operating) is True
    assert peak(520.0, 10.0).separation_margin(operating) == pytest.approx(0.3)
    assert peak(350.0, 10.0).separation_margin(operating) == 0.0
    assert peak(350.0, 10.0).is_separated(operating) is False
    assert peak(350.0, 2.0).is_separated(operating) is True  # critically damped


def test_a_peak_at_the_end_of_the_range_has_no_factor_and_asks_for_the_most():
    (found,) = peaks_of(jeffcott(0.1), low=90.0, high=104.0)
    assert math.isnan(found.amplification_factor)
    assert found.required_margin((150.0, 200.0)) == 0.16
    assert found.required_margin((50.0, 80.0)) == 0.26
