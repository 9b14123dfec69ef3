"""The error by modes left out: what is asked for is met by other rigs than the packaged one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import simulate
from random_machines import random_machine
from random_rigs import PACKAGED, found_error, random_rig

from rubhpc.fem.assemble import assemble
from rubhpc.fem.probes import with_probes
from rubhpc.integrate.marches.collocation import CollocationMarch
from rubhpc.integrate.reduced_model import truncation
from rubhpc.integrate.reduced_model.truncation import (
    SMOOTH,
    Touch,
    at_standstill,
    bounce_spectrum,
    coupled_ringing,
    cutoff_frequency,
    impact_share,
    kept_modes,
    modal_error,
    modes_below,
    pulse_spectrum,
    static_inertia,
    struck_share,
    sufficient_accuracy,
    touch_of,
)
from rubhpc.kernels.laws import COULOMB, MULTIPLIER
from rubhpc.recent import forget
from rubhpc.rig.probes import Probe
from rubhpc.rig.reading import with_keys
from rubhpc.rig.stators import LumpedStator

ALL_MODES = 1e-15  # accuracy


def at_node_5(**keys):
    return replace(PACKAGED, stator=(replace(PACKAGED.stator[0], node=5, **keys),))


def at_shaft(mass):
    return replace(PACKAGED, stator=(LumpedStator(node=5, radius=0.01, mass=mass, stiffness=1e5),))


def lumped(mass, stiffness):
    return replace(PACKAGED, stator=(LumpedStator(node=8, mass=mass, stiffness=stiffness),))


def below(model, spin, accuracy=1e-3, touch=None):
    cutoff = cutoff_frequency(model, spin, accuracy)
    return [modes_below(part, cutoff) for part in at_standstill(model).parts]


def probed(probes):
    return with_probes(assemble(PACKAGED), PACKAGED, [Probe(**probe) for probe in probes], 220.0)


def choose(monkeypatch, kept):
    """Have modes chosen by another function."""
    monkeypatch.setattr("rubhpc.integrate.reduced_model.reduction.kept_modes", kept)
    forget()


def number(are_kept):
    return sum(np.count_nonzero(is_kept) for is_kept in are_kept)


@pytest.mark.parametrize(
    ("rig", "case", "before"),
    [
        # Friction on the shaft itself makes its twist ring: 36 % off with the modes below the cutoff alone.
        (at_node_5(radius=0.01, youngs_modulus=3e10), {"speed_ratio": 1.1, "clearance": "100 um"}, 0.3),
        # A heavy stator rebounds many times: 8 % off in six revolutions, 80 % in ten.
        (lumped(0.92, 3.9e5), {"speed_ratio": 1.9, "clearance": "70 um"}, 0.05),
        (at_node_5(radius=0.06), {"speed_ratio": 1.1, "clearance": "60 um"}, 5e-3),
        (lumped(0.05, 3.9e5), {"speed_ratio": 1.9, "clearance": "70 um"}, 3e-3),
    ],
)
def test_rigs_that_need_more_modes_get_them(rig, case, before, monkeypatch):
    case = case | {"transient": 0, "revolutions": 6}
    exact, record = simulate(rig, **case, accuracy=ALL_MODES), simulate(rig, **case)
    assert found_error(record, exact) < 1e-3
    assert exact.modal_error == 0.0
    assert record.modal_error < 1e-3
    assert record.remark == ""
    choose(monkeypatch, below)
    assert found_error(simulate(rig, **case), exact) > before


@pytest.mark.parametrize(
    ("keys", "case", "before"),
    [
        # Friction that sticks to the shaft beside the disc jumps and holds it: the twist rings at once.
        ({"node": 10, "youngs_modulus": 1e9}, {"friction_law": "coulomb", "speed_ratio": 1.2}, 2e-3),
    ],
    ids=["sticks"],
)
def test_contacts_that_feel_motion_along_the_rim_need_more_modes(keys, case, before, monkeypatch):
    rig = replace(PACKAGED, stator=(replace(PACKAGED.stator[0], radius=0.01, **keys),))
    case = case | {"clearance_ratio": 0.6, "friction": 0.4, "transient": 0, "revolutions": 4}
    case["overrides"] = {"rotor.damping.alpha": 10.0}
    begin = CollocationMarch.__init__

    def begin_finely(march, *given):
        begin(march, *given)
        march.accuracy = 1e-8  # of steps, so that modes alone make a difference

    monkeypatch.setattr(CollocationMarch, "__init__", begin_finely)
    exact, record = simulate(rig, **case, accuracy=1e-8), simulate(rig, **case)
    assert exact.modal_error == 0.0
    assert found_error(record, exact) < record.modal_error < 1e-3
    choose(monkeypatch, lambda model, spin, accuracy, touch: kept_modes(model, spin, accuracy))
    assert found_error(simulate(rig, **case), exact) > before


def test_tip_that_bounces_on_a_penalty_needs_the_modes_that_it_rings_with(monkeypatch):
    """A gram that rings with 1.8e5 rad/s on a disc, whose twist at node 11 has modes of that frequency."""
    rig, case = random_machine(113)
    case |= {"clearance_ratio": 0.7, "transient": 0, "revolutions": 4, "keep": ("waveform",)}

    def error(record):
        known, found = (of.signals["probe_acceleration_twist"] for of in (exact, record))
        return float(np.std(found - known) / np.std(known))

    exact, record = simulate(rig, **case, accuracy=1e-8), simulate(rig, **case)
    assert error(record) < record.modal_error < 1e-3
    choose(monkeypatch, lambda model, spin, accuracy, touch: kept_modes(model, spin, accuracy))
    assert error(simulate(rig, **case)) > 2e-3


@pytest.mark.parametrize("damper", [0.0, 2.0])
def test_bounce_is_the_response_of_a_mass_on_the_penaltys_spring_and_damper(damper):
    """Of 0.01 kg, beside 4 kg, on 1e6 N/m: above 1e4 rad/s as a complex stiffness says, below as its peak."""
    rotor, tip, frequency = np.array([0.5, 0.0, 0.0]), np.array([0.0, 8.0, 6.0]), np.array([2e4, 1e2, 5e5])
    touch = Touch(spring=1e6, damper=damper)
    found = bounce_spectrum(rotor, tip, frequency, np.array([0.0, 3.0, 3.0]), 100.0, touch)
    reduced, decay = 1.0 / 100.25, 3.0 * 100.0 / 100.25 + 100.0 / math.pi
    for w, of in ((2e4, found[0]), (5e5, found[2]), (math.sqrt(1e6 / reduced), found[1])):
        force = 1e6 + 1j * w * damper
        assert of == pytest.approx(abs(force / (force - reduced * w**2 + 2j * w * reduced * decay)))
    assert found[1] > 5.0
    assert np.all(bounce_spectrum(rotor, tip, frequency, np.zeros(3), 100.0, SMOOTH) == 1.0)


def test_estimate_knows_what_contacts_feel_along_the_rim():
    """Of the modes that suffice for steady sliding along a fixed normal."""
    model = assemble(at_node_5(radius=0.01, youngs_modulus=3e9))
    are_kept = kept_modes(model, 220.0, 1e-3)
    smooth, curved, sticky = (
        modal_error(model, 220.0, are_kept, touch)
        for touch in (SMOOTH, Touch(is_curved=True), Touch(may_stick=True))
    )
    assert smooth < 1e-3 < min(curved, sticky)
    for touch in (Touch(is_curved=True), Touch(may_stick=True)):
        assert modal_error(model, 220.0, kept_modes(model, 220.0, 1e-3, touch), touch) < 1e-3
    assert touch_of(model, MULTIPLIER, is_updated=False) == SMOOTH
    assert touch_of(model, MULTIPLIER._replace(friction_law=COULOMB), is_updated=True) == Touch(True, True)
    bent = assemble(at_node_5(radius=0.01, geometry="second_order"))
    assert touch_of(bent, MULTIPLIER, is_updated=False) == Touch(is_curved=True)
    soft = MULTIPLIER._replace(stiffness=1e7, damping=3.0)
    assert touch_of(model, soft, is_updated=False) == Touch(spring=1e7, damper=3.0)
    assert touch_of(model, MULTIPLIER._replace(restitution=0.5), is_updated=False) == Touch(bounces=True)


@pytest.mark.parametrize(
    ("modulus", "case", "n_more"),
    [
        (3e9, {"speed_ratio": 1.1, "clearance": "100 um"}, 0),
        (3e10, {"speed_ratio": 3.5, "clearance": "74 um"}, 3),
        (3e9, {"speed_ratio": 6.0, "clearance": "60 um"}, 0),
    ],
)
def test_packaged_rig_is_as_accurate_as_asked_with_few_modes_above_the_cutoff(modulus, case, n_more):
    """None at 3 GPa; three torsional ones on a stiff stator, for the torsional acceleration."""
    rig = with_keys(PACKAGED, {"stator.youngs_modulus": modulus})
    record = simulate(rig, **case, transient=0, revolutions=10)
    exact = simulate(rig, **case, transient=0, revolutions=10, accuracy=ALL_MODES)
    assert found_error(record, exact) < record.modal_error < 1e-3
    assert record.remark == ""
    model = assemble(rig)
    for spin in (120.0, 400.0, 1200.0):
        assert number(kept_modes(model, spin, 1e-3)) == number(below(model, spin)) + n_more


@pytest.mark.parametrize("seed", [0, 4, 11, 21, 25, 37])
def test_random_rigs_are_as_accurate_as_asked(seed):
    """Beams and masses on and off the disc; tests/validation/test_modal_accuracy.py has many more."""
    rig, case = random_rig(seed)
    record = simulate(rig, **case, transient=0, revolutions=4)
    exact = simulate(rig, **case, transient=0, revolutions=4, accuracy=ALL_MODES)
    assert np.sum(exact.contact_impulse) > 0.0
    assert found_error(record, exact) < 1e-3
    assert record.modal_error <= 1e-3


def test_probes_of_acceleration_are_as_accurate_as_asked():
    """That at a bearing was 30 % off with the modes that suffice for displacements."""
    case = {"speed_ratio": 1.1, "clearance": "60 um", "transient": 0, "revolutions": 4}
    probes = [
        {"name": "housing", "node": 15, "quantity": "acceleration"},
        {"name": "rate", "node": 4, "quantity": "twist_acceleration"},
        {"name": "force", "node": 1, "quantity": "bearing_force"},
    ]
    record = simulate(PACKAGED, **case, probes=probes)
    exact = simulate(PACKAGED, **case, probes=probes, accuracy=ALL_MODES)
    for probe in probes:
        name = f"probe_{probe['name']}"
        found, known = record.signals[name], exact.signals[name]
        assert np.std(found - known) < 1e-3 * np.std(known), name
    assert 0.0 <= record.modal_error <= 1e-3
    displacement = [{"name": "left", "node": 1}]
    few, many = (
        number(kept_modes(probed(those), record.spin_speed, 1e-3)) for those in (displacement, probes)
    )
    assert few < many


def test_more_modes_are_kept_as_more_is_asked():
    model = assemble(at_node_5(radius=0.01, youngs_modulus=3e10))
    kept = [kept_modes(model, 220.0, accuracy) for accuracy in (1e-2, 1e-3, 1e-4, 1e-5, ALL_MODES)]
    count = [number(are_kept) for are_kept in kept]
    assert count == sorted(count)
    assert count[0] < count[-1] == sum(part.frequency.size for part in at_standstill(model).parts)
    errors = [modal_error(model, 220.0, are_kept) for are_kept in kept]
    assert errors == sorted(errors, reverse=True)
    assert all(error <= asked for error, asked in zip(errors, (1e-2, 1e-3, 1e-4, 1e-5, 0.0), strict=True))


def test_modes_of_both_planes_are_kept_together():
    """A vertical mode rings, and gyroscopic terms carry its ring over to the horizontal one."""
    model = assemble(at_node_5(radius=0.01, youngs_modulus=3e9))
    planes = [part for part in at_standstill(model).parts if len(part.frequency) > 20]
    kept = [
        is_kept
        for part, is_kept in zip(at_standstill(model).parts, kept_modes(model, 400.0, 1e-3), strict=True)
        if len(part.frequency) > 20
    ]
    assert len(planes) == 2
    assert planes[0].frequency == pytest.approx(planes[1].frequency, rel=1e-9)
    low = planes[0].frequency < 0.3 * planes[0].frequency[-1]
    assert np.array_equal(kept[0][low], kept[1][low])


def test_number_of_modes_is_bounded_and_the_rest_is_reported(monkeypatch):
    monkeypatch.setattr(truncation, "MOST_MODES", 30)
    monkeypatch.setattr("rubhpc.integrate.modal_setup.MOST_MODES", 30)
    rig = at_node_5(radius=0.01, youngs_modulus=3e10)
    case = {"speed_ratio": 1.1, "clearance": "100 um", "transient": 0, "revolutions": 2}
    record = simulate(rig, **case)
    assert record.modal_error > 1e-3
    assert "it needs more than 30 modes" in record.remark
    assert "keeps all" in record.remark
    model, spin = assemble(rig), record.spin_speed
    assert number(kept_modes(model, spin, 1e-3)) == 30
    accuracy = sufficient_accuracy(model, spin)
    assert f"accuracy = {accuracy:.0e}" in record.remark
    assert simulate(rig, **case, accuracy=accuracy).modal_error == 0.0


def test_rigid_wall_keeps_all_modes():
    wall = replace(PACKAGED, stator=(LumpedStator(node=8, rigid=True),))
    model = assemble(wall)
    kept = kept_modes(model, 200.0, 1e-3)
    assert all(is_kept.all() for is_kept in kept)
    assert modal_error(model, 200.0, kept) == 0.0


def test_impact_is_shared_by_the_masses():
    """A mass of 1 kg on a spring, hit by one of 3 kg, takes a quarter of the momentum at once."""
    rotor, tip = np.array([1 / math.sqrt(3.0), 0.0]), np.array([0.0, 1.0])
    frequency = np.array([10.0, 50.0])
    assert impact_share(rotor, tip, frequency) == pytest.approx(0.25)
    assert pulse_spectrum(rotor, tip, frequency, 1e-6) == pytest.approx([0.25, 0.25])


def test_mass_meets_the_place_of_contact_alone_at_first():
    """A gram on a shaft of 0.1 kg there and 3 kg as a whole; a bar's wave is another matter."""
    frequency, rotor = np.array([10.0, 500.0, 50.0]), np.array([1 / math.sqrt(3.0), math.sqrt(10.0), 0.0])
    mass = np.array([0.0, 0.0, math.sqrt(1e3)])
    local = 1.0 / (1 / 3.0 + 10.0)
    assert struck_share(rotor, mass, frequency) == pytest.approx(1e-3 / (1e-3 + local))
    assert impact_share(rotor, mass, frequency) == pytest.approx(1e-3 / 3.0, rel=0.03)
    bar = np.array([0.0, math.sqrt(10.0), math.sqrt(1e3)])
    assert struck_share(rotor, bar, frequency) == impact_share(rotor, bar, frequency)
    assert all(part.all() for part in kept_modes(assemble(at_shaft(1e-3)), 220.0, 1e-3))
    assert not all(part.all() for part in kept_modes(assemble(lumped(1e-3, 1e5)), 220.0, 1e-3))


