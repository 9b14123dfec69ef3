"""Run-ups and coast-downs: held to full-order time stepping, to Lewis, and to the steady speed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, run_up, simulate
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from trial_rig import trial_rig

from rubhpc import LumpedStator, Rig, Unbalance
from rubhpc.errors import InputError
from rubhpc.integrate.changing_speed.run_up import integrate_run_up
from rubhpc.integrate.setup import prepare
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.spectra import track_orders
from rubhpc.study.initial import Initial
from rubhpc.study.speed_law import LAG, SpeedLaw, cut
from rubhpc.study.study import Integrator

M = np.diag([5.0, 5.0, 1e-2, 1e-2, 8e-3])
C = np.diag([30.0, 30.0, 1e-3, 1e-3, 1e-2])
K = np.diag([2e5, 2.4e5, 60.0, 60.0, 90.0])
K[0, 3] = K[3, 0] = 300.0
K[1, 2] = K[2, 1] = -300.0
G = np.zeros((5, 5))
G[2, 3], G[3, 2] = 2e-2, -2e-2
DEGREES = [(1, "v"), (1, "w"), (1, "thy"), (1, "thz"), (1, "thx")]
STOP = LumpedStator(node=1, angle=0.0, mass=0.4, stiffness=4e5, damping=40.0, radius=0.05)
RIG = Rig.from_matrices(
    M,
    C,
    K,
    G,
    degrees=DEGREES,
    stators=[STOP],
    unbalance=[Unbalance(node=1, mass=0.01, radius=0.05, phase=0.4)],
)
MOMENT = 0.01 * 0.05 * np.exp(0.4j)
SPINNING = np.array([0.0, 0.0, 0.0, 0.0, 1.0])


def sample_times(start, stop, time, n):
    law = SpeedLaw(time=(0.0, time), speed=(start, stop))
    return law.at_angle(2 * math.pi * np.arange(law.n_revolution * n) / n)[0]


def stepped(
    start, stop, time, per_revolution, clearance=1.0, friction=0.0, table=None, gravity=0.0, most=None
):
    """Vertical, horizontal and torsional motion by Dormand and Prince's method, with inelastic impacts."""
    rate = (stop - start) / time
    n = 6  # and the tip
    mass, damping, stiffness = (np.zeros((n, n)) for _ in range(3))
    mass[:5, :5], mass[5, 5] = M, STOP.mass
    damping[5, 5], stiffness[5, 5] = STOP.damping, STOP.stiffness
    inverse = np.linalg.inv(mass)
    gap = np.array([-1.0, 0, 0, 0, 0, 1.0])
    force_direction = np.array([-1.0, -friction, 0, 0, -friction * STOP.radius, 1.0])

    def accelerations(t, y):
        spin, angle = start + rate * t, start * t + rate * t**2 / 2
        turning = MOMENT * (spin**2 - 1j * rate) * np.exp(1j * angle)
        damping[:5, :5] = C + spin * G
        stiffness[:5, :5] = K + rate * G
        if table is not None:
            k, c = table.at(spin)
            stiffness[:2, :2] += k
            damping[:2, :2] += c
        force = -damping @ y[n:] - stiffness @ y[:n]
        force[:5] += np.array([turning.real - gravity * M[0, 0], turning.imag, 0, 0, 0]) - rate * M @ SPINNING
        return inverse @ force

    def pressing(t, y):
        return -(gap @ accelerations(t, y)) / (gap @ inverse @ force_direction)

    def open_rates(t, y):
        return np.concatenate([y[n:], accelerations(t, y)])

    def closed_rates(t, y):
        return np.concatenate([y[n:], accelerations(t, y) + inverse @ force_direction * pressing(t, y)])

    def touches(t, y):
        """Bodies part with a gap of 0, which a hop shorter than a step may leave without a change of sign."""
        return clearance + gap @ y[:n] + 1e-13

    def closest(t, y):
        """The stator's frequency is 160 Hz: no step of 1 ms holds a minimum of the gap and a maximum."""
        return gap @ y[n:]

    touches.terminal = pressing.terminal = True
    touches.direction = pressing.direction = -1
    closest.direction = 1
    times = sample_times(start, stop, time, per_revolution)[:most]
    y = np.zeros(2 * n)
    k = np.zeros((5, 5)) if table is None else np.pad(table.at(start)[0], (0, 3))
    y[:5] = np.linalg.solve(K + k, -rate * M @ SPINNING - gravity * M[:, 0])
    found, t, is_closed = np.zeros((2 * n, times.size)), 0.0, False
    while t < times[-1]:
        part = solve_ivp(
            closed_rates if is_closed else open_rates,
            (t, times[-1]),
            y,
            method="DOP853",
            rtol=1e-9,
            atol=1e-12,
            max_step=2e-4 if is_closed else 1e-3,
            events=pressing if is_closed else (touches, closest),
            dense_output=True,
        )
        end, touched = part.t[-1], part.status == 1 and not is_closed

        def open_by(s, part=part):
            return touches(s, part.sol(s))

        for lowest in () if is_closed else part.t_events[1]:
            before = part.t[max(np.searchsorted(part.t, lowest) - 1, 0)]
            if open_by(lowest) < 0.0 < open_by(before):  # it touches and parts within a step
                end, touched = brentq(open_by, before, lowest, xtol=1e-15), True
                break
        inside = (times >= t) & (times <= end)
        if inside.any():
            found[:, inside] = part.sol(times[inside])
        t, y = end, part.sol(end)
        if touched:
            y[n:] -= inverse @ force_direction * (gap @ y[n:]) / (gap @ inverse @ force_direction)
        y[n - 1] -= clearance + gap @ y[:n]  # an event leaves 1e-13 m at most
        is_closed = not is_closed and pressing(t, y) > 0.0  # or it parts at once
    return found[[0, 1, 4]]


