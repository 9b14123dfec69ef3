"""The collocation integrator: against references of its own, closed form, energy, and its accuracy."""

import math
from dataclasses import replace

import corpus
import numpy as np
import pytest
from closed_form import read_rig, simulate
from contact_answers import masses
from equal_stators import in_ring
from independent_contact import run
from record_distance import MOTIONS
from reference_bodies import squared_slope
from set_ups import prepared
from trial_rig import trial_rig

import rubhpc
from rubhpc import InputError
from rubhpc.fem.beam import stator_foreshortening
from rubhpc.integrate import case
from rubhpc.integrate.marched_record import march_record
from rubhpc.integrate.marches import collocation
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.march import ended_in
from rubhpc.integrate.record import State
from rubhpc.integrate.scheme import Scheme
from rubhpc.rig.reading import with_keys
from rubhpc.rig.stators import LumpedStator, MatrixStator
from rubhpc.study.contact_keys import Contact

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
    for accuracy in (1e-6, 1e-5, 1e-3):
        found = simulate(rig, **UPDATED, accuracy=accuracy)
        assert distance(found, known) < 0.1 * accuracy
        assert found.energy_residual < max(0.1 * accuracy, 1e-7)


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
    assert rig.stator[0].is_bent
    assert not trial_rig(1, geometry="second_order", lateral=False).stator[0].is_bent
    with pytest.raises(TypeError):
        LumpedStator(node=1, rigid=True, geometry="second_order")


@pytest.mark.parametrize("n_stator", [1, 3])
def test_closed_gaps_are_closed_and_forces_press(n_stator):
    """Curved gaps from the samples, in the complex plane: none penetrates by more than events leave."""
    rig = trial_rig(n_stator)
    record = simulate(
        rig, **(CLOSE | {"revolutions": 1}), normal="updated", samples_per_revolution=4096, keep=("waveform",)
    )
    axis = np.exp(1j * np.array([stator.angle for stator in rig.stator]))[:, np.newaxis]
    tip = (0.06 + 40e-6 + record.stator_axial + 1j * record.stator_lateral) * axis
    gap = abs(tip - (record.vertical + 1j * record.horizontal)) - 0.06
    assert gap.min() >= -1e-4 * 40e-6
    assert record.contact_force.min() >= 0.0
    # In contact from this sample to the next: closed at both ends.
    held = (record.contact_force[:, :-1] > 0.0) & (record.contact_force[:, 1:] > 0.0)
    before = np.roll(held, 1, axis=1) & held
    assert np.count_nonzero(before) > 50
    assert np.median(abs(gap[:, :-1][before])) <= 1e-5 * 40e-6


def test_without_lateral_freedom_normals_turn_with_the_disc_alone():
    rig = trial_rig(2, lateral=False)
    given = CLOSE | {"normal": "updated"}
    found = simulate(rig, **given)
    known = simulate(rig, **given, method="central-difference", step="0.25 us")
    assert distance(found, known, MOTIONS[:4]) < 2e-4
    assert not found.stator_lateral.any()