def test_bar_answers_an_impact_with_its_wave():
    """Clamped bar of 1 kg, hit by 400 kg: its static shape has 1/3 kg, its wave sqrt(1 / 400) of the peak."""
    k = np.arange(2000) + 0.5
    bar, frequency = np.full(k.size, math.sqrt(2.0)), np.pi * k
    assert static_inertia(bar, frequency) == pytest.approx(1 / 3, rel=1e-3)
    rotor = np.zeros(k.size + 1)
    rotor[-1] = 1 / 20
    axial, frequency = np.append(bar, 0.0), np.append(frequency, 1e-3)
    found = pulse_spectrum(rotor, axial, frequency, 0.05)[1500] - impact_share(rotor, axial, frequency)
    assert found == pytest.approx(math.sqrt(1 / 400) * 0.05 / frequency[1500], rel=0.01)


def test_ring_is_carried_in_full_in_resonance_and_little_far_from_it():
    damping = np.array([[0.0, 3.0, 0.02], [-3.0, 0.0, 0.0], [0.02, 0.0, 0.0]])
    share = coupled_ringing(damping, np.array([100.0, 100.0, 300.0]))
    assert share[0, 1] == share[1, 0] == pytest.approx(1.0)
    assert share[0, 2] == pytest.approx(0.02 * 100.0 / (300.0**2 - 100.0**2), rel=1e-4)
    assert share[1, 2] == 0.0
    assert np.all(np.diag(share) == 0.0)
