"""The conventional contact law: known answers of spring and damper, and the limit of the multiplier."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, simulate
from lone_bodies import body, set_up, set_up_modal, tip

from rubhpc import State
from rubhpc.integrate.case import run_case
from rubhpc.study.study import Recording

MASS, STIFFNESS, SPEED = 2.0, 1e6, 1.5  # kg, N/m, m/s


def thrown(scheme, damping=None):
    """Record of a mass, on a spring too soft to matter, thrown at a held wall with a penalty."""
    contact = Contact(law="penalty", stiffness=STIFFNESS, damping=damping)
    mass, wall = body(MASS, 1e-3, ((1, "v"),)), tip(body(1.0, 1.0, ((1, "axial"),)), 0.0, axial=-1)
    spin, per_revolution = 2 * math.pi / 0.02, 20_000
    make = set_up if scheme == "central-difference" else set_up_modal
    setup = make(mass, [wall], spin, per_revolution, contact)
    start = replace(State.at_rest(setup.model), rotor_velocity=np.array([SPEED]))
    recording = Recording(transient=0, revolutions=1, samples_per_revolution=per_revolution)
    return run_case(setup, clearance=1e-3, friction=0.0, recording=recording, initial=start)


@pytest.mark.parametrize("scheme", ["central-difference", "modal"])
def test_spring_returns_all(scheme):
    record = thrown(scheme)
    assert record.peak_contact_force[0] == pytest.approx(SPEED * math.sqrt(STIFFNESS * MASS), rel=1e-4)
    assert record.contact_duration[0] == pytest.approx(math.pi * math.sqrt(MASS / STIFFNESS), rel=2e-3)
    assert record.final.rotor_velocity[0] == pytest.approx(-SPEED, rel=1e-6)
    assert record.contact_force.min() == 0.0
    assert record.energy_residual < 1e-5


@pytest.mark.parametrize("scheme", ["central-difference", "modal"])
@pytest.mark.parametrize("ratio", [0.1, 0.4])
def test_damper_never_pulls(scheme, ratio):
    """Released where the force ends, not the gap (T. Schwager, T. Poeschel, Granul. Matter 9 (2007) 465)."""
    natural = math.sqrt(STIFFNESS / MASS)
    record = thrown(scheme, damping=2 * ratio * natural * MASS)
    decay, damped = ratio * natural, natural * math.sqrt(1 - ratio**2)
    duration = (math.pi - math.atan2(2 * decay * damped, damped**2 - decay**2)) / damped
    assert record.contact_duration[0] == pytest.approx(duration, rel=2e-3)
    assert record.final.rotor_velocity[0] == pytest.approx(-SPEED * math.exp(-decay * duration), rel=1e-3)
    assert record.contact_force.min() == 0.0


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_stiff_penalty_tends_to_the_multiplier(normal):
    """Against a stator that yields itself the error goes as one over the contact stiffness."""
    given = {"speed_ratio": 0.75, "clearance": "100 um", "transient": 0, "revolutions": 1, "normal": normal}
    steps = {"method": "central-difference", "step": "2 us"}
    exact = simulate("mokhtar2017", **given, **steps)
    apart = []
    for stiffness in ("1e8 N/m", "1e9 N/m"):
        record = simulate("mokhtar2017", **given, **steps, law="penalty", stiffness=stiffness)
        apart.append(abs(record.vertical - exact.vertical).max() / abs(exact.vertical).max())
    assert apart[0] < 1e-2
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.2)