def by(march, name, **given):
    """Four revolutions of a case of the corpus by a march."""
    _, machine, law, keys = corpus.CASES[name]
    keys = {"transient": 0, "samples_per_revolution": 64, "keep": ("waveform",)} | keys
    keys |= law | {"revolutions": 4} | given
    rig = corpus.machine(machine).with_geometry(keys.pop("geometry"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(case.MARCHES, Scheme.EVENT_DRIVEN, march)
        return rubhpc.simulate(rig, **keys)


def both(name, **given):
    """A case by collocation and in closed form."""
    return by(collocation.CollocationMarch, name, **given), by(EventDrivenMarch, name, **given)


SMOOTH = ("sliding, below", "sliding, gravity", "sliding, tabulated", "sliding, pump", "restitution, lone")
BOUNCING = ("sliding, two", "sliding, three", "sliding, reversed", "sliding, ring of 8")
BOUNCING += ("sliding, ring of 16", "sliding, carried", "sliding, pump in 8", "restitution, below")


@pytest.mark.parametrize("name", SMOOTH + BOUNCING)
def test_a_fixed_normal_is_that_of_the_closed_form(name):
    """Laws that have one, on every machine; bounces within a share of a contact may be counted otherwise."""
    found, known = both(name, accuracy=1e-4)
    assert found.steps != known.steps  # of two marches
    assert known.contact_impulse.any()
    for signal in (*MOTIONS, "contact_force"):
        one, other = found.signals[signal], known.signals[signal]
        assert one == pytest.approx(other, rel=0, abs=1e-3 * abs(other).max()), signal
    for measure in ("contact_impulse", "friction_work"):
        one, other = getattr(found, measure), getattr(known, measure)
        assert one == pytest.approx(other, rel=0, abs=1e-3 * abs(other).max()), measure
    # Dense samples have the peak of this one; that of the closed form is too high by up to 1.2e-3.
    assert found.peak_contact_force == pytest.approx(known.peak_contact_force, rel=2e-3)
    assert found.contact_fraction == pytest.approx(known.contact_fraction, abs=1e-3)
    assert found.stick_fraction == pytest.approx(known.stick_fraction, abs=1e-3)
    if name in SMOOTH:
        assert found.contacts_per_revolution == pytest.approx(known.contacts_per_revolution)
        assert found.reversals_per_revolution == pytest.approx(known.reversals_per_revolution)


@pytest.mark.parametrize("name", ["sliding, walls", "restitution, walls"])
def test_walls_are_those_of_the_closed_form(name):
    """For a revolution: rounding grows by ten in two. Contacts that part within tolerance do not chatter."""
    found, known = both(name, accuracy=1e-4, revolutions=1)
    for signal in MOTIONS[:3]:
        one, other = found.signals[signal], known.signals[signal]
        assert one == pytest.approx(other, rel=0, abs=1e-3 * abs(other).max()), signal
    assert found.contact_impulse == pytest.approx(known.contact_impulse, rel=1e-3)
    assert found.steps < 10_000


@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("name", ["sliding, below", "coulomb, above", "penalty, below", "coulomb, ring of 8"])
def test_energy_balances_as_well_as_forces_are_accurate(name, accuracy):
    assert by(collocation.CollocationMarch, name, accuracy=accuracy).energy_residual < accuracy


def test_elastic_impacts_keep_the_energy():
    """A mass between two walls, without damping."""
    wall = {"node": 1, "radius": 1.0, "rigid": True}
    rig = rubhpc.Rig.from_matrices(
        [[1.0]], None, [[4.0]], degrees=[(1, "v")],
        stators=[LumpedStator(angle=angle, **wall) for angle in (0.0, math.pi)],
    )  # fmt: skip
    given = {"speed": 3.0, "clearance": 1e-2, "friction": 0.0, "restitution": 1.0, "normal": "updated"}
    record = simulate(rig, **given, initial={"vertical_velocity": 1.0}, transient=0, revolutions=4)
    assert record.contacts_per_revolution == pytest.approx([2 * math.pi / 3 / 4e-2] * 2, rel=0.02)
    energy = 0.5 * record.final.rotor_velocity[0] ** 2 + 2.0 * record.final.rotor_displacement[0] ** 2
    assert energy == pytest.approx(0.5, rel=1e-10)


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.9])
def test_rebounds_beside_closed_pairs_have_an_end(restitution):
    """A ring in which one pair bounces while others are pressed."""
    rig = masses(8, stiffness=1e6, radius=0.06)
    given = {"speed_ratio": 1.5, "clearance": 70e-6, "friction": 0.3, "friction_law": "coulomb"}
    given |= {"normal": "updated", "restitution": restitution, "transient": 0, "revolutions": 1}
    found, fine = (simulate(rig, **given, accuracy=accuracy) for accuracy in (1e-3, 1e-5))
    assert found.reason == fine.reason == ""
    assert found.energy_residual < 1e-4
    assert found.contact_impulse == pytest.approx(fine.contact_impulse, abs=1e-3 * fine.contact_impulse.max())
    assert found.peak_contact_force == pytest.approx(
        fine.peak_contact_force, abs=1e-3 * fine.peak_contact_force.max()
    )


def test_a_pair_sticks_on_a_gap_that_is_not_quite_closed():
    """What its small error moves a normal by is no slip: stick and slip alternated at one instant."""
    rig = with_keys(read_rig("mokhtar2017"), {"stator.geometry": "second_order", "stator.radius": 0.004})
    given = {"speed_ratio": 1.3, "clearance": 84e-6, "friction": 0.5, "friction_law": "coulomb"}
    record = simulate(rig, **given, normal="updated", transient=0, revolutions=16)
    assert record.reason == ""
    assert record.steps < 400 * 16


