"""A drive with torque: held to full-order time stepping, to closed forms, and to the prescribed speed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import run_up
from full_order_machine import Machine, driven_machine
from scipy.linalg import expm

from rubhpc import LumpedStator, Rig, Unbalance
from rubhpc.errors import InputError
from rubhpc.integrate.record import State
from rubhpc.study.drive_law import DriveLaw

M = np.diag([5.0, 5.0, 1e-2, 1e-2, 8e-3])
C = np.diag([30.0, 30.0, 1e-3, 1e-3, 0.1])
K = np.diag([2e5, 2.4e5, 60.0, 60.0, 9e3])
K[0, 3] = K[3, 0] = 300.0  # an overhung disc: it tilts as it moves
K[1, 2] = K[2, 1] = -300.0
G = np.zeros((5, 5))
G[2, 3], G[3, 2] = 2e-2, -2e-2
STOP = LumpedStator(node=1, angle=0.0, mass=0.4, stiffness=4e5, damping=40.0, radius=0.05)
RIG = Rig.from_matrices(
    M,
    C,
    K,
    G,
    degrees=[(1, "v"), (1, "w"), (1, "thy"), (1, "thz"), (1, "thx")],
    stators=[STOP],
    unbalance=[Unbalance(node=1, mass=0.01, radius=0.05, phase=0.4)],
)
MOMENT = 0.01 * 0.05 * np.exp(0.4j)
DRIVE = {"torque": [3.0, -2.0], "speed": [0.0, 500.0], "inertia": 4e-3, "lowest": 10.0}
LAW = DriveLaw(torque=(3.0, -2.0), speed=(0.0, 500.0), start=150.0, n_revolution=1, lowest=10.0)


def expected(start, n_revolution, per_revolution, **keys):
    """Of the machine alone, or of one whose disc meets the stator."""
    alone = {"clearance": 1.0, "friction": 0.0, "penalty": 0.0, "penalty_damping": 0.0}
    machine = Machine(
        mass=M[:4, :4],
        damping=C[:4, :4],
        stiffness=K[:4, :4],
        gyroscopic=G[:4, :4],
        polar=M[4:, 4],
        torsion=K[4:, 4:],
        torsion_damping=C[4:, 4:],
        moment=np.array([MOMENT]),
        rubbed=0,
        stators=(STOP,),
        drive_inertia=DRIVE["inertia"],
        torque=LAW.at,
        **(alone | keys),
    )
    return driven_machine(
        machine, start=start, n_revolution=n_revolution, per_revolution=per_revolution, rtol=1e-9
    )


def driven(rig, start, n_revolution, per_revolution, pieces, **keys):
    return run_up(
        rig,
        drive=DRIVE | {"start": start, "revolutions": n_revolution},
        samples_per_revolution=per_revolution,
        pieces_per_revolution=pieces,
        initial={"from": "rest"},
        **keys,
    )


def test_free_motion_meets_full_order_stepping_in_second_order():
    """From 150 to 175 rad/s in 6 revolutions; the twist departs, since the reference feels whirl in it."""
    time, speed, rows, (*_, work) = expected(150.0, 6, 32)
    errors = []
    for pieces in (1, 4):
        found = driven(RIG, 150.0, 6, 32, pieces, clearance=1.0)
        lateral = np.array([found.vertical, found.horizontal])
        errors.append(np.linalg.norm(lateral - rows[:2]) / np.linalg.norm(rows[:2]))
        assert found.energy_residual < 1e-5
    assert errors[0] < 2e-2  # the speed rises by 3 % a revolution
    assert errors[1] < errors[0] / 12
    assert found.time.values == pytest.approx(time[::32], abs=2e-6)
    assert float(found.drive_work.sum()) == pytest.approx(work, rel=1e-5)
    assert np.linalg.norm(found.torsion - rows[2]) < 0.03 * np.linalg.norm(rows[2])
    assert speed[-1] < found.last_speed < 1.01 * speed[-1]


def test_rub_brakes_the_spin_as_in_full_order_stepping():
    """A penalty, friction and gravity, of a rotor so light to turn that its speed falls within each touch."""
    rig = replace(RIG, rotor=replace(RIG.rotor, gravity=9.81))
    law = {"law": "penalty", "stiffness": 2e5, "damping": 20.0}
    contact = {"clearance": 1e-3, "friction": 0.3, "penalty": 2e5, "penalty_damping": 20.0}
    time, _, rows, _ = expected(190.0, 10, 32, load=-9.81 * M[:4, 0], **contact)
    found = driven(rig, 190.0, 10, 32, 4, clearance=1e-3, friction=0.3, **law)
    lateral = np.array([found.vertical, found.horizontal])
    assert float(found.friction_work.sum()) > 1.0
    assert np.linalg.norm(lateral - rows[:2]) < 2e-3 * np.linalg.norm(rows[:2])
    assert found.time.values == pytest.approx(time[::32], abs=2e-5)  # 0.004 rad
    assert found.energy_residual < 5e-5  # of accelerations within 6e-5 rad of those guessed


@pytest.mark.parametrize("law", [{}, {"friction_law": "coulomb"}])
def test_a_rotor_at_rest_on_a_stator_coasts_down_evenly(law):
    """Its weight, less what the springs bear, presses it: J dW/dt = -mu N r, a closed form."""
    mass, stiffness, radius, mu, gap, inertia = 4.0, 2e4, 0.06, 0.2, 5e-4, 0.02
    floor = LumpedStator(node=1, angle=math.pi, mass=0.2, stiffness=5e5, damping=300.0, radius=radius)
    rig = Rig.from_matrices(
        np.diag([mass, mass, 5e-3]),
        np.diag([200.0, 200.0, 0.1]),
        np.diag([stiffness, stiffness, 5e3]),
        degrees=[(1, "v"), (1, "w"), (1, "thx")],
        stators=[floor],
        unbalance=[Unbalance(node=1, mass=1e-9, radius=0.05)],
    )
    rig = replace(rig, rotor=replace(rig.rotor, gravity=9.81))
    drive = {"torque": 0.0, "start": 120.0, "revolutions": 90, "inertia": inertia, "lowest": 80.0}
    found = run_up(rig, drive=drive, clearance=gap, friction=mu, samples_per_revolution=32, **law)
    force = (mass * 9.81 - stiffness * gap) / (1.0 + stiffness / floor.stiffness)
    rate = mu * force * radius / (5e-3 + inertia)
    assert found.record_end == "lowest_speed"
    assert found.last_speed < 80.0
    time, speed = found.time.values[8:], found.speed.values[8:]
    assert np.polyfit(time + math.pi / speed, speed, 1)[0] == pytest.approx(-rate, rel=1e-4)
    assert found.braking_torque.values[8:] == pytest.approx(mu * force * radius, rel=1e-4)


def test_braking_takes_what_the_spin_lacks():
    """Less friction's work over the angle it is that of whirl, without jumps between revolutions."""
    drive = {"torque": 1.0, "start": "1500 rpm", "revolutions": 45, "inertia": 0.02}
    found = run_up("mokhtar2017", drive=drive, clearance=1e-4, friction=0.2, samples_per_revolution=64)
    lasts, speed = 2.0 * math.pi / found.speed.values, found.speed.values
    whirl = found.braking_torque.values - found.friction_work.values.reshape(-1) / (speed * lasts)
    assert np.abs(np.diff(whirl)[5:]).max() < 0.01


