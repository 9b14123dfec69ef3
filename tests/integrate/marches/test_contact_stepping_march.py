"""The modal integrator in short contact steps: its order, several stators, and what it must agree with."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import simulate
from record_distance import MOTIONS
from trial_rig import trial_rig

from rubhpc import LumpedStator
from rubhpc.integrate import case
from rubhpc.integrate.marches.contact_stepping import ContactSteppingMarch
from rubhpc.integrate.scheme import Scheme


@pytest.fixture
def in_steps(monkeypatch):
    """Curved gaps in short steps, as where events follow one another without end."""
    monkeypatch.setitem(case.MARCHES, Scheme.CURVED, ContactSteppingMarch)


RUB = {"speed": 170.0, "clearance": "80 um", "friction": 0.2, "transient": 0, "revolutions": 2}
CLOSE = RUB | {"clearance": "40 um"}
BOUNCING = RUB | {"clearance": "10 um", "restitution": 0.8}


def bouncing_rig():
    """Three stators of 0.1 kg, around half of the rotor."""
    bouncing = LumpedStator(node=3, mass=0.1, stiffness=1e5, damping=5.0)
    return replace(trial_rig(1), stator=tuple(replace(bouncing, angle=angle) for angle in (0.3, 1.1, -0.9)))


def distance(found, known, names=MOTIONS):
    """Greatest rms distance of the signals, over the known one's rms."""

    def apart(name):
        one, other = getattr(found, name), getattr(known, name)
        return np.sqrt(np.mean((one - other) ** 2) / np.mean(other**2))

    return max(apart(name) for name in names)


@pytest.mark.usefixtures("in_steps")
@pytest.mark.parametrize("n_stator", [1, 3])
def test_error_falls_with_the_square_of_the_step(n_stator):
    """Towards the central difference with the updated normal, at a step that leaves 1e-5 of error."""
    rig, given = trial_rig(n_stator), {**(RUB if n_stator == 1 else CLOSE), "normal": "updated"}
    known = simulate(rig, **given, method="central-difference", step="0.125 us")
    assert known.contact_impulse.min() > 0.0
    error = [
        distance(simulate(rig, **given, accuracy=1e-6, step=step), known)
        for step in ("2 us", "1 us", "0.5 us", "0.25 us")
    ]
    order = np.log2(np.divide(error[:-1], error[1:]))
    assert order == pytest.approx(2.0, abs=0.35)
    assert error[-1] < 1e-4


def test_fixed_normal_in_steps_tends_to_the_exact_answer(monkeypatch):
    """What chattering cases fall back on: order two, to the answer with events."""
    rig, given = trial_rig(2), RUB | {"clearance": "60 um"}
    exact = simulate(rig, **given)
    assert exact.contact_impulse.min() > 0.0
    monkeypatch.setitem(case.MARCHES, Scheme.EVENT_DRIVEN, ContactSteppingMarch)
    error = [distance(simulate(rig, **given, step=step), exact) for step in ("2 us", "1 us", "0.5 us")]
    assert error[-1] < 1e-3
    assert np.log2(np.divide(error[:-1], error[1:])) == pytest.approx(2.0, abs=0.35)


@pytest.mark.parametrize("friction_law", ["sliding", "coulomb"])
def test_energy_balances_where_steps_hold_impacts_with_restitution(monkeypatch, friction_law):
    """An impulse works at the instant of its impact; at its beginning 5e-4 would be left."""
    monkeypatch.setitem(case.MARCHES, Scheme.EVENT_DRIVEN, ContactSteppingMarch)
    record = simulate(bouncing_rig(), **BOUNCING, friction_law=friction_law, step="1 us")
    assert record.contacts_per_revolution.sum() > 100
    assert record.energy_residual < 1e-4


@pytest.mark.parametrize("friction_law", ["sliding", "coulomb"])
def test_energy_of_the_central_difference_balances_with_restitution(friction_law):
    """Likewise: at the beginning of its step an impulse would leave 6e-4."""
    given = BOUNCING | {"friction_law": friction_law, "method": "central-difference"}
    record = simulate(bouncing_rig(), **given, step="0.5 us")
    assert record.contacts_per_revolution.sum() > 100
    assert record.energy_residual < 1e-4


@pytest.mark.parametrize("friction_law", ["sliding", "coulomb"])
def test_record_that_begins_in_contact_begins_with_its_acceleration(monkeypatch, friction_law):
    """The force of the first step is half of what holds the gap closed, since it acts at its beginning."""
    given = CLOSE | {"friction_law": friction_law}
    before = simulate(trial_rig(2), **given)
    assert before.final.contact_force.max() > 5.0
    exact = simulate(trial_rig(2), **given, initial=before.final)
    monkeypatch.setitem(case.MARCHES, Scheme.EVENT_DRIVEN, ContactSteppingMarch)
    found = simulate(trial_rig(2), **given, initial=before.final, step="0.25 us")
    size = np.sqrt(np.mean(exact.torsion_acceleration**2))
    assert found.torsion_acceleration[:3] == pytest.approx(exact.torsion_acceleration[:3], abs=1e-2 * size)
