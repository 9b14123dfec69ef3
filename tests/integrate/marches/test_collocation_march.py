"""The collocation integrator: against references of its own, closed form, energy, and its accuracy."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate
from independent_contact import run
from record_distance import MOTIONS
from reference_bodies import squared_slope
from trial_rig import trial_rig

from rubhpc import InputError
from rubhpc.fem.beam import stator_foreshortening
from rubhpc.integrate.marches import collocation
from rubhpc.rig.reading import with_keys
from rubhpc.rig.stators import LumpedStator

RUB = {"speed": 170.0, "clearance": "80 um", "friction": 0.2, "transient": 0, "revolutions": 2}
CLOSE = RUB | {"clearance": "40 um"}
UPDATED = RUB | {"normal": "updated"}
SLENDER = {"height": 0.003, "geometry": "second_order"}  # bends by a twentieth of its length


def distance(found, known, names=MOTIONS):
    """Greatest rms distance of the signals, over the known one's rms."""

    def apart(name):
        one, other = getattr(found, name), getattr(known, name)
        return np.sqrt(np.mean((one - other) ** 2) / np.mean(other**2))

    return max(apart(name) for name in names)


def test_foreshortening_is_the_integral_of_the_squared_slope():
    (stator,) = trial_rig(1, height=0.02).stator  # deep, so that shear counts
    lateral = [3 * node + i for node in range(1, stator.elements + 1) for i in (1, 2)]
    found = stator_foreshortening(stator)
    expected = squared_slope(stator)[2:, 2:]
    assert found[np.ix_(lateral, lateral)] == pytest.approx(expected, rel=1e-12, abs=1e-12 * expected.max())
    assert not found[0::3].any()


@pytest.mark.parametrize(("n_stator", "given"), [(1, RUB), (3, CLOSE)])
def test_central_differences_come_to_it_as_steps_are_halved(n_stator, given):
    rig, given = trial_rig(n_stator), given | {"normal": "updated"}
    found = simulate(rig, **given, accuracy=1e-5)
    assert found.contact_impulse.min() > 0.0
    assert found.left_closed_form == 0
    steps = [simulate(rig, **given, method="central-difference", step=step) for step in ("1 us", "0.5 us")]
    error = [distance(record, found) for record in steps]
    assert error[1] < 5e-4
    assert error[0] / error[1] == pytest.approx(2.0, rel=0.3)
    force = steps[1].peak_contact_force
    assert found.peak_contact_force == pytest.approx(force, rel=1e-3)
    assert found.friction_work == pytest.approx(steps[1].friction_work, rel=1e-4)
    assert found.minimum_slip_speed == pytest.approx(steps[1].minimum_slip_speed, rel=3e-4)
    assert found.torsion_acceleration == pytest.approx(
        steps[1].torsion_acceleration, rel=0, abs=0.02 * abs(found.torsion_acceleration).max()
    )


@pytest.mark.parametrize("geometry", ["linear", pytest.param("second_order", marks=pytest.mark.long)])
def test_error_falls_with_the_tolerance_and_steps_rise_with_its_fifth_root(monkeypatch, geometry):
    """A shaft that rests on its stator, so that no event ends a step; the modes are the same throughout."""
    keys = {"rotor.gravity": 9.81, "stator.angle": math.pi, "rotor.unbalance.mass": 5e-4}
    rig = with_keys(trial_rig(1), keys | {"stator.geometry": geometry})
    given = {"speed": 170.0, "clearance": "20 um", "friction": 0.4, "normal": "updated"}
    given |= {"transient": 1, "revolutions": 1, "samples_per_revolution": 16}
    records, advance = [], collocation.advance_by_collocation
    for tolerance in (1e-9, 1e-3, 1e-7):

        def of_forces(*args, tolerance=tolerance):
            return advance(*args[:6], tolerance, *args[7:])

        monkeypatch.setattr(collocation, "advance_by_collocation", of_forces)
        records.append(simulate(rig, **given, accuracy=1e-9))
    known, coarse, fine = records
    assert known.contact_fraction[0] == pytest.approx(1.0)
    assert distance(coarse, known) < 2e-5
    assert distance(coarse, known) / distance(fine, known) > 1e3
    assert fine.steps < 1e4**0.2 * coarse.steps


@pytest.mark.parametrize("geometry", ["linear", "second_order"])
def test_pair_closed_alone_is_solved_as_one_among_several(geometry):
    """Beside a stator out of reach forces come of a system of all pairs, and motions of all coordinates."""
    rig = trial_rig(1, geometry=geometry)
    one = rig.stator[0]
    away = replace(one, clearance_offset=1e-3)
    given = UPDATED | {"revolutions": 1, "accuracy": 1e-6}
    alone, known = simulate(rig, **given), simulate(replace(rig, stator=(one, away)), **given)
    for name in ("vertical", "horizontal", "torsion"):
        expected = getattr(known, name)
        assert getattr(alone, name) == pytest.approx(expected, rel=0, abs=1e-7 * abs(expected).max()), name
    force = known.contact_force[0]
    assert alone.contact_force[0] == pytest.approx(force, rel=0, abs=1e-6 * force.max())
    assert known.contact_impulse[1] == 0.0


