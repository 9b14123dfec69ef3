"""Rings of stators: synchronous full annular rub in closed form, and the backward whirl of dry friction.

H. F. Black, J. Mech. Eng. Sci. 10 (1968) 1-12, balances unbalance, the rotor's receptance and the force of
a ring that the rotor touches all around. Here the ring is of many springs, of which the rotor presses those
under an arc that goes round with it; docs/theory.md has the derivation.
"""

import cmath
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from rubhpc import read_rig, simulate
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import steady_response
from rubhpc.schema import DIVERGED, DONE

PACKAGED = read_rig("mokhtar2017")
DISC, RADIUS = 8, 0.06
MODULUS, DENSITY = 12e9, 4600.0  # of all stators together: they share the same stiffness and mass
RUB = {"speed_ratio": 1.5, "clearance_ratio": 0.8, "transient": 80, "revolutions": 2}


def ring(count):
    one = PACKAGED.stator[0]
    return replace(
        PACKAGED,
        stator=(replace(one, count=count, youngs_modulus=MODULUS / count, density=DENSITY / count),),
    )


def balance(rig, spin, clearance, friction):
    """Orbit radius, m, and sum of the normal forces, N, of a ring without gaps.

    In the frame that turns with the spin the orbit stands still. A stator at the angle psi ahead of the line
    of the deflection r is pressed in by r cos(psi) - g from where the rim meets it, and until its force ends.
    """
    model = assemble(rig)
    rotor, stator = model.rotor, model.stators[0]
    free = steady_response(model, spin)[rotor.index(DISC, "v")]
    force = np.zeros(rotor.n_dof, dtype=complex)
    force[[rotor.index(DISC, "v"), rotor.index(DISC, "w")]] = 1.0, -1j  # a force that turns with the spin
    dynamic = rotor.stiffness - spin**2 * rotor.mass + 1j * spin * (rotor.damping + spin * rotor.gyroscopic)
    receptance = np.linalg.solve(dynamic, force)[rotor.index(DISC, "v")]
    tip = np.arange(stator.body.n_dof) == stator.axial
    K, M, D = stator.body.stiffness, stator.body.mass, stator.body.damping
    static = 1 / (tip @ np.linalg.solve(K, tip))
    moving = 1 / (tip @ np.linalg.solve(K - spin**2 * M + 1j * spin * D, tip))

    def pressed(radius):
        def normal(psi):
            turning = moving.real * math.cos(psi) + moving.imag * math.sin(psi)
            return radius * turning - static * clearance

        front = math.acos(clearance / radius)
        rear = brentq(normal, -1.5 * front, 0.0)
        parts = [quad(lambda psi, f=f: normal(psi) * f(psi), rear, front)[0] for f in (math.cos, math.sin)]
        density = len(model.stators) / (2 * math.pi)
        return density * complex(*parts), density * quad(normal, rear, front)[0]

    def excess(radius):
        return abs(radius + receptance * (1 + 1j * friction) * pressed(radius)[0]) - abs(free)

    radius = brentq(excess, 1.01 * clearance, 3 * abs(free))
    return SimpleNamespace(radius=radius, normal=pressed(radius)[1])


def test_denser_rings_come_to_the_closed_form():
    friction, error = 0.05, {}
    for count in (4, 8, 16):
        record = simulate(ring(count), friction=friction, **RUB)
        assert record.status == DONE
        assert record.period == 1
        known = balance(ring(count), record.spin_speed, record.clearance, friction)
        radius = np.hypot(record.vertical, record.horizontal)
        error[count] = abs(radius.mean() / known.radius - 1)
        normal = record.contact_force.sum(axis=0).mean()
        assert record.torsion.mean() == pytest.approx(-friction * RADIUS * normal / 3125.88, rel=1e-4)
    assert 0.01 < error[4] < 0.1
    assert error[8] < 1e-3
    assert error[16] < 1e-5
    assert np.ptp(radius) < 5e-4 * known.radius  # 16 stators: the orbit is a circle
    assert normal == pytest.approx(known.normal, rel=1e-4)
    assert np.diff(np.unwrap(np.angle(record.vertical + 1j * record.horizontal))).min() > 0  # forward


def test_softer_ring_is_all_but_quasi_static():
    """Tips that swing on after the rim has left are not at rest when it comes again: 1e-4 here."""
    rig = ring(8)
    soft = replace(rig, stator=tuple(replace(s, youngs_modulus=1e9 / 8) for s in rig.stator))
    record = simulate(soft, friction=0.05, **RUB)
    known = balance(soft, record.spin_speed, record.clearance, 0.05)
    assert np.hypot(record.vertical, record.horizontal).mean() == pytest.approx(known.radius, rel=3e-4)


@pytest.mark.parametrize("count", [3, 8])
def test_dry_friction_whirls_backward_without_bound(count):
    """Steady sliding drives backward whirl: the friction of a ring turns with the rim, whatever the slip."""
    record = simulate(ring(count), friction=0.3, **RUB)
    assert record.status == DIVERGED
    assert "displacement" in record.reason
    quiet = RUB | {"transient": 0, "clearance_ratio": 0.8}
    early = simulate(ring(8), friction=0.3, **(quiet | {"revolutions": 4}))
    orbit = early.vertical + 1j * early.horizontal
    whirl = np.unwrap(np.angle(orbit)).reshape(4, -1)
    turns = np.diff(whirl[:, [0, -1]], axis=1).ravel() / (2 * math.pi)
    assert turns[1] > 0.9  # forward, with the unbalance
    assert turns[3] < -1.0  # backward
    assert (
        early.minimum_slip_speed.min() < 0 < simulate(ring(8), friction=0.05, **RUB).minimum_slip_speed.min()
    )


def test_ring_has_no_preferred_direction():
    """Turned by a stator's spacing, with the unbalance, the case is the same one."""
    spacing = 2 * math.pi / 8
    plain = simulate(ring(8), friction=0.05, **RUB)
    key = {"rotor.unbalance.phase": spacing}
    turned = simulate(ring(8), friction=0.05, overrides=key, **RUB)
    orbit = (plain.vertical + 1j * plain.horizontal) * cmath.exp(1j * spacing)
    assert abs(turned.vertical + 1j * turned.horizontal - orbit).max() < 1e-6 * abs(orbit).max()
    assert turned.peak_contact_force == pytest.approx(np.roll(plain.peak_contact_force, 1), rel=1e-5)
