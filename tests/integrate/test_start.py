"""Where cases start: the contact-free motion goes on, a displacement is met, a knock gives its momentum."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, simulate
from set_ups import prepared
from trial_rig import trial_rig

from rubhpc import Bore, read_rig
from rubhpc import simulate as simulate_any
from rubhpc.errors import InputError
from rubhpc.fem.response import contact_free_amplitude
from rubhpc.integrate.setup import prepare
from rubhpc.integrate.start import start_of
from rubhpc.study.initial import Initial
from rubhpc.study.tables import Integrator

SPIN = 220.0  # rad/s
METHODS = {"modal": Integrator(), "central": Integrator(method="central-difference", step=1e-6)}
SHORT = {"transient": 0, "revolutions": 4, "samples_per_revolution": 64, "friction": 0.1}


def setup_of(method: str):
    return prepare(
        trial_rig(2),
        SPIN,
        contact=Contact(),
        integrator=METHODS[method],
        samples_per_revolution=64,
    )


@pytest.mark.parametrize("speed", [150.0, -SPIN])
def test_the_contact_free_motion_needs_no_transient(speed):
    record = simulate(trial_rig(1), speed=speed, clearance="5 mm", initial={"from": "contact_free"}, **SHORT)
    turns = record.signals["vertical"].reshape(4, 64), record.signals["horizontal"].reshape(4, 64)
    size = contact_free_amplitude(prepare_model(speed), speed)
    for turn in turns:
        np.testing.assert_allclose(turn, turn[[0, 0, 0, 0]], atol=1e-6 * size)
    assert np.hypot(*turns).max() <= size * (1 + 1e-6)


def prepare_model(speed: float):
    return prepared(trial_rig(1), speed).model


@pytest.mark.parametrize("method", METHODS)
def test_the_output_node_starts_where_it_is_put(method):
    setup = setup_of(method)
    model = setup.model
    state = start_of(
        Initial(vertical=3e-5, horizontal=-2e-5, vertical_velocity=0.01, horizontal_velocity=0.02),
        setup,
        1e-3,
    )
    rows = [model.rotor.index(model.output_node, name) for name in ("v", "w")]
    np.testing.assert_allclose(state.rotor_displacement[rows] - model.sag[rows], [3e-5, -2e-5], rtol=1e-9)
    np.testing.assert_allclose(state.rotor_velocity[rows], [0.01, 0.02], rtol=1e-9)
    bent = model.rotor.stiffness @ (state.rotor_displacement - model.sag)
    bent[rows] = 0.0  # a force at the output node, and no other
    assert np.abs(bent).max() < 1e-2 * np.abs(model.rotor.stiffness[rows]).max() * 3e-5
    assert not any(u.any() for u in state.stator_displacement)


@pytest.mark.parametrize("node", [None, 2])
def test_a_knock_gives_its_momentum(node):
    setup = setup_of("central")
    rotor = setup.model.rotor
    angle = 0.3
    state = start_of(Initial(impulse=0.2, impulse_angle=angle, impulse_node=node), setup, 1e-3)
    momentum = rotor.mass @ state.rotor_velocity
    at = setup.model.output_node if node is None else node
    for name, share in (("v", math.cos(angle)), ("w", math.sin(angle))):
        row = rotor.index(at, name)
        assert momentum[row] == pytest.approx(0.2 * share)
        momentum[row] = 0.0
    assert np.abs(momentum).max() < 1e-12


def test_a_record_goes_on_from_a_start_without_loss_of_energy():
    record = simulate(
        trial_rig(2),
        speed=SPIN,
        clearance="60 um",
        initial={"impulse": "0.05 N*s", "vertical": 2e-4},
        **SHORT,
    )
    assert record.peak_contact_force.max() > 1.0
    assert record.measures["energy_residual"] < 1e-5


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        ({"from": "still"}, r'\[initial\] from: "still" is not available; choose one of "rest"'),
        ({"form": "rest"}, "form: unknown key; did you mean from"),
        ({"velocty": 0.1}, r"velocty: unknown key; did you mean vertical_velocity\?"),
        ({1: 0.1}, "1: unknown key; choose one of from"),
        ({"impulse_angle": 1.0}, "impulse_angle: there is no impulse; give one"),
        ({"impulse": 1.0, "impulse_node": 99}, "impulse_node: 99 does not move sideways"),
        ({"vertical": "3 kg"}, "vertical: .* is not in m"),
        (5, "initial: 5 is neither a State nor a dict"),
    ],
)
def test_what_cannot_be_is_refused(initial, message):
    with pytest.raises(InputError, match=message):
        simulate("mokhtar2017", speed_ratio=0.75, clearance=1e-4, initial=initial, transient=1, revolutions=1)


def test_a_start_far_beyond_two_bores_touches_both():
    """Forces turn with their normals: the more the farther the shaft would be."""
    bores = [Bore(node=node, radius=0.02, mass=1.0, stiffness=1e7, damping=100.0) for node in (6, 12)]
    rig = replace(read_rig("mokhtar2017"), stator=tuple(bores))
    record = simulate_any(
        rig,
        speed=400.0,
        clearance=1e-4,
        friction=0.0,
        overrides={"rotor.unbalance.mass": 0.1},
        initial={"from": "contact_free"},
        transient=0,
        revolutions=1,
        samples_per_revolution=64,
    )
    assert record.contact_force[:, 0].min() > 100.0
    assert abs(record.energy_residual) < 1e-6


def test_a_start_that_no_clearance_admits_is_refused():
    """Two holes at one node, further apart than both are wide."""
    rig = read_rig("mokhtar2017")
    apart = tuple(Bore(node=8, rigid=True, centre=(height, 0.0)) for height in (3e-5, -3e-5))
    given = {"speed_ratio": 0.99, "friction": 0.1, "transient": 0, "revolutions": 1}
    rig = replace(rig, stator=apart)
    wide = simulate_any(rig, **given, clearance="20 mm").final
    with pytest.raises(
        InputError, match=r"^initial: this state overlaps by .* m, and no start .*; start nearer"
    ):
        simulate_any(rig, **given, clearance="5 um", initial=wide)