def test_free_passages_meet_full_order_stepping_in_second_order():
    """A hundredth of the usual time, so that the speed changes by 4 % a revolution."""
    law = {"start": 120.0, "stop": 300.0, "time": 2.0}
    expected = stepped(*law.values(), 64)
    errors = []
    for pieces in (1, 2, 4):
        found = run_up(
            RIG,
            **law,
            clearance=1.0,
            initial={"from": "rest"},
            samples_per_revolution=64,
            pieces_per_revolution=pieces,
            accuracy=1e-5,  # what is left is the error of the pieces
        )
        rows = np.array([found.vertical, found.horizontal])
        errors.append(np.linalg.norm(rows - expected[:2]) / np.linalg.norm(expected[:2]))
        assert found.torsion.values == pytest.approx(expected[2], rel=1e-6)  # of the shaft's own inertia
    assert errors[0] < 1e-3
    assert errors[2] < min(errors[0] / 12, 5e-5)


@pytest.mark.parametrize(("start", "stop", "time"), [(150.0, 250.0, 4.0), (235.0, 205.0, 1.2)])
def test_rub_in_a_passage_meets_full_order_stepping(start, stop, time):
    law = {"start": start, "stop": stop, "time": time}
    found = run_up(
        RIG,
        **law,
        clearance=6e-4,
        friction=0.2,
        initial={"from": "rest"},
        samples_per_revolution=32,
        pieces_per_revolution=4,
        accuracy=1e-5,  # what is left is the error of the pieces
    )
    touched = np.flatnonzero(found.contact_fraction[:, 0])
    assert touched.size > 12
    end = (touched[0] + 20) * 32
    expected = stepped(*law.values(), 32, clearance=6e-4, friction=0.2, most=end)
    rows = np.array([found.vertical, found.horizontal, found.torsion])[:, :end]
    scale = np.abs(expected).max(axis=1)
    assert (np.abs(rows - expected).max(axis=1) / scale).max() < 5e-5


UNDAMPED = Rig.from_matrices(
    np.diag([1.0, 1.0]),
    None,
    np.diag([1e4, 9e6]),
    degrees=[(1, "v"), (1, "w")],
    stators=[LumpedStator(node=1, mass=1e-3, stiffness=1e5, damping=1.0, radius=0.1)],
    unbalance=[Unbalance(node=1, mass=1e-4, radius=0.1)],
)


