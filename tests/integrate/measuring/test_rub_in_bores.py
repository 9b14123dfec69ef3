"""What is recorded of rubs in bores: kinds, angles, forces; and what is the same machine in other words."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rubhpc import Bore, Carrier, LumpedStator, MatrixCarrier, read_rig, run_up, simulate
from rubhpc.integrate.changing_speed.case import record_run_up
from rubhpc.integrate.measuring.rub_in_bores import arc_of
from rubhpc.integrate.setup import prepare
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.rig.reading import with_keys
from rubhpc.schema import RUB_KIND
from rubhpc.study.contact_keys import Contact
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.tables import Integrator, Recording

PACKAGED = read_rig("mokhtar2017")
HOLE = Bore(node=8, mass=1.5, stiffness=4e6, damping=200.0)
CASE = {"speed_ratio": 1.4, "clearance": 80e-6, "friction": 0.1, "transient": 20, "revolutions": 4}


def bored(*stators, **changed):
    return replace(PACKAGED, stator=stators, **changed)


def orbit(record):
    return record.vertical + 1j * record.horizontal


def push(record, i=0):
    return record.contact_force_vertical[i] + 1j * record.contact_force_horizontal[i]


@pytest.mark.parametrize(
    ("degrees", "arc"),
    [([10.0, 12.0, 15.0], 5.0), ([-5.0, 5.0, 0.0], 10.0), ([90.0], 0.0), (np.arange(0.0, 720.0, 7.0), 360.0)],
)
def test_arc_of_contact(degrees, arc):
    assert math.degrees(arc_of(np.radians(degrees))) == pytest.approx(arc, abs=1e-9)


def test_no_contact_and_partial_rub():
    """A hole that is off is met once a revolution, on its near side."""
    free = simulate(bored(HOLE), **CASE | {"clearance": 1e-3})
    assert RUB_KIND[free.rub_kind[0]] == "none"
    assert np.isnan([free.whirl_frequency[0], free.contact_arc[0], free.contact_angle_mean[0]]).all()
    assert np.isnan(free.contact_angle).all()
    assert not free.contact_force_vertical.any()
    case = CASE | {"speed_ratio": 0.75, "clearance": 153e-6, "transient": 60}
    record = simulate(bored(replace(HOLE, mass=0.2, centre=(0.0, 37e-6))), **case)
    assert (RUB_KIND[record.rub_kind[0]], record.period) == ("partial", 1)
    assert record.contacts_per_revolution == [1.0]
    assert record.contact_angle_mean[0] == pytest.approx(-math.pi / 2, abs=0.3)  # towards -z
    around = record.whirl_frequency[0] * record.contact_fraction[0] * 2.0 * math.pi / record.spin_speed
    assert record.contact_arc[0] == pytest.approx(around, rel=0.2)
    assert 0.05 < record.contact_angle_spread[0] < 0.15
    assert np.array_equal(np.isfinite(record.contact_angle[0]), record.contact_force[0] > 0.0)


def test_forces_are_vectors_of_the_normal_and_of_friction():
    record = simulate(bored(HOLE), **CASE)
    assert RUB_KIND[record.rub_kind[0]] == "forward"
    assert record.whirl_frequency == pytest.approx(record.spin_speed, rel=1e-5)
    on_rotor = push(record) * np.exp(-1j * record.contact_angle[0]) / record.contact_force[0]
    assert on_rotor == pytest.approx(-(1.0 + 0.1j), rel=1e-3)  # back to the centre, and against the slip
    still = record.contact_angle_spread[0], record.contact_arc[0]
    assert still == pytest.approx((math.sqrt(2.0), 2.0 * math.pi), rel=1e-2)
    assert abs(record.energy_residual) < 1e-4


def test_forces_under_reversed_spin_are_mirrored():
    forth, back = (simulate(bored(HOLE), **CASE | {"speed_ratio": ratio}) for ratio in (1.4, -1.4))
    assert back.whirl_frequency == pytest.approx(forth.whirl_frequency, rel=1e-6)  # in the sense of the spin
    assert RUB_KIND[back.rub_kind[0]] == "forward"
    assert push(back) == pytest.approx(push(forth).conj(), rel=1e-4, abs=1e-4 * abs(push(forth)).max())


def test_a_machine_that_is_turned_rubs_turned():
    """With its unbalance and the centre of its hole, which has unequal springs."""
    uneven = replace(HOLE, stiffness=None, stiffness_y=4e6, stiffness_z=3e6, centre=(20e-6, -10e-6))
    turned = replace(uneven, stiffness_y=3e6, stiffness_z=4e6, centre=(10e-6, 20e-6))
    one = simulate(bored(uneven), **CASE)
    other = simulate(bored(turned), overrides={"rotor.unbalance.phase": math.pi / 2}, **CASE)
    for signal in (orbit, push):
        assert signal(other) == pytest.approx(1j * signal(one), abs=1e-6 * abs(signal(one)).max())
    assert np.ptp(abs(push(one))) > 0.1 * abs(push(one)).mean()
    moved = one.contact_angle_mean - other.contact_angle_mean + math.pi / 2
    assert np.angle(np.exp(1j * moved)) == pytest.approx(0.0, abs=1e-6)


def test_a_hole_that_is_off_is_a_shaft_that_is_off():
    """Loads that bend the shaft by as much the other way, and clearances from the unloaded shaft."""
    off = simulate(bored(replace(HOLE, centre=(15e-6, 0.0))), **CASE)
    still = simulate(bored(HOLE), **CASE)
    assert abs(abs(orbit(off)).mean() / abs(orbit(still)).mean() - 1.0) < 0.02
    assert orbit(off).mean().real > 5e-6


def test_a_rigid_hole_on_a_carrier_is_the_carrier():
    casing = Carrier(name="casing", mass=1.5, stiffness=4e6, damping=200.0)
    matrix = MatrixCarrier(
        name="casing", mass=1.5 * np.eye(2), damping=200 * np.eye(2), stiffness=4e6 * np.eye(2),
        degrees=["v", "w"],
    )  # fmt: skip
    hole = Bore(node=8, rigid=True, carrier="casing")
    known = simulate(bored(HOLE), **CASE)
    for carrier in (casing, matrix):
        record = simulate(bored(hole, carrier=(carrier,)), **CASE)
        assert orbit(record) == pytest.approx(orbit(known), rel=1e-7)
        assert push(record) == pytest.approx(push(known), rel=1e-6)
        assert record.stator_axial == pytest.approx(known.stator_axial, rel=1e-6, abs=1e-12)
        peak = np.hypot(known.stator_axial, known.stator_lateral).max()
        assert record.carrier_displacement == pytest.approx(peak, rel=1e-3)


def test_a_casing_that_turns_takes_the_torque_of_friction():
    """Its rotation is the moment of friction at the wall over its stiffness."""
    casing = Carrier(
        name="casing", mass=1.5, stiffness=4e6, damping=200.0, inertia=1e-3, torsional_stiffness=1e3,
        torsional_damping=0.5,
    )  # fmt: skip
    record = simulate(bored(Bore(node=8, rigid=True, carrier="casing"), carrier=(casing,)), **CASE)
    still = simulate(bored(HOLE), **CASE)
    assert push(record) == pytest.approx(push(still), rel=1e-3)
    assert abs(record.energy_residual) < 1e-4


def test_friction_factor_and_law_of_single_stators():
    factor = simulate(bored(replace(HOLE, friction_factor=0.5)), **CASE)
    known = simulate(bored(HOLE), **CASE | {"friction": 0.05})
    assert push(factor) == pytest.approx(push(known), rel=1e-9)
    law = NormalLaw(kind="penalty", stiffness=2e7, damping=50.0)
    own = simulate(bored(replace(HOLE, law=law)), **CASE)
    same = simulate(bored(HOLE), law="penalty", stiffness=2e7, damping=50.0, **CASE)
    assert push(own) == pytest.approx(push(same), rel=1e-9)


def test_laws_of_several_stators_in_one_machine():
    """A seal, a catcher bearing with its own law, and a point stator."""
    seal = replace(HOLE, clearance_offset=-20e-6)
    catcher = Bore(
        node=5, radius=0.012, mass=0.5, stiffness=3e6, damping=400.0, clearance_offset=-40e-6,
        law=NormalLaw(kind="hertz", stiffness=1e10, damping=0.2), friction_factor=0.3,
    )  # fmt: skip
    point = LumpedStator(
        node=8, angle=math.pi / 2, mass=5e-3, stiffness=2e5, damping=5.0, clearance_offset=-25e-6
    )
    record = simulate(bored(seal, catcher, point), friction_law="coulomb", **CASE | {"transient": 5})
    assert (record.contact_fraction > 0.0).all()
    assert [RUB_KIND[k] if k >= 0 else None for k in record.rub_kind] == ["forward", "forward", None]
    assert abs(record.energy_residual) < 1e-4
    along = push(record, 2)
    assert np.isfinite(along).all()
    assert record.contact_angle[2][record.contact_force[2] > 0.0] == pytest.approx(math.pi / 2, abs=1e-2)


def test_run_up_in_a_bore():
    found = run_up(bored(HOLE), start="900 rpm", stop="1900 rpm", time="1 s", clearance=300e-6, friction=0.05)
    assert found.contact_fraction.values[0, 0] == 0.0
    assert found.contact_fraction.max() == pytest.approx(1.0)
    force = np.hypot(found.contact_force_vertical, found.contact_force_horizontal).values
    normal = found.contact_force.values
    assert force[normal > 1.0] == pytest.approx(normal[normal > 1.0] * math.hypot(1.0, 0.05), rel=2e-2)


def test_kind_of_a_rub_at_a_changing_speed():
    """The contact point goes around with the unbalance, as at constant speed."""
    law = SpeedLaw(time=(0.0, 1.0), speed=(270.0, 290.0))
    recording = Recording(transient=0, revolutions=law.n_revolution, samples_per_revolution=64)
    setup = prepare(bored(HOLE), 290.0, contact=Contact(), integrator=Integrator(), samples_per_revolution=64)
    start = simulate(bored(HOLE), **CASE | {"speed_ratio": None, "speed": 270.0}).final
    case = {"recording": recording, "initial": start, "clearance": 80e-6, "friction": 0.1}
    found = record_run_up(setup, law, **case).measures
    assert RUB_KIND[found["rub_kind"][0]] == "forward"
    assert found["whirl_frequency"] == pytest.approx(280.0, rel=0.01)
    assert found["contact_fraction"] == pytest.approx(1.0)


def test_it_rests_in_a_bore_under_its_weight():
    """Without unbalance, a shaft that sags through the hole comes to rest on its wall."""
    heavy = with_keys(bored(replace(HOLE, centre=(50e-6, 30e-6))), {"rotor.gravity": 9.81})
    still = with_keys(heavy, {"rotor.unbalance.mass": 0.0})
    record = simulate(still, **CASE | {"friction": 0.0, "transient": 200, "speed_ratio": 3.0})
    hole = record.stator_axial[0] + 1j * record.stator_lateral[0] + (50e-6 + 30e-6j)
    assert abs(orbit(record) - hole) == pytest.approx(80e-6, rel=1e-6)
    assert RUB_KIND[record.rub_kind[0]] == "partial"
    assert record.contact_fraction == pytest.approx(1.0)
    assert abs(push(record)).mean() == pytest.approx(record.contact_force.mean(), rel=1e-9)
    assert record.whirl_frequency == pytest.approx(0.0, abs=1e-6)
