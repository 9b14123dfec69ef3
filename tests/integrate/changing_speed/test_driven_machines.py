"""A drive on rings, carriers, several discs and tabulated bearings, held to full-order time stepping."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import run_up
from full_order_machine import Machine, driven_machine

from rubhpc import Carrier, LumpedStator, Rig, Unbalance
from rubhpc.integrate.changing_speed.piece_integrator import PieceIntegrator
from rubhpc.integrate.changing_speed.speed_ranges import SpeedRanges
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.study.drive_law import DriveLaw

M, C = np.diag([5.0, 5.0, 3.0, 3.0]), np.diag([40.0, 40.0, 25.0, 25.0])
K = np.diag([3e5, 3.2e5, 2.5e5, 2.6e5]) - 1e5 * (np.eye(4, k=2) + np.eye(4, k=-2))
POLAR, DRIVE_INERTIA = np.array([8e-3, 5e-3]), 4e-3
TORSION = np.array([[2.1e4, -9e3], [-9e3, 9e3]])
TORSION_DAMPING = np.array([[0.3, -0.1], [-0.1, 0.1]])
UNBALANCE = (
    Unbalance(node=1, mass=0.01, radius=0.05, phase=0.4),
    Unbalance(node=2, mass=0.004, radius=0.05, phase=-1.0),
)
TABLE = BearingTable(
    node=1, speed=(0.0, 400.0), stiffness=(2e4, 1.4e5), damping=(60.0, 10.0), interpolation="linear"
)
CASING = {"mass": 2.0, "stiffness": 2e6, "damping": 200.0}
START, PER_REVOLUTION = 180.0, 32
TORQUE = {"torque": [3.0, -2.0], "speed": [0.0, 500.0]}
LAW = DriveLaw(torque=(3.0, -2.0), speed=(0.0, 500.0), start=1.0, n_revolution=1, lowest=0.1)
DRIVE = TORQUE | {"inertia": DRIVE_INERTIA, "lowest": 10.0, "start": START}
CONTACT = {"clearance": 2e-4, "friction": 0.2, "law": "penalty", "stiffness": 4e5, "damping": 30.0}


def machine(count, *, carrier=None, table=None, gravity=0.0):
    """Two discs, a ring around the first, as a rig and as the reference has it."""
    tip = LumpedStator(node=1, angle=0.3, mass=0.2, stiffness=3e5, damping=30.0, radius=0.05)
    if carrier:
        tip = replace(tip, lateral_stiffness=3e5, carrier="casing")
    ring = tuple(replace(tip, angle=0.3 + 2.0 * math.pi * i / count) for i in range(count))
    whole = np.zeros((3, 6, 6))
    lateral, twist = [0, 1, 3, 4], [2, 5]
    for target, moved, turned in zip(
        whole, (M, C, K), (np.diag(POLAR), TORSION_DAMPING, TORSION), strict=True
    ):
        target[np.ix_(lateral, lateral)], target[np.ix_(twist, twist)] = moved, turned
    rig = Rig.from_matrices(
        *whole,
        degrees=[(node, name) for node in (1, 2) for name in ("v", "w", "thx")],
        stators=ring,
        carriers=(Carrier(name="casing", **carrier),) if carrier else (),
        unbalance=UNBALANCE,
    )
    changes = {"gravity": gravity} | ({"bearing": (table,)} if table else {})

    def bearings(speed):
        return [np.pad(block, (0, 2)) for block in table.at(speed)]

    return replace(rig, rotor=replace(rig.rotor, **changes)), Machine(
        mass=M,
        damping=C,
        stiffness=K,
        polar=POLAR,
        torsion=TORSION,
        torsion_damping=TORSION_DAMPING,
        moment=np.array([u.mass * u.radius * np.exp(1j * u.phase) for u in UNBALANCE]),
        rubbed=0,
        stators=ring,
        clearance=CONTACT["clearance"],
        friction=CONTACT["friction"],
        penalty=CONTACT["stiffness"],
        penalty_damping=CONTACT["damping"],
        drive_inertia=DRIVE_INERTIA,
        torque=LAW.at,
        load=-gravity * np.diag(M) * [1, 0, 1, 0],
        bearings=bearings if table else None,
        carrier=tuple(carrier.values()) if carrier else None,
    )


LONG = (
    {"count": 3},
    {"count": 8},
    {"count": 16},
    {"count": 8, "carrier": CASING},
    {"count": 3, "table": TABLE},  # touches so lightly that overlaps err up to 40 times as much as motions
    {"count": 3, "table": TABLE, "gravity": 9.81},
    {"count": 8, "carrier": CASING, "table": TABLE, "gravity": 9.81},
)


@pytest.mark.parametrize(
    ("n", "keys"),
    [
        (2, {"count": 3, "carrier": CASING, "gravity": 9.81}),
        *(pytest.param(8, keys, marks=pytest.mark.long) for keys in LONG),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else str(value),
)
def test_a_machine_meets_full_order_stepping(n, keys):
    """The twist departs: the reference feels in it how its unbalance whirls (docs/theory/drive.md)."""
    rig, reference = machine(**keys)
    time, speed, rows, (lost, given, braking, _) = driven_machine(
        reference, start=START, n_revolution=n, per_revolution=PER_REVOLUTION
    )
    found = run_up(
        rig,
        drive=DRIVE | {"revolutions": n},
        samples_per_revolution=PER_REVOLUTION,
        pieces_per_revolution=4,
        initial={"from": "rest"},
        accuracy=1e-3,
        **CONTACT,
    )
    allowed = 1e-3
    assert found.contact_fraction.max() > 0.02
    lateral = np.array([found.vertical, found.horizontal])
    assert np.linalg.norm(lateral - rows[:2]) < allowed * np.linalg.norm(rows[:2])
    assert np.linalg.norm(found.torsion - rows[2]) < 0.02 * np.linalg.norm(rows[2])
    assert speed[-1] * np.abs(found.time.values - time[::PER_REVOLUTION]).max() < 1e-3  # rad
    assert float(found.friction_work.sum()) == pytest.approx(lost, rel=3 * allowed)
    assert found.energy_residual < 1e-9
    turning = POLAR.sum() + DRIVE_INERTIA  # but for what the whirl holds
    assert turning * (found.last_speed - START) == pytest.approx(given - braking, rel=0.01)


def test_a_whip_takes_all_that_the_spin_holds(monkeypatch):
    """Backward whirl under steady sliding grows until the rim hardly slips: the least slip is recorded.

    The speed swings as it falls; matrices are held over that, and contact modes not solved piece by piece.
    """
    held, taken = [], []
    hold, take = SpeedRanges.hold, PieceIntegrator.take
    monkeypatch.setattr(SpeedRanges, "hold", lambda *at: held.append(at) or hold(*at))
    monkeypatch.setattr(PieceIntegrator, "take", lambda *at, **keys: taken.append(at) or take(*at, **keys))
    rig, _ = machine(3)
    drive = {"torque": 0.0, "start": 200.0, "revolutions": 60, "inertia": DRIVE_INERTIA}
    found = run_up(rig, drive=drive, clearance=2e-4, friction=0.8, samples_per_revolution=32)
    assert found.record_end == "lowest_speed"
    assert found.minimum_slip_speed.min() < 0.05 * 200.0 * 0.05  # of the first speed of the rim
    assert len(taken) > 60
    assert len(held) < 7  # 3
    assert found.energy_residual < 1e-9


# The error of a balance is rounding in closed form, and that of the steps by collocation.
@pytest.mark.parametrize(("friction_law", "allowed"), [("sliding", 1e-9), ("coulomb", 1e-4)])
def test_energy_balances_where_stators_throw_the_rotor_back(friction_law, allowed):
    """What restitution leaves of a speed, and what impacts take, is in the balance of the spin."""
    rig, _ = machine(3)
    case = {"clearance": 1.5e-4, "friction": 0.2, "friction_law": friction_law, "samples_per_revolution": 32}
    thrown, stopped = (
        run_up(rig, drive=DRIVE | {"revolutions": 4}, initial={"from": "rest"}, restitution=e, **case)
        for e in (0.7, 0.0)
    )
    assert thrown.contact_force.max() > 0.0
    assert thrown.energy_residual < allowed
    difference = np.abs(thrown.stator_axial.values - stopped.stator_axial.values).max()
    assert difference > 0.01 * np.abs(stopped.stator_axial.values).max()