def test_error_is_controlled():
    """Against a tolerance a thousand times tighter, with the same modes: all are kept."""
    rig = trial_rig(1)
    known = simulate(rig, **UPDATED, accuracy=1e-9)
    assert known.energy_residual < 1e-7
    for accuracy, most in ((1e-6, 2e-7), (1e-5, 1e-6), (1e-3, 1e-5)):
        found = simulate(rig, **UPDATED, accuracy=accuracy)
        assert distance(found, known) < most
        assert found.energy_residual < 1e-7


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_bent_stator_moves_as_all_degrees_do(normal):
    rig = trial_rig(1, **SLENDER)
    given = {"speed": 170.0, "friction": 0.4, "transient": 0, "revolutions": 1, "clearance": 60e-6}
    found = simulate(rig, **given, normal=normal, samples_per_revolution=64, accuracy=1e-5)
    linear = simulate(
        with_keys(rig, {"stator.geometry": "linear"}), **given, normal=normal, samples_per_revolution=64
    )
    assert found.tip_deflection_ratio[0] > 0.01
    assert linear.peak_contact_force > 1.2 * found.peak_contact_force
    known = run(rig, given | {"normal": normal, "samples_per_revolution": 64}, 1e-6)
    for name in MOTIONS:
        most = 1e-4 * abs(known[name]).max()
        assert getattr(found, name) == pytest.approx(known[name], rel=0, abs=most), name
    force = known["contact_force"]
    assert found.contact_force == pytest.approx(force, rel=0, abs=1e-4 * force.max())


@pytest.mark.parametrize("normal", ["fixed", "updated"])
@pytest.mark.parametrize("geometry", ["linear", "second_order"])
def test_foreshortening_ratio_is_of_what_the_gap_leaves_out(normal, geometry):
    record = simulate(trial_rig(1, geometry=geometry), **(RUB | {"revolutions": 1}), normal=normal)
    deflection = 0.04 * record.tip_deflection_ratio[0]
    compression = record.peak_contact_force[0] * 0.04 / (3e9 * 25e-6)
    left_out = (0.6 / 0.04 if geometry == "linear" else 0.0) + (0.5 / 0.06 if normal == "fixed" else 0.0)
    assert deflection > 1e-4
    assert record.foreshortening_ratio[0] == pytest.approx(left_out * deflection**2 / compression, rel=1e-9)


def test_bent_stator_needs_what_it_needs():
    rig = trial_rig(1, geometry="second_order")
    with pytest.raises(
        InputError, match=r'method: central-difference .* add \[contact\] model = "mokhtar2017"'
    ):
        simulate(rig, **RUB, method="central-difference")
    with pytest.raises(InputError, match="geometry"):
        trial_rig(1, geometry="second_order", carrier="casing")
    assert rig.stator[0].is_bent
    assert not trial_rig(1, geometry="second_order", lateral=False).stator[0].is_bent
    with pytest.raises(TypeError):
        LumpedStator(node=1, rigid=True, geometry="second_order")


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


def test_forces_of_a_bent_ring_are_those_of_finer_steps():
    """Eight bent stators under a whip, four of them closed at a time."""
    packaged = with_keys(read_rig("mokhtar2017"), {"stator.geometry": "second_order"})
    turned = (replace(packaged.stator[0], angle=i * math.pi / 4) for i in range(8))
    case = {"speed_ratio": 0.98, "clearance": "20 um", "friction": 0.3, "normal": "updated"}
    case |= {"transient": 1, "revolutions": 1, "samples_per_revolution": 64, "keep": ("waveform",)}
    ring = replace(packaged, stator=tuple(turned))
    fine, found = (simulate(ring, **case, accuracy=accuracy) for accuracy in (1e-5, 1e-3))
    assert found.contact_fraction.sum() > 2.0
    assert found.energy_residual < 1e-3
    assert np.linalg.norm(found.contact_force - fine.contact_force) < 1e-3 * np.linalg.norm(
        fine.contact_force
    )


def test_without_lateral_freedom_normals_turn_with_the_disc_alone():
    rig = trial_rig(2, lateral=False)
    given = CLOSE | {"normal": "updated"}
    found = simulate(rig, **given)
    known = simulate(rig, **given, method="central-difference", step="0.25 us")
    assert distance(found, known, MOTIONS[:4]) < 2e-4
    assert not found.stator_lateral.any()