@pytest.mark.parametrize("friction_law", ["sliding", "coulomb"])
def test_friction_that_wedges_a_stator_ends_a_case(friction_law):
    """A tip that turns in as it is dragged along (Painleve 1895): at a friction above 1/3."""
    lean = MatrixStator(
        node=8, mass=[[1e-2, 3e-3], [3e-3, 1e-3]], damping=np.eye(2), stiffness=np.diag([1e6, 1e5]),
        degrees=("axial", "lateral"),
    )  # fmt: skip
    rig = replace(read_rig("mokhtar2017"), stator=(lean,))
    given = {"speed_ratio": 0.75, "clearance": 84e-6, "normal": "updated", "friction_law": friction_law}
    given |= {"transient": 0, "revolutions": 3}
    assert simulate(rig, **given, friction=0.2).peak_contact_force[0] > 10.0
    assert "Painleve" in simulate(rig, **given, friction=0.8).reason


def test_a_force_that_only_turns_takes_long_steps():
    """A disc that is pressed around the wall of a bore: 32 steps a revolution."""
    bore = rubhpc.Bore(node=8, radius=0.03, mass=0.5, stiffness=1e7, damping=1000.0)
    rig = replace(rubhpc.read_rig("mokhtar2017"), stator=(bore,))
    overrides = {"rotor.unbalance.mass": 0.02, "rotor.damping.alpha": 60.0}
    given = {"speed": 200.0, "clearance": "50 um", "friction": 0.05, "overrides": overrides}
    records = [
        rubhpc.simulate(rig, **given, transient=30, revolutions=n, samples_per_revolution=32) for n in (4, 20)
    ]
    assert all(record.contact_fraction[0] == pytest.approx(1.0) for record in records)
    assert 31 <= (records[1].measures["steps"] - records[0].measures["steps"]) / 16 <= 34
    coarse, fine = records[0], rubhpc.simulate(rig, **given, transient=30, revolutions=4, accuracy=1e-6)
    assert coarse.friction_work == pytest.approx(fine.friction_work, rel=1e-5)
    assert coarse.peak_contact_force == pytest.approx(fine.peak_contact_force, rel=1e-4)


STEEL = {"youngs_modulus": 1.5e11, "length": 0.028, "geometry": "second_order", "count": 8}
STIFF = {"youngs_modulus": 3e10, "geometry": "linear", "count": 8}
SMALL = {"youngs_modulus": 2e10, "geometry": "linear", "count": 12, "radius": 0.006}
HIT = {"clearance": "50 um", "normal": "updated", "transient": 0, "revolutions": 4, "keep": ()}


@pytest.mark.parametrize(
    ("stator", "given", "touches"),
    [
        pytest.param(  # the acceleration that brings a tip back fades within a step
            STEEL,
            {"speed_ratio": 2.9, "friction": 0.0, "restitution": 0.7, "friction_law": "sliding"},
            100,
            id="fading",
        ),
        pytest.param(  # rebounds of a few ticks that lose less than the tick rounds
            STIFF, {"speed_ratio": 2.98, "friction": 0.4, "restitution": 0.95}, 1000, id="ticks"
        ),
        pytest.param(  # impacts of one press others that have closed a tick before
            SMALL,
            {"speed_ratio": 0.86, "friction": 0.4, "restitution": 0.5, "friction_law": "sliding"},
            250,
            id="neighbours",
        ),
    ],
)
def test_rebounds_in_a_ring_come_to_rest(stator, given, touches):
    rig = read_rig("mokhtar2017")
    rig = with_keys(replace(rig, stator=(replace(rig.stator[0], **stator),)), {"rotor.gravity": 9.81})
    record = rubhpc.simulate(rig, **HIT, **given)
    assert record.reason == ""
    assert record.energy_residual < 5e-4
    assert 1 < record.contacts_per_revolution.sum() < touches


@pytest.mark.parametrize("reason", collocation.WHY.values())
def test_reason_of_an_end_names_the_revolution_before_what_may_help(reason):
    said = ended_in(reason, 7)
    what, _, fix = said.partition(" in revolution 7")
    assert what + fix == reason
    assert ";" not in what


def test_a_case_with_long_steps_is_interrupted_soon():
    """Its steps take a hundred times as long as those of one stator; a call is shorter by that."""
    rig = in_ring(rubhpc.read_rig("mokhtar2017"), 16)
    setup, calls = prepared(rig, 200.0, contact=Contact()), []

    def check():
        calls.append(march.n_step)

    march = collocation.CollocationMarch(setup, 60e-6, 0.2, State.at_rest(setup.model), check)
    march_record(march, setup, 4)
    assert np.diff(calls).max() < 500
    assert calls[-1] > 1000
