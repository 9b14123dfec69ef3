"""The modal integrator in short contact steps: its order, several stators, and what it must agree with."""

from itertools import pairwise

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc import simulate
from rubhpc.integrate import case
from rubhpc.integrate.contact_stepping_march import ContactSteppingMarch
from rubhpc.integrate.setup import Scheme
from rubhpc.rig.reading import with_keys

RUB = {"speed": 170.0, "clearance": "80 um", "friction": 0.2, "transient": 0, "revolutions": 2}
CLOSE = RUB | {"clearance": "40 um"}
MOTIONS = ("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral")


def distance(found, known, names=MOTIONS):
    """Greatest rms distance of the signals, over the known one's rms."""

    def apart(name):
        one, other = getattr(found, name), getattr(known, name)
        return np.sqrt(np.mean((one - other) ** 2) / np.mean(other**2))

    return max(apart(name) for name in names)


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


@pytest.mark.parametrize("n_stator", [1, 3])
def test_closed_gaps_are_closed_and_forces_press(n_stator):
    """Curved gaps from the samples, in the complex plane: none penetrates by more than rounding."""
    rig = trial_rig(n_stator)
    record = simulate(
        rig, **(CLOSE | {"revolutions": 1}), normal="updated", samples_per_revolution=4096, keep=("waveform",)
    )
    axis = np.exp(1j * np.array([stator.angle for stator in rig.stator]))[:, np.newaxis]
    tip = (0.06 + 40e-6 + record.stator_axial + 1j * record.stator_lateral) * axis
    gap = abs(tip - (record.vertical + 1j * record.horizontal)) - 0.06
    assert gap.min() >= -1e-12
    assert record.contact_force.min() >= 0.0
    # In contact from this sample to the next: closed at both ends.
    held = (record.contact_force[:, :-1] > 0.0) & (record.contact_force[:, 1:] > 0.0)
    before = np.roll(held, 1, axis=1) & held
    assert np.count_nonzero(before) > 50
    assert np.median(abs(gap[:, :-1][before])) <= 1e-12


def test_without_lateral_freedom_normals_turn_with_the_disc_alone():
    rig = trial_rig(2, lateral=False)
    given = CLOSE | {"normal": "updated"}
    found = simulate(rig, **given)
    known = simulate(rig, **given, method="central-difference", step="0.25 us")
    assert distance(found, known, MOTIONS[:4]) < 2e-4
    assert not found.stator_lateral.any()


def test_reversed_spin_mirrors_the_motion():
    """Upright stator, and bearings that are not coupled, with the unbalance on the mirror's axis."""
    rig = with_keys(trial_rig(1), {"stator.angle": 0.0, "rotor.unbalance.phase": 0.0})
    forward, backward = (
        simulate(rig, **(RUB | {"speed": speed}), normal="updated") for speed in (170.0, -170.0)
    )
    for name, sign in (("vertical", 1), ("stator_axial", 1), ("contact_force", 1), ("horizontal", -1)):
        one, other = getattr(backward, name), sign * getattr(forward, name)
        assert one == pytest.approx(other, rel=0, abs=1e-8 * abs(other).max()), name
    assert backward.torsion == pytest.approx(-forward.torsion, rel=0, abs=1e-8 * abs(forward.torsion).max())
    assert backward.friction_work == pytest.approx(forward.friction_work)


def test_energy_residual_falls_with_the_square_of_the_step():
    """Taken at the mean velocity of each step, it is 3e-5 of what the vibration exchanges at 1 us."""
    residual = [
        simulate(trial_rig(1), **RUB, normal="updated", step=step).energy_residual
        for step in ("1 us", "0.5 us", "0.25 us", "0.125 us")
    ]
    assert residual[0] < 1e-4
    assert residual[-1] < 5e-6
    assert all(later < 0.4 * earlier for earlier, later in pairwise(residual))


def test_run_goes_on_amid_a_contact():
    rig = trial_rig(2)
    for phase in np.linspace(0, 2 * np.pi, 24):
        turned = with_keys(rig, {"rotor.unbalance.phase": phase})
        first = simulate(turned, **(RUB | {"revolutions": 1}), normal="updated")
        if first.final.contact_force.max() > 1.0:
            break
    assert first.final.contact_force.max() > 1.0
    whole = simulate(turned, **RUB, normal="updated")
    second = simulate(turned, **(RUB | {"revolutions": 1}), normal="updated", initial=first.final)
    for name in MOTIONS:
        expected = getattr(whole, name)[..., 256:]
        assert getattr(second, name) == pytest.approx(expected, rel=0, abs=1e-7 * abs(expected).max()), name
    counts = first.contacts_per_revolution + second.contacts_per_revolution
    assert counts == pytest.approx(2 * whole.contacts_per_revolution)