def steady_motion(speed):
    """Amplitude of that mass at a constant speed, m."""
    return 1e-5 * speed**2 / (100.0**2 - speed**2)


def duhamel(start, stop, time):
    """Times (s) and motion (m) of that mass by Duhamel's integral, from the steady one at the first speed."""
    t, rate = np.linspace(0.0, time, 400_001), (stop - start) / time
    spin, angle = start + rate * t, start * t + rate * t**2 / 2.0
    force = (1e-5 * (spin**2 - 1j * rate) * np.exp(1j * angle)).real * np.exp(-100j * t)
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]))]) * t[1]
    return t, (np.exp(100j * t) * impulse).imag / 100.0 + steady_motion(start) * np.cos(100.0 * t)


@pytest.mark.parametrize("time", [1.5, 5.0, 12.0])
def test_passage_through_resonance_is_duhamels_and_reaches_what_lewis_found(time):
    """F. M. Lewis, Trans. ASME 54 (1932) 253: undamped, 3.67 sqrt(q) + 1/4 times the static deflection.

    It is 3.69 sqrt(q) + 0.2 where the speed falls. q is the square of the natural frequency over the rate of
    the frequency, both in cycles. The force of an unbalance, taken at resonance, grows with the speed: by
    what a run-up is higher for that, a coast-down is lower. The exact peaks differ from Lewis' by up to
    4.4 %, their mean by up to 0.98 %.
    """
    root = 100.0 / (2 * math.pi) / math.sqrt(70.0 / time / (2 * math.pi))
    static = 1e-5  # m, at 100 rad/s
    ratios = []
    for (start, stop), expected in (((60.0, 130.0), 3.67 * root + 0.25), ((130.0, 60.0), 3.69 * root + 0.2)):
        times, exact = duhamel(start, stop, time)
        largest = np.abs(exact).max()
        law = {"start": start, "stop": stop, "time": time, "clearance": 1.0}
        for pieces, allowed in ((None, 5e-4), (4, 2e-5)):
            found = run_up(UNDAMPED, **law, pieces_per_revolution=pieces)
            at, _, _ = SpeedLaw(time=(0.0, time), speed=(start, stop)).at_angle(
                2 * np.pi * found.turned.values
            )
            assert np.abs(found.vertical.values - np.interp(at, times, exact)).max() < allowed * largest
        ratios.append(float(abs(found.vertical).max()) / static / expected)
    assert ratios == pytest.approx([1.0, 1.0], rel=0.05)
    assert math.sqrt(math.prod(ratios)) == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("speed", [60.0, 130.0])
def test_a_drive_begins_in_the_contact_free_motion_at_its_first_speed(speed):
    drive = {"torque": 5.0, "start": speed, "revolutions": 1, "inertia": 0.1}
    found = run_up(UNDAMPED, drive=drive, clearance=1.0)
    assert found.speed[0] > 1.005 * speed
    assert float(found.vertical[0]) == pytest.approx(steady_motion(speed), rel=1e-9)


def test_a_law_of_constant_speed_is_a_simulation():
    case = {"clearance": "60 um", "samples_per_revolution": 64}
    steady = simulate(trial_rig(2), speed=210.0, transient=0, revolutions=12, **case)
    found = run_up(
        trial_rig(2),
        start=210.0,
        stop=210.0,
        time=12.01 * 2 * math.pi / 210.0,
        initial={"from": "rest"},
        **case,
    )
    assert steady.contact_force.max() > 0.0
    for name in ("vertical", "torsion", "stator_axial", "contact_force"):
        signal = steady.signals[name]
        assert found[name].values == pytest.approx(signal, abs=1e-6 * np.abs(signal).max()), name
    mean = found.mean("revolution")
    assert mean.contact_fraction.values == pytest.approx(steady.contact_fraction, rel=1e-4)
    assert mean.friction_work.values == pytest.approx(steady.friction_work, rel=1e-4)


DRIVEN = {"drive": {"start": 100.0, "torque": 1.0, "revolutions": 9}}
SPRINGS, STICK = {"law": "penalty", "stiffness": 1e6}, {"friction_law": "coulomb"}