def jeffcott(inertia):
    """One disc on an even shaft, 100 rad/s, damped by 1 %."""
    return Rig.from_matrices(
        np.diag([2.0, 2.0, inertia]),
        np.diag([4.0, 4.0, 0.2]),
        np.diag([2e4, 2e4, 2e4]),
        degrees=[(1, "v"), (1, "w"), (1, "thx")],
        stators=[LumpedStator(node=1, mass=1e-2, stiffness=1e5, damping=1.0, radius=0.1)],
        unbalance=[Unbalance(node=1, mass=1e-2, radius=0.02)],
    )


def lost_torque(speed):
    """By which whirl brakes the spin of that rotor at a steady speed, N m: c X^2 W."""
    amplitude = 2e-4 * speed**2 / np.hypot(2e4 - 2.0 * speed**2, 4.0 * speed)
    return 4.0 * amplitude**2 * speed


@pytest.mark.parametrize(("share", "is_held"), [(0.5, True), (1.6, False)])
def test_resonance_holds_a_weak_drive_and_lets_a_strong_one_pass(share, is_held):
    """A. Sommerfeld, Z. VDI 46 (1902) 391: the speed settles where the drive gives what whirl takes."""
    torque = share * lost_torque(np.linspace(95.0, 105.0, 2001)).max()
    drive = {"torque": torque, "start": 93.0, "revolutions": 250, "inertia": 2e-3}
    found = run_up(jeffcott(2e-3), drive=drive, clearance=1.0, samples_per_revolution=16)
    if not is_held:
        assert found.last_speed > 130.0
        return
    assert 98.0 < found.last_speed < 100.0
    assert lost_torque(found.speed.values[-60:]).mean() == pytest.approx(torque, rel=5e-3)
    assert float(found.braking_torque[-60:].mean()) == pytest.approx(torque, rel=5e-3)
    assert found.energy_residual < 1e-5


