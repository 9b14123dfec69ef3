"""Stators on a carrier: conservation laws, limits with a known result, and a model derived another way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate

from rubhpc import Carrier, LumpedStator, MatrixStator, Rig, assemble
from rubhpc.errors import InputError
from rubhpc.fem.annular import annular_rub
from rubhpc.fem.modes import modes
from rubhpc.integrate.measuring.monitors import tip_deflection
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator

BASE = read_rig("mokhtar2017")
MASS, STIFFNESS, INERTIA, TORSIONAL = 2.0, 5e5, 0.02, 2e4
CASE = {"speed_ratio": 0.75, "clearance": "90 um", "friction": 0.2, "transient": 0, "revolutions": 2}


def ring(count: int = 8, **changes: float) -> Rig:
    """The packaged rig with a ring of its stators on one carrier."""
    settings = {"mass": MASS, "stiffness": STIFFNESS, "inertia": INERTIA, "torsional_stiffness": TORSIONAL}
    stator = replace(BASE.stator[0], count=count, carrier="casing")
    return replace(BASE, stator=(stator,), carrier=(Carrier(name="casing", **(settings | changes)),))


def test_stators_moved_with_their_carrier_are_not_strained_and_have_all_their_mass():
    rig = ring()
    (carrier,) = assemble(rig).carriers
    body, n = carrier.body, 3
    stator = rig.stator[0]
    mass = stator.density * stator.length * stator.width * stator.height
    for motion in np.eye(n):
        v, w, turn = motion
        moved = [*motion]
        for each in rig.stator:
            c, s = math.cos(each.angle), math.sin(each.angle)
            for node in range(1, each.elements + 1):
                distance = 0.06 + each.length * (1 - node / each.elements)
                moved += [c * v + s * w, c * w - s * v + distance * turn, -turn]
        moved = np.array(moved)
        own = np.diag([STIFFNESS, STIFFNESS, TORSIONAL]) @ motion
        pressed = body.stiffness @ moved
        np.testing.assert_allclose(pressed[:n], own, atol=1e-4)
        assert abs(pressed[n:]).max() < 1e-12 * abs(body.stiffness).max()
        if turn == 0.0:
            assert moved @ body.mass @ moved == pytest.approx(MASS + 8 * mass, rel=1e-12)
        else:  # of rods that lie along the radius, and of their slices about the axis of the shaft
            rods = 8 * mass * ((0.06 + 0.02) ** 2 + (stator.length**2 + stator.height**2) / 12)
            assert moved @ body.mass @ moved == pytest.approx(INERTIA + rods, rel=1e-12)


def test_a_soft_carrier_is_a_mass_on_springs():
    (carrier,) = assemble(ring(stiffness=5e3, torsional_stiffness=2e2)).carriers
    first, second, third = modes(carrier.body)[:3]
    total = MASS + 8 * 1157.0 * 25e-6 * 0.04
    assert first.frequency == pytest.approx(math.sqrt(5e3 / total) / (2 * math.pi), rel=1e-4)
    assert second.frequency == pytest.approx(first.frequency, rel=1e-9)
    assert third.kind == "torsional"
    assert {mode.whirl for mode in modes(carrier.body)} == {"none"}


def test_a_stiff_carrier_is_the_ground():
    case = CASE | {"accuracy": 1e-5}  # by default both are right to 1e-3 only, with unlike modes
    ground = simulate(replace(BASE, stator=(replace(BASE.stator[0], count=8),)), **case)
    held = simulate(ring(stiffness=1e14, torsional_stiffness=1e12), **case)
    assert ground.contact_force.max() > 1.0
    scale = abs(ground.vertical).max()
    np.testing.assert_allclose(held.vertical, ground.vertical, atol=1e-6 * scale)
    np.testing.assert_allclose(held.horizontal, ground.horizontal, atol=1e-6 * scale)
    expected = 1e-14 * ground.peak_contact_force.max()  # N over N/m; two neighbours at most
    assert held.carrier_displacement.max() < 2 * expected
    assert not ground.carrier_displacement.any()


@pytest.mark.parametrize(
    "law",
    [
        {},
        {"friction_law": "coulomb"},
        {"restitution": 0.5},
        {"law": "penalty", "stiffness": 1e7},
        pytest.param({"normal": "updated"}, marks=pytest.mark.long),
    ],
    ids=str,
)
def test_the_modal_scheme_agrees_with_the_central_difference(law):
    """Eight pairs on one soft body; both schemes go their own way to the forces of contact."""
    rig = ring(count=8, damping=50.0)
    short = CASE | {"revolutions": 1} | law
    modal = simulate(rig, **short, accuracy=1e-5)
    stepped = simulate(rig, **short, method="central-difference", step="1 us")
    scale = abs(modal.vertical).max()
    assert modal.peak_contact_force.max() > 1.0
    assert modal.energy_residual < 1e-7
    np.testing.assert_allclose(stepped.vertical, modal.vertical, atol=5e-5 * scale)
    np.testing.assert_allclose(stepped.horizontal, modal.horizontal, atol=5e-5 * scale)
    np.testing.assert_allclose(stepped.carrier_displacement, modal.carrier_displacement, rtol=1e-4)
    largest = modal.tip_deflection_ratio.max()
    np.testing.assert_allclose(
        stepped.tip_deflection_ratio, modal.tip_deflection_ratio, rtol=0, atol=1e-3 * largest
    )


@pytest.mark.parametrize("method", ["modal", "central-difference"])
def test_a_stator_that_its_carrier_moves_is_not_bent(method):
    """A casing of 20 g on soft springs shifts and turns under a rub much more than its stators bend."""
    soft = {"mass": 0.02, "stiffness": 2e3, "inertia": 1e-4, "torsional_stiffness": 10.0, "damping": 5.0}
    stiff = replace(BASE.stator[0], count=4, carrier="casing", youngs_modulus=2e11)
    rig = replace(ring(**soft), stator=(stiff,))
    record = simulate(rig, **(CASE | {"revolutions": 1}), method=method)
    moved, bent = abs(record.stator_lateral).max(axis=1), stiff.length * record.tip_deflection_ratio
    assert moved.min() > 1e-5
    assert bent.max() < 0.05 * moved.min()


def test_the_rotation_of_a_carrier_that_does_not_turn_keeps_no_case_from_settling():
    """Without friction it is rounding, which never repeats."""
    case = CASE | {"friction": 0.0, "clearance": "95 um", "transient": "auto"}
    record = simulate(ring(damping=200.0), **case)
    assert record.peak_contact_force.max() > 1.0
    assert record.transient_revolutions < 240


def test_deflection_is_what_is_left_of_the_carrier_s_motion():
    """Any motion of the carrier, carried to the tips without strain, and a known one of each tip."""
    model = assemble(ring())
    carrier, q = model.carriers[0], len(model.stators)
    rng = np.random.default_rng(1)
    motion, own = rng.normal(size=(3, 5)), rng.normal(size=(q, 5))
    samples = empty_samples(model.n_place, 5)
    samples.axial[q], samples.lateral[q], samples.lateral[q + 1] = motion
    still = np.linalg.solve(carrier.body.stiffness[3:, 3:], -carrier.body.stiffness[3:, :3])  # unstrained
    for i, stator in enumerate(model.stators):
        samples.lateral[i] = own[i] + still[stator.lateral - 3] @ motion
    accumulator = new_accumulator(q, model.n_place)
    np.testing.assert_allclose(tip_deflection(samples, accumulator, model), abs(own).max(axis=1), rtol=1e-9)


def test_the_ground_bears_the_mean_contact_force_through_the_carrier():
    """Over whole periods momentum does not change, so that the means of all forces balance."""
    probes = [
        {"name": name, "stator": 1, "angle": angle, "quantity": "foundation_force"}
        for name, angle in (("up", 0.0), ("aside", math.pi / 2))
    ]
    case = CASE | {"clearance": "95 um", "transient": 200, "revolutions": 4, "probes": probes}
    record = simulate(ring(1, damping=200.0), **case)
    mean = record.contact_force.mean()
    pushed = mean * (1 + 0.2j)  # along the normal, and the way of the rim
    borne = record.signals["probe_up"].mean() + 1j * record.signals["probe_aside"].mean()
    assert mean > 0.2
    assert borne == pytest.approx(pushed, abs=2e-3 * abs(pushed))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"carrier": "cassing"}, "no carrier is named cassing; did you mean casing"),
        ({"lateral": False}, "lateral = false"),
        (None, "no stator stands on it"),
    ],
)
def test_what_cannot_stand_on_a_carrier_is_refused(change, problem):
    rig = ring()
    stator = BASE.stator[0] if change is None else replace(rig.stator[0], **change)
    others = () if change is None else (replace(rig.stator[0], angle=3.0),)
    with pytest.raises(InputError, match=problem):
        replace(rig, stator=(stator, *others))


@pytest.mark.parametrize(
    "stator",
    [
        LumpedStator(node=8, rigid=True, carrier="casing"),
        LumpedStator(node=8, mass=1e-3, stiffness=1e6, carrier="casing"),
        MatrixStator(node=8, mass=np.eye(1), stiffness=np.eye(1), carrier="casing"),
    ],
    ids=["wall", "radial", "matrices"],
)
def test_kinds_that_cannot_follow_are_refused(stator):
    with pytest.raises(InputError, match=r"stator.1.carrier"):
        replace(ring(), stator=(stator,))


def test_a_carrier_that_turns_needs_both_values():
    with pytest.raises(InputError, match="torsional_stiffness: missing"):
        Carrier(name="casing", mass=1.0, stiffness=1e6, inertia=0.1)


def test_the_closed_form_of_annular_rub_refuses_a_carrier():
    with pytest.raises(InputError, match="remove the carrier"):
        annular_rub(assemble(ring()), 100.0, 1e-4, 0.1)