def test_bearings_have_their_coefficients_at_the_speed_reached():
    table = BearingTable(
        node=1, speed=(0.0, 400.0), stiffness=(2e4, 1.4e5), damping=(60.0, 10.0), interpolation="linear"
    )
    rig = replace(RIG, rotor=replace(RIG.rotor, bearing=(table,), gravity=9.81))
    law = {"start": 150.0, "stop": 195.0, "time": 1.0}
    found = run_up(
        rig,
        **law,
        clearance=1.0,
        initial={"from": "rest"},
        samples_per_revolution=32,
        pieces_per_revolution=4,
    )
    expected = stepped(*law.values(), 32, table=table, gravity=9.81)
    rows = np.array([found.vertical, found.horizontal])
    assert np.linalg.norm(rows - expected[:2]) < 5e-3 * np.linalg.norm(expected[:2])


def test_orders_are_followed():
    angle = 2 * math.pi * np.arange(64 * 40) / 64
    growth = 1.0 + 1e-3 * angle
    signal = 3.0 + growth * np.cos(angle + 0.3) + 0.5 * np.sin(angle / 3)
    first, third = track_orders(signal, 64, (1.0, 1 / 3), 6).T
    assert np.abs(first[6:-6]) == pytest.approx(growth[::64][6:-6], rel=2e-3)
    assert np.angle(first) == pytest.approx(0.3, abs=5e-3)
    assert np.abs(third[6:-6]) == pytest.approx(0.5, rel=5e-3)
    assert np.angle(third[6:-6]) == pytest.approx(-math.pi / 2, abs=5e-3)


def test_a_run_up_says_what_speed_it_has_reached():
    case = {"contact": Contact(), "integrator": Integrator(), "samples_per_revolution": 64}
    fastest, said = prepare(RIG, 300.0, **case), []
    law = SpeedLaw(time=(0.0, 0.5), speed=(150.0, 300.0))
    integrate_run_up(
        fastest, law, clearance=5e-5, friction=0.1, initial=Initial(), check=lambda: None, say=said.append
    )
    speeds = [int(text.removeprefix("a case at ").removesuffix(" rpm")) for text in said]
    assert speeds == sorted(speeds)
    assert speeds[0] >= 1432
    assert speeds[-1] <= 2865


@pytest.mark.parametrize(
    "law",
    [
        {"start": 100.0, "stop": 120.0, "time": 1.0},
        DRIVEN,
    ],
)
def test_a_case_that_ends_in_its_first_revolution_says_why(law):
    found = run_up(
        "mokhtar2017",
        clearance="100 um",
        friction=0.0,
        samples_per_revolution=32,
        initial={"vertical": 1.0},
        **law,
    )
    assert "passed 0.08 m in revolution 1" in found.reason
    assert found.attrs.get("record_end") == ("ended_early" if "drive" in law else None)
    assert found.sizes["revolution"] == found.sizes["sample"] == 0
    assert found.amplitude_vertical.shape == (0, found.sizes["order"])


def test_a_law_of_several_points_is_run_through_in_turn():
    law = SpeedLaw(time=(0.0, 1.0, 3.0), speed=(10.0, 30.0, 20.0))
    time, speed, rate = law.at_angle([0.0, 20.0, 47.5])
    assert time == pytest.approx([0.0, 1.0, 2.0])
    assert speed == pytest.approx([10.0, 30.0, 25.0])
    assert rate == pytest.approx([20.0, -5.0, -5.0])


