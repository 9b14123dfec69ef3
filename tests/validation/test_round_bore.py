"""Round bores against closed forms: synchronous rub, its folds and onset of whirl, dry whirl, rolling.

A rotor with the receptance a(w) at its rim, in a hole with the receptance b(w), presses with the force N on
the direction n from the hole's centre: `(a + b) N (1 + i f) n + (c + N / k) n = free motion`, with f the
friction force over N, positive where the rim slides forward, c the clearance and k the penalty (H. F. Black,
J. Mech. Eng. Sci. 10 (1968) 1-12). Steady rubs are its solutions with the frequency of the spin, dry whirl
those without a free motion.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from rubhpc import Bore, Rig, Unbalance, assemble, branch, read_rig, simulate
from rubhpc.integrate.record import State
from rubhpc.schema import RUB_KIND

PACKAGED = read_rig("mokhtar2017")
# Units of the classical ring: mass, stiffness of the ring, eccentricity; frequencies in PACE.
MASS, STIFFNESS, LENGTH = 1.0, 1e6, 1e-4
PACE = math.sqrt(STIFFNESS / MASS)
SHAFT, DAMPING, GAP = 0.04, 0.1, 1.05
WALL = Bore(node=1, rigid=True, radius=0.05)
RING = {"law": "penalty", "stiffness": STIFFNESS, "normal": "updated", "clearance": GAP * LENGTH}
HARD = {"normal": "updated", "clearance": GAP * LENGTH}
BARE = {"keep": (), "samples_per_revolution": 64}


def jeffcott(*stators, eccentricity=1.0):
    return Rig.from_matrices(
        MASS * np.eye(2), DAMPING * math.sqrt(STIFFNESS * MASS) * np.eye(2), SHAFT * STIFFNESS * np.eye(2),
        degrees=[(1, "v"), (1, "w")],
        stators=stators or [WALL],
        unbalance=[Unbalance(node=1, mass=MASS, radius=LENGTH * eccentricity)],
    )  # fmt: skip


def sprung(mass=0.02, damping=0.05):
    """A hole on springs as stiff as the classical ring."""
    return Bore(
        node=1,
        mass=mass * MASS,
        stiffness=STIFFNESS,
        damping=damping * math.sqrt(STIFFNESS * MASS),
        radius=0.05,
    )


def rotor_receptance(w):
    return 1.0 / (SHAFT - w * w + 1j * DAMPING * w)


def hole_receptance(w, mass=0.02, damping=0.05):
    return 1.0 / (1.0 - mass * w * w + 1j * damping * w)


def balance(radius, w, friction):
    """Zero at a synchronous rub of the ring that yields along its normal only."""
    pressed = 1.0 - GAP / radius
    turned = (SHAFT + pressed - w * w) ** 2 + (DAMPING * w + friction * pressed) ** 2
    return turned - w**4 / radius**2


def yielding(w, friction):
    """Radii of these rubs, the larger first."""
    at = np.linspace(GAP, 6.0, 20001)
    signs = np.flatnonzero(np.diff(np.sign(balance(at, w, friction))))
    return [brentq(balance, at[i], at[i + 1], (w, friction), xtol=1e-14) for i in signs[::-1]]


@pytest.mark.parametrize(("speed", "friction"), [(0.3, 0.0), (0.45, 0.05), (0.6, 0.1)])
def test_synchronous_rub_of_the_ring_that_yields_along_its_normal(speed, friction):
    record = simulate(jeffcott(), speed=speed * PACE, friction=friction, transient=120, revolutions=2, **RING)
    (radius,) = yielding(speed, friction)
    assert np.hypot(record.vertical, record.horizontal) / LENGTH == pytest.approx(radius, rel=1e-4)
    assert record.contact_force == pytest.approx(STIFFNESS * LENGTH * (radius - GAP), rel=1e-3)
    assert RUB_KIND[record.rub_kind[0]] == "forward"
    assert record.whirl_frequency == pytest.approx(speed * PACE, rel=1e-5)
    assert record.contact_fraction == pytest.approx(1.0)
    assert record.contact_arc == pytest.approx(2 * math.pi)
    assert record.period == 1
    work = friction * record.contact_impulse * PACE * speed * (0.05 + radius * LENGTH)
    assert record.friction_work == pytest.approx(work, rel=1e-2, abs=1e-12)


def circling(w, rotor, force, hole=None, overlap=0.0):
    """State of circles with the frequency w at angle 0: complex radii of rotor and hole, in LENGTH."""
    pace, of_hole = 1j * w * PACE, [] if hole is None else [hole.real, hole.imag]
    at_hole = [] if hole is None else [(pace * hole).real, (pace * hole).imag]
    return State(
        rotor_displacement=LENGTH * np.array([rotor.real, rotor.imag]),
        rotor_velocity=LENGTH * np.array([(pace * rotor).real, (pace * rotor).imag]),
        stator_displacement=(LENGTH * np.array(of_hole),),
        stator_velocity=(LENGTH * np.array(at_hole),),
        contact_force=STIFFNESS * LENGTH * np.array([force]),
        overlap=LENGTH * np.array([overlap]),
    )


def synchronous_state(w, friction, radius):
    """State of the synchronous rub of the ring that yields along its normal."""
    pressed = 1.0 - GAP / radius
    turned = SHAFT + pressed - w * w + 1j * (DAMPING * w + friction * pressed)
    return circling(w, w * w / turned, radius - GAP, overlap=radius - GAP)


def upper_fold(friction):
    """Highest speed of a synchronous rub of that ring."""

    def least(w):
        options = {"xatol": 1e-10}
        return minimize_scalar(
            balance, args=(w, friction), bounds=(1.5, 6.0), method="bounded", options=options
        )

    return brentq(lambda w: least(w).fun, 0.9, 1.1, xtol=1e-12)


@pytest.mark.parametrize(("friction", "known"), [(0.0, 1.0062), (0.05, 0.9996), (0.1, 0.9930), (0.2, 0.9802)])
def test_upper_fold(friction, known):
    fold = upper_fold(friction)
    assert fold == pytest.approx(known, abs=1.5e-4)
    start = fold - 0.01
    (found,) = branch(
        jeffcott(), along="speed", start=start * PACE, stop=1.05 * PACE, friction=friction, **BARE, **RING,
        initial=synchronous_state(start, friction, yielding(start, friction)[0]), largest_step=0.004 * PACE,
    )  # fmt: skip
    assert [name for name, _ in found.events()] == ["fold"]
    assert found.events()[0][1] == pytest.approx(fold * PACE, rel=1e-6)
    assert found.values[-1] == found.values[0]


def test_rub_becomes_unstable_to_a_backward_whirl():
    """At W = 0.2893, with s = 1.1432 i in the frame that turns with the shaft."""
    friction = 0.2

    def slowest(w):
        (radius,) = yielding(w, friction)
        pressed = 1.0 - GAP / radius
        c, k = DAMPING, SHAFT - w * w
        first, second = ([1.0, c, k + 1.0], [1.0, c, k + pressed])
        third, fourth = ([2 * w, c * w + friction * pressed], [2 * w, c * w + friction])
        roots = np.roots(np.polyadd(np.polymul(first, second), np.polymul(third, fourth)))
        return roots[roots.real.argmax()]

    known = brentq(lambda w: slowest(w).real, 0.2, 0.4)
    assert known == pytest.approx(0.2893, abs=5e-5)
    assert abs(slowest(known).imag) == pytest.approx(1.1432, abs=5e-5)
    (found,) = branch(
        jeffcott(), along="speed", start=0.28 * PACE, stop=0.3 * PACE, friction=friction, **BARE, **RING
    )
    ((name, at),) = found.events()
    assert (name, at) == ("neimark_sacker", pytest.approx(known * PACE, rel=1e-5))
    (point,) = [point for point in found.points if point.event == name]
    turn = abs(slowest(known).imag) / known * 2 * math.pi
    assert np.exp(1j * turn).real == pytest.approx(point.multipliers[0].real, abs=1e-4)


@pytest.mark.parametrize("is_rubbing", [True, False])
def test_rub_and_motion_without_contact_meet_at_grazing(is_rubbing):
    """Both are there above the speed at which that motion reaches the ring; the rub is unstable."""
    reached = brentq(lambda w: abs(rotor_receptance(w)) * w * w - GAP, 0.5, 1.0)
    assert reached == pytest.approx(0.85401, abs=5e-6)
    start = synchronous_state(0.87, 0.1, yielding(0.87, 0.1)[-1]) if is_rubbing else {"from": "contact_free"}
    (found,) = branch(
        jeffcott(), along="speed", start=0.87 * PACE, stop=0.84 * PACE, friction=0.1, initial=start, **BARE,
        **RING, largest_step=0.01 * PACE,
    )  # fmt: skip
    ((name, at),) = found.events()
    assert (name, at) == ("grazing", pytest.approx(reached * PACE, rel=1e-6))
    assert found.end == "the range ends"
    assert found.values[-1] == found.values[0]
    assert list(found.is_stable[[0, -1]]) == [not is_rubbing, is_rubbing]


@pytest.mark.parametrize(("friction", "known", "over"), [(0.2, 0.570156, 1.39875), (0.3, 0.427008, 1.16596)])
def test_dry_whirl_is_a_threshold(friction, known, over):
    """Without unbalance: starts nearer decay, others grow; m w2 - k over c w is 1 / f."""
    w = brentq(lambda w: friction * (w * w - SHAFT) - DAMPING * w, 0.2, 2.0)
    radius = GAP / (1.0 + SHAFT - w * w)
    assert (w, radius / GAP) == (pytest.approx(known, abs=5e-7), pytest.approx(over, abs=5e-6))
    for share in (0.995, 1.0, 1.005):
        began = share * radius
        start = circling(-w, began + 0j, began - GAP, overlap=began - GAP)
        record = simulate(
            jeffcott(eccentricity=0.0), speed=w * PACE, friction=friction, transient=0, revolutions=2,
            initial=start, **RING,
        )  # fmt: skip
        away = np.hypot(record.vertical[-1], record.horizontal[-1]) / LENGTH / radius - 1.0
        assert RUB_KIND[record.rub_kind[0]] == "backward_slipping"
        if share == 1.0:
            assert abs(away) < 1e-5
            assert record.whirl_frequency == pytest.approx(-w * PACE, rel=1e-5)
        else:
            assert away / (share - 1.0) > 1.2


@pytest.mark.parametrize(("speed", "friction"), [(0.5, 0.05), (0.8, 0.0)])
def test_synchronous_rub_in_a_hole_that_moves_both_ways(speed, friction):
    record = simulate(
        jeffcott(sprung()), speed=speed * PACE, friction=friction, transient=80, revolutions=1, **HARD
    )
    both = rotor_receptance(speed) + hole_receptance(speed)
    force = max(synchronous(speed, friction, both), key=lambda found: found.real).real
    pushed = abs(hole_receptance(speed) * (1 + 1j * friction)) * force
    assert record.contact_force == pytest.approx(STIFFNESS * LENGTH * force, rel=1e-3)
    assert np.hypot(record.stator_axial, record.stator_lateral) / LENGTH == pytest.approx(pushed, rel=1e-3)
    hole = record.stator_axial[0] + 1j * record.stator_lateral[0]
    apart = record.vertical + 1j * record.horizontal - hole
    assert abs(apart) / LENGTH == pytest.approx(GAP, rel=1e-4)
    push = record.contact_force_vertical[0] + 1j * record.contact_force_horizontal[0]
    expected = -STIFFNESS * LENGTH * force * (1 + 1j * friction) * apart / abs(apart)
    late = np.exp(-0.5j * speed * PACE * 2 * math.pi / (speed * PACE) / 256)
    assert push * late == pytest.approx(expected, rel=2e-3)


def synchronous(w, friction, compliance):
    """Forces of both rubs of a hard hole at the speed w; complex or negative ones are none."""
    free, turned = abs(rotor_receptance(w)) * w * w, compliance * (1 + 1j * friction)
    return np.roots([abs(turned) ** 2, 2.0 * GAP * turned.real, GAP**2 - free**2])


def steady(w, friction, hole):
    """Force, and radii of rotor and hole, of a whirl with the signed frequency w and force ratio."""
    turned = [receptance * (1 + 1j * friction) for receptance in (rotor_receptance(w), hole(w))]
    force = GAP / abs(sum(turned))
    return force, -turned[0] * force, turned[1] * force


@pytest.mark.parametrize(("known", "over"), [(0.514193, 1.28649), (0.733838, 1.97307)])
def test_dry_whirl_in_a_hole_that_moves_both_ways(known, over):
    """Two of them at f = 0.3; none below 0.27929, where they meet."""

    def light(w):
        return hole_receptance(w, mass=1e-4, damping=0.0)

    def missing(w, friction=0.3):
        return ((rotor_receptance(-w) + light(-w)) * (1 + 1j * friction)).imag

    w = brentq(missing, known - 0.02, known + 0.02)
    force, rotor, hole = steady(-w, 0.3, light)
    assert (w, abs(rotor) / GAP) == (pytest.approx(known, rel=2e-4), pytest.approx(over, rel=2e-4))
    at = np.linspace(0.4, 0.9, 101)
    needed = -(rotor_receptance(-at) + light(-at)).imag / (rotor_receptance(-at) + light(-at)).real
    assert np.where(needed > 0, needed, np.inf).min() == pytest.approx(0.27929, rel=2e-4)
    record = simulate(
        jeffcott(sprung(mass=1e-4, damping=0.0), eccentricity=0.0), speed=w * PACE, friction=0.3,
        transient=0, revolutions=1, initial=circling(-w, rotor, force, hole), **HARD,
    )  # fmt: skip
    assert np.hypot(record.vertical, record.horizontal) / LENGTH == pytest.approx(abs(rotor), rel=1e-4)
    assert record.whirl_frequency == pytest.approx(-w * PACE, rel=1e-4)
    assert record.contact_force == pytest.approx(force * STIFFNESS * LENGTH, rel=1e-3)
    assert RUB_KIND[record.rub_kind[0]] == "backward_slipping"


def test_rolling_around_a_hole():
    """With the frequency of the rim over the clearance, and the friction that it needs."""
    spin, w = 0.5, -0.8
    force, rotor, _ = steady(w, 0.0, lambda _: 0.0)
    rolls = -rotor_receptance(w).imag / rotor_receptance(w).real
    assert 0.1 < rolls < 0.2
    force, rotor, _ = steady(w, rolls, lambda _: 0.0)
    wall = replace(WALL, radius=-w * GAP * LENGTH / spin)
    case = {"friction": 0.2, "friction_law": "coulomb", "transient": 0, "revolutions": 2} | HARD
    start = circling(w, rotor, force)
    record = simulate(jeffcott(wall, eccentricity=0.0), speed=spin * PACE, initial=start, **case)
    assert RUB_KIND[record.rub_kind[0]] == "rolling"
    assert record.whirl_frequency == pytest.approx(w * PACE, rel=1e-4)
    assert record.stick_fraction == pytest.approx(1.0)
    assert record.contact_force == pytest.approx(force * STIFFNESS * LENGTH, rel=1e-3)


def test_rub_of_a_rotor_with_discs_is_that_of_its_receptance():
    """Gyroscopics, a heavy hole on unequal springs: harmonic balance of both whirls; isotropic here."""
    hole = Bore(node=8, mass=1.5, stiffness=4e6, damping=200.0)
    rig = replace(PACKAGED, stator=(hole,))
    case = {"speed_ratio": 1.4, "clearance_ratio": 0.7, "friction": 0.05}
    record = simulate(rig, transient=150, revolutions=1, normal="updated", **case)
    model = assemble(rig)
    spin, body = record.spin_speed, model.rotor
    matrix = body.stiffness + 1j * spin * (body.damping + spin * body.gyroscopic) - spin**2 * body.mass
    v, w = (body.index(8, name) for name in "vw")
    force = np.zeros(body.n_dof, dtype=complex)
    force[v], force[w] = 1.0, -1j
    rotor = np.linalg.solve(matrix, force)[v]
    free = abs(np.linalg.solve(matrix, spin**2 * (model.unbalance_cosine - 1j * model.unbalance_sine))[v])
    both = (rotor + 1.0 / (4e6 - 1.5 * spin**2 + 200j * spin)) * (1 + 0.05j)
    roots = np.roots([abs(both) ** 2, 2 * record.clearance * both.real, record.clearance**2 - free**2])
    assert record.contact_force == pytest.approx(max(roots.real), rel=1e-3)
    assert RUB_KIND[record.rub_kind[0]] == "forward"