def test_a_torque_table_twists_and_damps_the_shaft():
    """A twist rings down about one that follows the torque, by the exponential of its matrix.

    A torque that falls with the speed of the driven end damps: by 8.3 / s, the shaft itself by 1.9 / s.
    The error falls with the square of the piece; a torque that is even within each errs by 0.3.
    """
    torque, speed, start, n_revolution, per = (25.0, -25.0), (0.0, 500.0), 200.0, 8, 32
    disc, drive, k, c = M[4, 4], 4e-3, K[4, 4], 0.01
    total, slope, first = disc + drive, -0.1, 5.0  # N m s, N m
    reduced = disc * drive / total
    # Of the twist, its rate, and the spin over that at the beginning; the last is 1.
    system = np.zeros((4, 4))
    system[0, 1] = 1.0
    system[1] = [-k / reduced, -c / reduced + slope * disc / total / drive, -slope / drive, -first / drive]
    system[2] = [0.0, -slope * disc / total / total, slope / total, first / total]
    state = np.array([1e-3, 0.0, 0.0, 1.0])
    step = 1e-5
    onward, rows, angle = expm(step * system), [state], [0.0]
    while angle[-1] < 2.0 * math.pi * n_revolution:
        rows.append(onward @ rows[-1])
        angle.append(angle[-1] + step * (start + 0.5 * (rows[-1][2] + rows[-2][2])))
    wanted = 2.0 * math.pi * np.arange(n_revolution * per) / per
    expected = np.interp(wanted, angle, np.array(rows)[:, 0])
    damping = C.copy()
    damping[4, 4] = c
    degrees = [(1, "v"), (1, "w"), (1, "thy"), (1, "thz"), (1, "thx")]
    balanced = [Unbalance(node=1, mass=1e-9, radius=0.05)]
    rig = Rig.from_matrices(M, damping, K, G, degrees=degrees, stators=[STOP], unbalance=balanced)
    none = (np.zeros(1),)
    begun = State(
        rotor_displacement=np.array([0.0, 0.0, 0.0, 0.0, 1e-3]),
        rotor_velocity=np.zeros(5),
        stator_displacement=none,
        stator_velocity=none,
        contact_force=np.zeros(1),
    )
    found = run_up(
        rig,
        drive={
            "torque": torque,
            "speed": speed,
            "inertia": drive,
            "start": start,
            "revolutions": n_revolution,
        },
        initial=begun,
        clearance=1e-3,
        samples_per_revolution=per,
        pieces_per_revolution=8,
    )
    assert np.abs(found.torsion.values - expected).max() < 5e-3 * np.ptp(expected)
    assert found.last_speed == pytest.approx(start + rows[-1][2], rel=1e-4)


def test_a_heavy_drive_prescribes_the_speed():
    rate, inertia = 30.0, 1e4
    drive = {"torque": rate * (inertia + M[4, 4]), "start": 170.0, "revolutions": 12, "inertia": inertia}
    keys = {"clearance": 4e-4, "friction": 0.2, "samples_per_revolution": 32, "pieces_per_revolution": 2}
    found = run_up(RIG, drive=drive, **keys)
    law = run_up(RIG, start=170.0, stop=200.0, time=1.0, **keys)
    assert found.contact_fraction.max() > 0.0
    assert found.time.values == pytest.approx(law.time.values[:12], rel=1e-5, abs=1e-9)
    for name in ("vertical", "horizontal"):
        other = law[name].values[: 12 * 32]
        assert np.abs(found[name].values - other).max() < 5e-3 * np.abs(other).max()


def test_torques_are_linear_between_speeds_and_constant_beyond():
    law = DriveLaw(torque=(4.0, 2.0, -1.0), speed=(10.0, 20.0, 50.0), start=5.0, n_revolution=9, lowest=1.0)
    assert [law.at(speed) for speed in (0.0, 10.0, 15.0, 30.0, 50.0, 90.0)] == pytest.approx(
        [4.0, 4.0, 3.0, 1.0, -1.0, -1.0]
    )
    even = DriveLaw(torque=(2.0,), start=10.0, n_revolution=5, lowest=1.0)
    assert even.fastest(0.5) == pytest.approx(1.05 * math.sqrt(100.0 + 2.0 * 4.0 * 10.0 * math.pi), rel=1e-6)
    assert law.fastest(1e-3) == pytest.approx(1.05 * 40.0, rel=2e-2)  # where no torque is left


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"start": 100.0, "revolutions": 9}, "torque: missing"),
        ({"torque": "1 N", "start": 9.0, "revolutions": 9}, "torque: value 1"),
        ({"torque": [1.0, 0.0], "start": 9.0, "revolutions": 9}, "2 values for 0 speeds; give one for each"),
        ({"torque": [1.0, 0.0], "speed": [9.0, 1.0], "start": 9.0, "revolutions": 9}, "do not rise"),
        ({"torque": 1.0, "start": 0.0, "revolutions": 9}, "start: 0 rad/s is out of range"),
        ({"torque": -1e3, "start": 100.0, "revolutions": 9}, "the spin falls to 95.49 rpm within the first"),
        ({"torqe": 1.0, "start": 100.0, "revolutions": 9}, "did you mean torque?"),
    ],
)
def test_what_drives_nothing_is_refused(keys, says):
    with pytest.raises(InputError) as error:
        run_up(RIG, drive=keys, clearance=1e-3)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_a_drive_takes_the_place_of_a_law():
    with pytest.raises(InputError, match="drive: takes the place of start"):
        run_up(RIG, drive=DRIVE | {"start": 9.0, "revolutions": 9}, start=3.0, clearance=1e-3)