def test_pieces_are_as_long_as_the_acceleration_allows():
    law = SpeedLaw(time=(0.0, 10.0, 12.0), speed=(20.0, 400.0, 400.0))
    cuts = cut(law, 64)
    assert cuts[0] == 0
    assert cuts[-1] == 64 * law.n_revolution
    (bend,) = law.bends(64)
    before = cuts[cuts <= 64 * (bend // 64)]
    lengths = np.diff(before)
    assert set(lengths) == {4, 8, 16, 32, 64}
    assert all(length < 64 or first % 64 == 0 for first, length in zip(before, lengths, strict=False))
    around = cuts[(cuts >= before[-1]) & (cuts <= before[-1] + 64)]
    assert around.tolist() == [before[-1], math.floor(bend), math.ceil(bend), before[-1] + 64]
    assert set(np.diff(cuts[cuts >= around[-1]])) == {64 * count for count in (2, 12, 16)}
    time, _, rate = law.at_angle(2 * math.pi * cuts / 64)
    assert (rate[:-1] * np.diff(time) ** 2 / 12).max() <= LAG
    straight = SpeedLaw(time=(0.0, 10.0), speed=(20.0, 400.0))
    assert np.diff(cut(straight, 64, 2)) == pytest.approx(32)


def test_pieces_of_several_revolutions_are_as_accurate_as_short_ones():
    case = {"start": 185.0, "stop": 209.0, "time": 4.5, "clearance": 8e-4, "samples_per_revolution": 64}
    assert np.diff(cut(SpeedLaw(time=(0.0, 4.5), speed=(185.0, 209.0)), 64)).max() == 128
    found, fine = run_up(RIG, **case), run_up(RIG, **case, pieces_per_revolution=4)
    assert fine.contact_fraction.max() > 0.0
    touched = 64 * int(np.argmax(fine.contact_fraction.values[:, 0] > 0.0))
    for name in ("vertical", "horizontal"):
        expected = fine[name].values[: touched + 64 * 6]
        error = np.abs(found[name].values[: touched + 64 * 6] - expected).max()
        assert error < 0.01 * np.abs(expected).max(), name


@pytest.mark.parametrize("contact", [{}, STICK | SPRINGS], ids=["closed form", "collocation"])
def test_earlier_cases_of_a_set_up_change_nothing(contact, monkeypatch):
    """Cases share matrices and contact modes, in whatever order they meet them."""
    law = SpeedLaw(time=(0.0, 0.4), speed=(185.0, 209.0))
    case = {"contact": Contact(**contact), "integrator": Integrator(), "samples_per_revolution": 64}
    used, fresh = (prepare(trial_rig(3), 209.0, **case) for _ in range(2))
    start = {"friction": 0.2, "initial": Initial(from_="contact-free")}
    for clearance in (3e-5, 5e-5):
        found = integrate_run_up(used, law, clearance=clearance, **start)
    monkeypatch.setattr("rubhpc.integrate.changing_speed.pieces.MOST_BYTES", 0)
    assert integrate_run_up(used, law, clearance=5e-5, **start).whole.tobytes() == found.whole.tobytes()
    alone = integrate_run_up(fresh, law, clearance=5e-5, **start)
    assert found.contact_fraction.max() > 0.0
    assert found.whole.tobytes() == alone.whole.tobytes()
    assert found.friction_work.tobytes() == alone.friction_work.tobytes()


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"start": 10.0}, "stop: missing; give start, stop and time"),
        ({}, "give either start, stop and time, or a speed_law"),
        ({"start": 0.0, "stop": 10.0, "time": 1.0}, "0 rad/s is out of range"),
        ({"start": 10.0, "stop": 20.0, "time": 1e-3}, "0.00239 of a revolution; give it more time"),
        ({"start": 90.0, "stop": 99.0, "time": 1.0, "speed": 3.0}, "speed: the speed changes; give start"),
        ({"start": 90.0, "stop": 99.0, "time": 1.0, "clearance_ratio": 0.7}, "give clearance"),
        (
            {"start": 90.0, "stop": 99.0, "time": 1.0, "pieces_per_revolution": 3},
            "3 is not a divisor of the 256",
        ),
        ({"start": 90.0, "stop": 99.0, "time": 1.0, "pieces_per_revolution": 2.0}, "2.0 is not a divisor"),
        (DRIVEN | {"pieces_per_revolution": 0}, "0 is not a divisor of the 256"),
        (DRIVEN | {"samples_per_revolution": 8}, "8 is out of range; it must be at least 16"),
    ],
)
def test_what_is_no_run_up_is_refused(keys, says):
    with pytest.raises(InputError, match=says):
        run_up(RIG, **({"clearance": 1e-3} if "clearance_ratio" not in keys else {}), **keys)
