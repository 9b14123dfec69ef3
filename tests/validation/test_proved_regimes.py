"""Regimes of the packaged rig that a tolerance of 1 % gets wrong, and what a solution makes of them."""

import math

import pytest

from rubhpc import periodic, simulate
from rubhpc.schema import REGIME

STIFF = {"overrides": {"stator.youngs_modulus": "30 GPa"}, "keep": ()}


def test_chaos_within_a_hundredth_of_the_orbit_is_chaos():
    """Its cycles repeat themselves within 1 % after 4 revolutions; neighbours part by 0.14 a revolution."""
    record = simulate("mokhtar2017", speed_ratio=0.9, clearance_ratio=0.7, friction=0.3, **STIFF)
    assert REGIME[record.regime] == "chaotic"
    assert record.period == 0
    assert record.lyapunov_exponent > 0.05
    assert math.isnan(record.largest_multiplier)


@pytest.mark.parametrize(
    ("ratio", "clearance_ratio", "friction", "period"),
    [(4.8, 0.7, 0.1, 3), (2.1, 0.9, 0.3, 1), (4.2, 0.6, 0.1, 2)],
)
def test_slow_decay_does_not_make_the_period_longer(ratio, clearance_ratio, friction, period):
    """Of a motion that still settles some later cycle is the nearest: 12, 2 and 10 revolutions."""
    case = {"speed_ratio": ratio, "clearance_ratio": clearance_ratio, "friction": friction} | STIFF
    record = simulate("mokhtar2017", **case)
    assert REGIME[record.regime] == "periodic"
    assert record.period == period
    solution = periodic("mokhtar2017", initial=record.final, period=period, **case)
    assert solution.period == period
    assert record.largest_multiplier == pytest.approx(abs(solution.multipliers[0]), rel=1e-5)
    assert 0.9 < record.largest_multiplier < 1.0
