"""Rings of stators: synchronous full annular rub in closed form, and the backward whirl of dry friction.

H. F. Black, J. Mech. Eng. Sci. 10 (1968) 1-12, balances unbalance, the rotor's receptance and the force of
a ring that the rotor touches all around. Here the ring is of many springs, of which the rotor presses those
under an arc that goes round with it; docs/theory/annular.md has the derivation.
"""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate

from rubhpc import InputError, LumpedStator, assemble
from rubhpc.fem.annular import annular_rub
from rubhpc.schema import DIVERGED, DONE

PACKAGED = read_rig("mokhtar2017")
RADIUS = 0.06
MODULUS, DENSITY = 12e9, 4600.0  # of all stators together: they share the same stiffness and mass
RUB = {"speed_ratio": 1.5, "clearance_ratio": 0.8, "transient": 80, "revolutions": 2}


def ring(count):
    one = PACKAGED.stator[0]
    return replace(
        PACKAGED,
        stator=(replace(one, count=count, youngs_modulus=MODULUS / count, density=DENSITY / count),),
    )


def test_denser_rings_come_to_the_closed_form():
    friction, error = 0.05, {}
    for count in (4, 8, 16):
        record = simulate(ring(count), friction=friction, **RUB)
        assert record.status == DONE
        assert record.period == 1
        known = annular_rub(assemble(ring(count)), record.spin_speed, record.clearance, friction)
        radius = np.hypot(record.vertical, record.horizontal)
        error[count] = abs(radius.mean() / known.radius - 1)
        normal = record.contact_force.sum(axis=0).mean()
        assert record.torsion.mean() == pytest.approx(-friction * RADIUS * normal / 3125.88, rel=1e-4)
    assert 0.01 < error[4] < 0.1
    assert error[8] < 1e-3
    # 2.13e-5 and 5.4e-4, with 1e-4 for an accuracy too: what is left is of the 16 springs, not of the modes.
    assert error[16] < 3e-5
    assert np.ptp(radius) < 6e-4 * known.radius  # the orbit is a circle
    assert normal == pytest.approx(known.normal_force, rel=1e-4)
    orbit = record.vertical + 1j * record.horizontal
    assert np.diff(np.unwrap(np.angle(orbit))).min() > 0  # forward
    shaft = np.exp(2j * math.pi * np.arange(orbit.size) / 256)
    assert np.angle(orbit / shaft).mean() == pytest.approx(known.phase, abs=1e-4)
    contact = np.mean(record.contact_fraction) * 2 * math.pi
    assert contact == pytest.approx(known.arc[1] - known.arc[0], rel=1e-3)


def test_reversed_spin_mirrors_the_closed_form():
    model = assemble(ring(8))
    one, other = (annular_rub(model, spin, 150e-6, 0.1) for spin in (300.0, -300.0))
    assert (other.radius, other.normal_force) == pytest.approx((one.radius, one.normal_force), rel=1e-12)
    assert other.phase == pytest.approx(-one.phase, rel=1e-12)


def test_springs_without_mass_or_damping_meet_the_formula_of_the_arc():
    """Over the half arc a, cos a = g / r, the forces of Winkler's foundation: n k (r sin a - g a) / pi."""
    count, stiffness, spin, clearance = 20, 1e5, 300.0, 140e-6
    springs = LumpedStator(node=8, radius=RADIUS, count=count, mass=1e-12, stiffness=stiffness)
    model = assemble(replace(PACKAGED, stator=(springs,)))
    found = annular_rub(model, spin, clearance, 0.0)
    half = math.acos(clearance / found.radius)
    assert found.arc == pytest.approx((-half, half), rel=1e-6)
    around = count * stiffness / math.pi * (found.radius * math.sin(half) - clearance * half)
    assert found.normal_force == pytest.approx(around, rel=1e-6)


def test_ring_out_of_reach_is_refused():
    with pytest.raises(InputError, match="does not reach a clearance"):
        annular_rub(assemble(ring(8)), 300.0, 1e-3, 0.1)


def test_softer_ring_is_all_but_quasi_static():
    """Tips that swing on after the rim has left are not at rest when it comes again: 1e-4 here."""
    rig = ring(8)
    soft = replace(rig, stator=tuple(replace(s, youngs_modulus=1e9 / 8) for s in rig.stator))
    record = simulate(soft, friction=0.05, **RUB)
    known = annular_rub(assemble(soft), record.spin_speed, record.clearance, 0.05)
    assert np.hypot(record.vertical, record.horizontal).mean() == pytest.approx(known.radius, rel=3e-4)


@pytest.mark.parametrize("count", [3, 8])
def test_dry_friction_whirls_backward_without_bound(count):
    """Steady sliding drives backward whirl: the friction of a ring turns with the rim, whatever the slip."""
    record = simulate(ring(count), friction=0.3, **RUB)
    assert record.status == DIVERGED
    assert "displacement" in record.reason


def test_dry_whirl_begins_forward_and_turns_round():
    early = simulate(ring(8), friction=0.3, **(RUB | {"transient": 0, "revolutions": 4}))
    orbit = early.vertical + 1j * early.horizontal
    whirl = np.unwrap(np.angle(orbit)).reshape(4, -1)
    turns = np.diff(whirl[:, [0, -1]], axis=1).ravel() / (2 * math.pi)
    assert turns[1] > 0.9  # forward, with the unbalance
    assert turns[3] < -1.0  # backward
    assert early.minimum_slip_speed.min() < 0  # steady sliding is wrong there, and says so
    assert simulate(ring(8), friction=0.05, **RUB).minimum_slip_speed.min() > 0


def test_ring_has_no_preferred_direction():
    """Turned by a stator's spacing, with the unbalance, the case is the same one."""
    spacing = 2 * math.pi / 8
    plain = simulate(ring(8), friction=0.05, **RUB)
    key = {"rotor.unbalance.phase": spacing}
    turned = simulate(ring(8), friction=0.05, overrides=key, **RUB)
    orbit = (plain.vertical + 1j * plain.horizontal) * cmath.exp(1j * spacing)
    assert abs(turned.vertical + 1j * turned.horizontal - orbit).max() < 1e-6 * abs(orbit).max()
    assert turned.peak_contact_force == pytest.approx(np.roll(plain.peak_contact_force, 1), rel=1e-5)
