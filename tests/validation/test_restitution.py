"""Impacts with a coefficient of restitution: known answers of oscillators that meet walls and each other."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, simulate
from kernel_case import KernelCase
from lone_bodies import body, set_up, tip
from trial_rig import trial_rig

from rubhpc import Load, LumpedStator, Rig, State
from rubhpc.integrate.case import run_case
from rubhpc.kernels.central_difference.march import FINISHED
from rubhpc.kernels.laws import MULTIPLIER
from rubhpc.rig.reading import with_keys
from rubhpc.rig.rotors import MatrixRotor
from rubhpc.study.study import Recording

WALL = tip(body(1.0, 1.0, ((1, "axial"),)), 0.0, axial=-1)  # it is held


def released(restitution, per_revolution, *, mass=1.0, other=1e12, turns=1):
    """Record of a mass on a spring of as many N/m as it has kg, let go at -3 m/s above a body on none."""
    contact = Contact(restitution=restitution)
    ball = body(mass, mass, ((1, "v"),))
    setup = set_up(ball, [tip(body(other, 0.0, ((1, "axial"),)), math.pi)], 0.5, per_revolution, contact)
    start = replace(State.at_rest(setup.model), rotor_velocity=np.array([-3.0]))
    recording = Recording(transient=0, revolutions=turns, samples_per_revolution=per_revolution)
    return run_case(setup, clearance=1.0, friction=0.0, recording=recording, initial=start)


def test_each_bounce_keeps_its_share_of_the_energy():
    """Three bounces in 4 pi s: the wall, 1 m below, is met at sqrt 8 m/s and then 0.7 times the last."""
    errors = []
    for per_revolution in (2000, 4000):
        record = released(0.7, per_revolution)
        first = math.sqrt(8.0)
        assert record.contacts_per_revolution[0] == 3
        assert record.contact_impulse[0] == pytest.approx(1.7 * first * (1 + 0.7 + 0.49), rel=1e-4)
        energy = record.final.rotor_velocity[0] ** 2 + record.final.rotor_displacement[0] ** 2
        errors.append(abs(energy - (1 + 8 * 0.7**6)))
    assert errors[0] < 2e-4
    assert errors[1] < 0.5 * errors[0]


def test_full_restitution_returns_all():
    record = released(1.0, 4000, turns=5)
    energy = record.final.rotor_velocity[0] ** 2 + record.final.rotor_displacement[0] ** 2
    assert record.contacts_per_revolution[0] > 1
    assert energy == pytest.approx(9.0, rel=1e-4)


@pytest.mark.parametrize("restitution", [0.3, 0.9])
def test_two_bodies_share_momentum(restitution):
    """Newton's cradle of two: 2 kg meet 0.5 kg."""
    record = released(restitution, 4000, mass=2.0, other=0.5)
    arrives = math.sqrt(8.0)
    common = 2.0 * arrives / 2.5
    leaves = common + restitution * arrives * 2.0 / 2.5
    assert record.contacts_per_revolution[0] == 1
    assert record.final.stator_velocity[0][0] == pytest.approx(leaves, rel=1e-6)
    assert record.contact_impulse[0] == pytest.approx(0.5 * leaves, rel=1e-6)


def test_no_restitution_is_the_multiplier():
    plain, zero = released(None, 1000), released(0.0, 1000)
    assert np.array_equal(plain.vertical, zero.vertical)
    assert np.array_equal(plain.contact_force, zero.contact_force)


def bounces(restitution, pull, height, duration):
    """Impulse, N s, on a wall of 1 kg on a spring of 1 N/m, and when it has come to rest, s.

    The spring pulls with `pull` (N) at the wall. Each impact leaves a share of the speed of the one before.
    """
    speed, time = math.sqrt((pull + height) ** 2 - pull**2), math.acos(pull / (pull + height))
    impulse = speed
    while speed > 1e-15:
        speed *= restitution
        time += 2 * math.atan(speed / pull)
        impulse += speed + (speed if speed > 1e-15 else 0.0)
    return impulse + pull * (duration - time), time


