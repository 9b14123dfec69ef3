"""Dry friction with known answers: oscillators on still and moving rims, bodies that stick, dry whip."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from closed_form import Contact, read_rig, simulate
from equal_stators import in_ring
from lone_bodies import body, set_up, set_up_modal, tip

from rubhpc import State
from rubhpc.integrate.case import run_case
from rubhpc.schema import DIVERGED, DONE
from rubhpc.study.study import Recording

COULOMB = Contact(friction_law="coulomb")
PRESSED = 10.0  # N, by which the rotor's vertical spring presses it onto a stator that is held


def pressed_onto_a_rim(
    contact, friction, rim_speed, scheme, *, horizontal, velocity, duration, per_revolution=2000, step=2e-6
):
    """Record and stiffness of 1 kg on 100 N/m that rubs, horizontally, on a stator that is held above it."""
    mass, stiffness = np.diag([1.0, 1.0]), np.diag([1e4, 100.0])
    rotor = body(mass, stiffness, ((1, "v"), (1, "w")))
    spin = 2 * math.pi / duration
    held = tip(body(1.0, 1.0, ((1, "axial"),)), 0.0, radius=rim_speed / spin, axial=-1)
    make = (
        partial(set_up, steps_per_sample=5)
        if scheme == "central-difference"
        else partial(set_up_modal, step=step)
    )
    setup = make(rotor, [held], spin, per_revolution, contact)
    start = replace(
        State.at_rest(setup.model),
        rotor_displacement=np.array([-PRESSED / 1e4, horizontal]),
        rotor_velocity=np.array([0.0, velocity]),
        contact_force=np.array([PRESSED]),
    )
    return run_case(
        setup,
        clearance=-PRESSED / 1e4,  # the stator stands where it presses the spring together
        friction=friction,
        recording=Recording(transient=0, revolutions=1, samples_per_revolution=per_revolution),
        initial=start,
    )


@pytest.mark.parametrize("scheme", ["central-difference", "modal"])
def test_oscillation_decays_in_a_straight_line_and_stops(scheme):
    """Each half swing is 2 mu N / k shorter; it stops once a swing ends within mu N / k of the middle."""
    shift = 0.3 * PRESSED / 100.0  # 30 mm
    record = pressed_onto_a_rim(COULOMB, 0.3, 0.0, scheme, horizontal=0.2, velocity=0.0, duration=3.0)
    half = math.pi / 10.0
    for i, amplitude in enumerate([0.2, 0.14, 0.08, 0.02]):
        at = round(i * half / 3.0 * 2000)
        assert record.horizontal[at] == pytest.approx((-1) ** i * amplitude, abs=2e-5)
    assert record.horizontal[1000:] == pytest.approx(np.full(1000, -0.02), abs=1e-5)  # stuck within 30 mm
    assert abs(np.diff(record.horizontal[1000:])).max() < 1e-14
    assert abs(record.horizontal[-1]) < shift
    assert record.contact_impulse[0] == pytest.approx(3.0 * PRESSED, rel=1e-6)
    lost = 0.5 * 100.0 * (0.2**2 - 0.02**2)
    assert record.friction_work[0] == pytest.approx(lost, rel=1e-5)
    assert record.energy_residual < 1e-4


@pytest.mark.parametrize("scheme", ["central-difference", "modal"])
def test_stick_and_slip_on_a_moving_rim(scheme):
    """Sticking ends at mu_s N / k, sliding swings around mu N / k: period and amplitude in closed form."""
    rim, friction, ratio, omega = 0.1, 0.2, 2.0, 10.0
    contact = Contact(friction_law="coulomb", static_friction_ratio=ratio)
    record = pressed_onto_a_rim(
        contact, friction, rim, scheme, horizontal=0.0, velocity=rim, duration=6.0, per_revolution=6000
    )
    middle, over = friction * PRESSED / 100.0, (ratio - 1) * friction * PRESSED / 100.0
    amplitude = math.hypot(over, rim / omega)
    w = record.horizontal  # t = x_hat x e is +z: the rotor drags against the rim's way
    assert w.max() < 0.0 or w.min() < 0.0
    assert -w.min() == pytest.approx(middle + amplitude, rel=1e-4)
    sliding = (math.pi + 2 * math.atan2(rim / omega, over)) / omega
    sticking = 2 * over / rim
    tops = np.flatnonzero((w[1:-1] < w[:-2]) & (w[1:-1] <= w[2:])) * 1e-3
    assert np.diff(tops) == pytest.approx(np.full(len(tops) - 1, sliding + sticking), abs=2.1e-3)
    assert len(tops) > 5
    assert record.minimum_slip_speed[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scheme", ["central-difference", "modal"])
def test_slip_is_stopped_by_all_that_it_moves(scheme):
    """Disc (horizontal and torsion) and tip (lateral) come to stick: r th' + w' of the rim is the tip's l'.

    The impulse that stops the slip is the slip over 1/m + r^2/I + 1/m_l, whatever the friction that gives it.
    """
    masses, inertia, lateral, radius = 2.0, 1e-3, 0.5, 0.06
    mass, soft = np.diag([masses, masses, inertia]), np.diag([2e4, 1e-3, 1e-3])
    rotor = body(mass, soft, ((1, "v"), (1, "w"), (1, "thx")))
    mount = body(np.diag([0.1, lateral]), np.diag([1e7, 1e-3]), ((1, "axial"), (1, "lateral")))
    spin, per_revolution = 10.0, 60_000
    make = partial(set_up, steps_per_sample=5) if scheme == "central-difference" else set_up_modal
    setup = make(rotor, [tip(mount, 0.0, radius=radius, lateral=1)], spin, per_revolution, COULOMB)
    start = replace(
        State.at_rest(setup.model),
        rotor_displacement=np.array([5e-3, 0.0, 0.0]),
        rotor_velocity=np.array([1.0, 0.4, -60.0]),
    )
    recording = Recording(transient=0, revolutions=1, samples_per_revolution=per_revolution)
    record = run_case(setup, clearance=5e-3 + 1e-6, friction=0.8, recording=recording, initial=start)
    dt = 2 * math.pi / spin / per_revolution
    touching = np.flatnonzero(record.contact_force[0] > 0)
    last = touching[np.flatnonzero(np.diff(touching) > 1)[0]] - 3  # towards the end of the first contact
    w, twist, side = (
        np.diff(x)[last] / dt for x in (record.horizontal, record.torsion, record.stator_lateral[0])
    )
    slip = radius * (spin - 60.0) + 0.4
    impulse = -slip / (1 / masses + radius**2 / inertia + 1 / lateral)
    allowed = 1e-9 if scheme == "central-difference" else 1e-6  # the accuracy of its steps
    assert radius * (spin + twist) + w - side == pytest.approx(0.0, abs=allowed)
    assert w == pytest.approx(0.4 + impulse / masses, rel=1e-3)
    assert twist == pytest.approx(-60.0 + radius * impulse / inertia, rel=1e-3)
    assert side == pytest.approx(-impulse / lateral, rel=1e-3)


def test_dry_whip_diverges_in_steady_sliding_and_settles_under_coulombs_law():
    ring = in_ring(read_rig("mokhtar2017"), 3)
    given = {"speed_ratio": 0.75, "clearance": "60 um", "friction": 0.3, "keep": "waveform"}
    assert simulate(ring, **given, transient=0, revolutions=20).status == DIVERGED
    steps = {"method": "central-difference", "step": "2 us", "friction_law": "coulomb"}
    start = simulate(ring, **given, **steps, transient=0, revolutions=2)
    assert np.abs(start.vertical + 1j * start.horizontal).max() < 0.5e-3
    # Fewer than have their regime measured.
    whip = simulate(ring, **given, **steps, transient=8, revolutions=12)
    assert whip.status == DONE
    orbit = np.abs(whip.vertical + 1j * whip.horizontal).reshape(12, -1).max(axis=1)
    assert orbit[-4:] == pytest.approx(np.full(4, orbit[-1]), rel=0.1)  # no longer growing
    assert orbit[-1] < 2e-3
    assert whip.minimum_slip_speed.max() < 0.0  # the rim rolls and slips backwards
    assert whip.energy_residual < 1e-3


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_ordinary_rub_is_that_of_steady_sliding(normal):
    given = {"speed_ratio": 0.75, "clearance": "100 um", "transient": 2, "revolutions": 2, "normal": normal}
    # All modes, since Coulomb's law keeps more than steady sliding.
    for method in ({"method": "central-difference", "step": "2 us"}, {"accuracy": 1e-8}):
        sliding, coulomb = (
            simulate("mokhtar2017", **given, **method, friction_law=law) for law in ("sliding", "coulomb")
        )
        assert sliding.minimum_slip_speed.min() > 0.0
        share = 1e-9 if "method" in method else 1e-4
        for name in ("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral"):
            one, other = getattr(sliding, name), getattr(coulomb, name)
            assert other == pytest.approx(one, rel=0, abs=share * abs(one).max()), (name, method)
