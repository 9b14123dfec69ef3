"""Regimes of the packaged rig that a tolerance of 1 % gets wrong, and what a solution makes of them."""

import math

import pytest
from closed_form import periodic, read_rig, simulate

from rubhpc.rig.reading import with_keys
from rubhpc.schema import DONE, REGIME

STIFF = {"overrides": {"stator.youngs_modulus": "30 GPa"}, "keep": ()}
OVERHUNG = with_keys(
    read_rig("mokhtar2017"),
    {
        "rotor.bearing.2.node": 9,
        "rotor.disc.1.node": 13,
        "rotor.unbalance.1.node": 13,
        "stator.node": 13,
        "rotor.damping.alpha": 2.41,
    },
)


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


@pytest.mark.parametrize(
    ("rig", "case", "modulus", "lasts"),
    [
        ("mokhtar2017", {"speed_ratio": 2.25, "clearance_ratio": 0.95}, "3 GPa", True),
        ("mokhtar2017", {"speed_ratio": 2.3, "clearance_ratio": 0.8}, "3 GPa", True),
        (OVERHUNG, {"speed_ratio": 3.253, "clearance_ratio": 0.6224, "friction": 0.4333}, "30 GPa", False),
    ],
    ids=["chaos", "other chaos", "diverges"],
)
def test_chaos_has_settled_where_it_lasts(rig, case, modulus, lasts):
    """In 2000 later revolutions, by which rounding has made another motion of it."""
    case = case | {"overrides": {"stator.youngs_modulus": modulus}, "keep": ()}
    record = simulate(rig, **case)
    assert (REGIME[record.regime], record.settled) == ("chaotic", int(lasts))
    later = simulate(rig, **case, transient=2000, initial=record.final)
    assert (later.status == DONE and REGIME[later.regime] == "chaotic") == lasts