@pytest.mark.parametrize("n_wall", [1, 2])
@pytest.mark.parametrize("law", [{}, {"normal": "updated"}])  # closed form, collocation
@pytest.mark.parametrize(("restitution", "mass"), [(0.0, 1.0), (0.3, 1.0), (0.5, 1e4), (0.9, 1.0)])
def test_mass_comes_to_rest_on_a_wall_far_above_its_sag(restitution, mass, law, n_wall):
    """On 1 N/m a kilogram sags by 9.81 m; the wall is 1 m below the spring's end, another 6 m above."""
    rotor = MatrixRotor(
        mass=[[mass]],
        stiffness=[[mass]],
        degrees=((1, "v"),),
        load=(Load(node=1, vertical=-9.81 * mass),),
    )
    walls = (
        LumpedStator(node=1, angle=math.pi, radius=100.0, rigid=True),
        LumpedStator(node=1, radius=100.0, rigid=True, clearance_offset=5.0),
    )
    record = simulate(
        Rig(name="ball", rotor=rotor, stator=walls[:n_wall]),
        speed=2 * math.pi,
        clearance=1.0,
        friction=0.0,
        restitution=restitution,
        initial={"vertical": 0.2},
        transient=0,
        revolutions=6,
        **law,
    )
    impulse, time = bounces(restitution, 8.81, 0.2, 6.0)
    assert record.left_closed_form == 0
    assert record.contact_impulse[0] == pytest.approx(mass * impulse / 6, rel=1e-9)
    rests = int(256 * time) + 2
    fades = 1e-12 if record.scheme == 0 else 1e-9  # by collocation the gap goes to zero in some steps
    assert record.vertical[rests:] == pytest.approx(np.full(6 * 256 - rests, -1.0), abs=fades)
    assert record.contact_force[0, rests:] == pytest.approx(np.full(6 * 256 - rests, 8.81 * mass))


@pytest.mark.parametrize("elements", [2, 12])
@pytest.mark.parametrize("restitution", [0.2, 0.8])
def test_impact_on_a_meshed_stator_reverses_the_pair_and_moves_all_by_one_impulse(elements, restitution):
    """Moreau's law of the discrete bodies: v+ = -e v- of the pair, M dv = P p for every degree."""
    rig = with_keys(
        trial_rig(1, elements=elements), {"rotor.unbalance.mass": 0.0, "stator.damping.beta": 0.0}
    )
    law = MULTIPLIER._replace(restitution=restitution)
    case = KernelCase.of(rig, 300.0, 200_000, clearance=2e-5, friction=0.1, law=law)
    row = case.packed.degree_row[0]
    case.state[1, row[:2]] = 0.1 * np.cos(0.3), 0.1 * np.sin(0.3)  # the rim's node, towards the stator
    for i in range(20_000):
        (u, before), gap_jacobian = case.state.copy(), case.work.gap_jacobian[0]
        assert case.advance(i, i + 1) == FINISHED
        if case.work.force[0] > 0.0:
            break
    after, step, packed = case.state[1], case.step, case.packed
    arrives = -gap_jacobian @ before[row]
    assert arrives > 0.01
    assert gap_jacobian @ after[row] == pytest.approx(restitution * arrives, abs=2e-3 * arrives)
    given = packed.mass @ (after - before) / step + packed.stiffness @ u
    given += packed.damping @ (after + before) / 2
    expected = np.zeros_like(given)
    expected[row] = case.work.force_direction[0] * case.work.force[0]
    assert given == pytest.approx(expected, abs=1e-6 * expected.max())
    unit = np.zeros_like(given)
    unit[row] = case.work.force_direction[0]
    yields = gap_jacobian @ np.linalg.solve(packed.mass, unit)[row]
    assert case.work.force[0] * step == pytest.approx((1 + restitution) * arrives / yields, rel=5e-3)
