"""Whole cases by the exact modal integrator: what must hold to rounding, and what happens at its edges."""

import math
import re
import time
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate
from equal_stators import in_ring
from record_distance import MOTIONS
from set_ups import prepared
from trial_rig import trial_rig, turn

from rubhpc import State
from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import steady_response
from rubhpc.integrate.carried_tangent import CarriedTangent
from rubhpc.integrate.case import run_case
from rubhpc.integrate.marches import event_driven as event_driven_march
from rubhpc.integrate.marches import march
from rubhpc.integrate.marches.collocation import WHY
from rubhpc.integrate.marches.march import NO_FORCES
from rubhpc.integrate.measuring.divergence import energy_limit
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.reduced_model import mode_library, table_stack
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.kernels.case_progress import CONTACT_UNSOLVED
from rubhpc.kernels.collocation.structures import JAMMED
from rubhpc.recent import forget
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.reading import with_keys
from rubhpc.rig.rig import Rig
from rubhpc.rig.rotors import Rotor, Unbalance
from rubhpc.rig.stators import LumpedStator
from rubhpc.schema import DIVERGED, DONE, SCHEMES
from rubhpc.study.study import Recording

SPEED = 170.0
RUB = {"speed": SPEED, "clearance": "80 um", "friction": 0.2, "transient": 1, "revolutions": 2}
CLOSE = RUB | {"clearance": "40 um"}  # three stators are all met, two at a time
FORGET = ModeLibrary.forget
COUNTED = ("contacts_per_revolution", "contact_fraction", "contact_impulse", "peak_contact_force")


def check_close(found, expected, share):
    for name in MOTIONS:
        one, other = getattr(found, name), getattr(expected, name)
        assert one == pytest.approx(other, rel=0, abs=share * abs(other).max()), name


@pytest.mark.parametrize("n_stator", [1, 3])
@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_shorter_kernel_calls_change_nothing_but_rounding(monkeypatch, n_stator, normal):
    usual = simulate(trial_rig(n_stator), normal=normal, **CLOSE)
    monkeypatch.setattr(march, "LONGEST_CALL", 1e-9)  # calls of a sample from the second on
    pieces = simulate(trial_rig(n_stator), normal=normal, **CLOSE)
    assert usual.contact_impulse.min() > 0
    check_close(pieces, usual, 1e-9)
    for name in (*COUNTED, "friction_work", "minimum_slip_speed", "tip_deflection_ratio"):
        assert getattr(pieces, name) == pytest.approx(getattr(usual, name), rel=1e-7), name
    assert pieces.peak_to_peak_vertical == pytest.approx(usual.peak_to_peak_vertical, rel=1e-9)
    assert pieces.energy_residual == pytest.approx(usual.energy_residual, rel=1e-3)


def crowd(library):
    """Fill the tables with sets that other cases have met."""
    for mask in (7, 6, 5):
        library.add(mask)


def test_sets_are_made_anew_where_there_is_no_room_for_all(monkeypatch):
    """What other cases have left in the tables does not change even the last bits."""
    case = RUB | {"clearance": "60 um"}
    usual = simulate(trial_rig(3), **case)
    monkeypatch.setattr(table_stack, "MOST_MODES", 5)
    taken, forgotten = ModeLibrary.__init__, []

    def crowded(library, *args, **settings):
        taken(library, *args, **settings)
        crowd(library)

    monkeypatch.setattr(ModeLibrary, "__init__", crowded)
    monkeypatch.setattr(ModeLibrary, "forget", lambda book: forgotten.append(book) or FORGET(book))
    forget()
    found = simulate(trial_rig(3), **case)
    assert len(forgotten) == 1
    assert found.left_closed_form == usual.left_closed_form == 0
    for name in (*MOTIONS, *COUNTED):
        assert np.array_equal(getattr(found, name), getattr(usual, name)), name


@pytest.mark.parametrize("law", [{}, {"restitution": 0.5}])
def test_many_pairs_are_recorded_sample_by_sample(monkeypatch, law):
    """Their tables hold the outputs of one sample: the same case."""
    usual = simulate(trial_rig(3), **CLOSE, **law)
    monkeypatch.setattr(mode_library, "FEW_PAIRS", 2)
    forget()
    found = simulate(trial_rig(3), **CLOSE, **law)
    assert found.left_closed_form == usual.left_closed_form == 0
    check_close(found, usual, 1e-9)
    assert found.peak_contact_force == pytest.approx(usual.peak_contact_force, rel=1e-7)


def test_neighbours_do_not_depend_on_what_is_forgotten(monkeypatch):
    """Not even their last bits: other cases, which other ranks compute, fill the same tables."""
    monkeypatch.setattr(table_stack, "MOST_MODES", 6)
    ratios = []
    for is_crowded in (False, True):
        setup = prepared(trial_rig(3), SPEED)
        if is_crowded:
            crowd(setup.library(0.2))
        neighbours = CarriedTangent(PiecewiseMotion(setup, 60e-6, 0.2, State.at_rest(setup.model)))
        ratios.append([neighbours.part(1) for _ in range(6)])
        assert 7 not in setup.library(0.2).masks  # forgotten
    assert None not in ratios[0]
    assert ratios[0] == ratios[1]


@pytest.mark.parametrize(("since", "left"), [(-(2**40), 0), (2**40, 1)])
def test_endless_events_are_those_of_a_revolution(monkeypatch, since, left):
    """As many events as are allowed, in all the time before: the case stays in closed form."""
    taken = event_driven_march.EventDrivenMarch._advance

    def late(march, *args):
        march.progress.n_event, march.progress.counted_from = 10**6, march.progress.tick + since
        return taken(march, *args)

    monkeypatch.setattr(event_driven_march.EventDrivenMarch, "_advance", late)
    assert simulate(trial_rig(3), **CLOSE).left_closed_form == left


@pytest.mark.parametrize("too_many", ["sets", "events"])
def test_endless_events_are_left_to_collocation(monkeypatch, too_many):
    """More sets of contacts, or more events, than allowed: collocation takes the case, to the same answer."""
    exact = simulate(trial_rig(3), **CLOSE)
    if too_many == "sets":
        monkeypatch.setattr(table_stack, "MOST_MODES", 4)
    else:
        monkeypatch.setattr(event_driven_march, "advance", lambda *_: CONTACT_UNSOLVED)
    forget()
    left = simulate(trial_rig(3), **CLOSE)
    assert left.status == DONE
    assert (SCHEMES[exact.scheme], exact.left_closed_form) == ("event_driven", 0)
    assert (SCHEMES[left.scheme], left.left_closed_form) == ("collocation", 1)
    check_close(left, exact, 1e-3)
    assert left.contact_impulse == pytest.approx(exact.contact_impulse, rel=2e-3)
    assert left.contacts_per_revolution == pytest.approx(exact.contacts_per_revolution, abs=0.51)


@pytest.mark.parametrize("spin", [SPEED, -SPEED])
@pytest.mark.parametrize("share", [0.9999, 1.0001])
def test_no_touch_is_missed_and_none_is_made_up(spin, share):
    """A grazing orbit reaches 12 nm past the rim for a hundredth of a turn, or misses it by as much."""
    rig = trial_rig(1)
    model = assemble(rig)
    response = steady_response(model, spin)
    start = replace(
        State.at_rest(model), rotor_displacement=response.real, rotor_velocity=(1j * spin * response).real
    )
    axis = np.exp(1j * model.stators[0].angle)
    v, w = (response[model.rotor.index(3, name)] for name in ("v", "w"))
    reach = abs(v * axis.real + w * axis.imag)  # of the orbit towards the stator
    record = simulate(
        rig, speed=spin, clearance=share * reach, friction=0.1, transient=0, revolutions=2, initial=start
    )
    if share > 1:
        assert record.contact_impulse[0] == 0.0
        assert record.contacts_per_revolution[0] == 0.0
        assert record.steps < 1000
    else:
        assert record.contacts_per_revolution[0] >= 0.5
        assert 0.0 < record.contact_fraction[0] < 0.05
        assert 0.0 < record.peak_contact_force[0] < 1.0


@pytest.mark.parametrize("n_sample", [16, 20, 64, 1024, 4096])
def test_measures_do_not_depend_on_the_samples(n_sample):
    rig = read_rig("mokhtar2017")
    given = {"speed_ratio": 0.75, "clearance": "84 um", "transient": 2, "revolutions": 2}
    usual = simulate(rig, **given)
    record = simulate(rig, samples_per_revolution=n_sample, **given)
    common = math.gcd(n_sample, 256)
    for name in MOTIONS:
        one, other = (getattr(r, name)[..., :: n // common] for r, n in ((record, n_sample), (usual, 256)))
        assert one == pytest.approx(other, rel=0, abs=1e-6 * abs(other).max()), name
    for name in (*COUNTED, "contact_duration", "friction_work", "minimum_slip_speed"):
        assert getattr(record, name) == pytest.approx(getattr(usual, name), rel=1e-3), name
    if n_sample >= 64:
        assert record.peak_to_peak_vertical == pytest.approx(usual.peak_to_peak_vertical, rel=1e-4)


@pytest.mark.parametrize(
    ("rig", "speed", "clearance", "friction"),
    [
        (trial_rig(1), SPEED, "80 um", 0.0),
        (trial_rig(2, cross=1e5), -190.0, "80 um", 0.3),
        (trial_rig(2, lateral=False), SPEED, "60 um", 0.3),
        (trial_rig(1), 900.0, "60 um", 0.3),
        (with_keys(read_rig("mokhtar2017"), {"stator.clearance_offset": -83.99e-6}), 148.7, "84 um", 0.3),
        (with_keys(read_rig("mokhtar2017"), {"stator.clearance_offset": 1e-3}), 148.7, "84 um", 0.3),
    ],
    ids=["no friction", "cross-coupled, reversed", "no lateral", "fast", "almost no gap", "out of reach"],
)
def test_unusual_cases_agree_with_the_central_difference(rig, speed, clearance, friction):
    given = {"speed": speed, "clearance": clearance, "friction": friction, "transient": 0, "revolutions": 2}
    found = simulate(rig, **given)
    known = simulate(rig, **given, method="central-difference", step="0.5 us")
    for name in MOTIONS:
        one, other = getattr(found, name), getattr(known, name)
        # Micrometres and microradians: what is nothing to one scheme is 1e-16 of them to the other.
        assert one == pytest.approx(other, rel=0, abs=1e-3 * abs(other).max() + 1e-15), name
    assert found.contacts_per_revolution == pytest.approx(known.contacts_per_revolution)
    for name in ("contact_impulse", "contact_duration", "friction_work"):
        assert getattr(found, name) == pytest.approx(getattr(known, name), rel=1e-3), name
    assert found.minimum_slip_speed == pytest.approx(known.minimum_slip_speed, rel=0.01, nan_ok=True)


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_dry_whip_diverges_and_says_so(normal):
    record = simulate(
        in_ring(read_rig("mokhtar2017"), 3, lateral=False),
        speed=148.7,
        clearance="20 um",
        friction=0.8,
        normal=normal,
        transient=1,
        revolutions=40,
    )
    assert record.status == DIVERGED
    passed = r"the displacement of the rotor at node 8 passed 0.08 m|the mechanical energy passed 716 J, .*"
    jammed, fix = map(re.escape, WHY[JAMMED].split("; "))
    ended = rf"({passed}|{NO_FORCES}|{jammed}) in revolution \d+(; {fix})?"
    assert re.fullmatch(ended, record.reason)
    assert np.isnan(record.vertical[-1])
    assert np.isnan(record.peak_contact_force).all()
    assert record.period == -1
    assert record.steps > 0


METHODS = ({"method": "modal"}, {"method": "central-difference", "step": "2 us"})


@pytest.mark.parametrize("transient", [0, 10])
def test_both_integrators_name_what_diverged_and_keep_the_record_until_then(transient):
    """Cross-coupled bearings feed forward whirl; a case that diverges in its transient is recorded too."""
    rig = with_keys(read_rig("mokhtar2017"), {"rotor.bearing.kyz": 3e5, "rotor.bearing.kzy": -3e5})
    case = {"speed": 300.0, "clearance": "100 um", "transient": transient, "revolutions": 6}
    modal, stepped = (simulate(rig, **case, **method) for method in METHODS)
    for record in (modal, stepped):
        assert record.reason == "the displacement of the rotor at node 8 passed 0.08 m in revolution 5"
        assert SCHEMES[record.scheme] == ("event_driven" if record is modal else "central_difference")
        assert record.transient_revolutions == 0
        is_kept = np.isfinite(record.vertical)
        n_kept = int(np.argmin(is_kept))
        assert 4 * 256 < n_kept < 5 * 256
        assert not is_kept[n_kept:].any()
        assert np.isfinite(record.contact_force[0, :n_kept]).all()
        assert np.abs(record.vertical[:n_kept]).max() <= 0.08
        assert np.isfinite(record.section_vertical).tolist() == [True] * 5 + [False]
        assert np.isnan(record.spectrum_vertical).all()
        assert np.isnan(record.peak_contact_force).all()
    whirl = stepped.vertical[: 3 * 256]
    assert modal.vertical[: 3 * 256] == pytest.approx(whirl, abs=0.01 * np.abs(whirl).max())


def test_tip_that_bends_far_is_no_divergence():
    """Tips that move by 0.18 m and orbits of 0.3 mm: friction drags a stator as soft as rubber along."""
    limp = with_keys(read_rig("mokhtar2017"), {"stator.youngs_modulus": 1e7})
    case = {"speed": 300.0, "clearance": "1 um", "friction": 0.9, "transient": 0, "revolutions": 3}
    for method in METHODS:
        record = simulate(limp, **case, **method)
        assert record.status == DONE
        assert record.tip_deflection_ratio[0] > 0.08 / 0.04
        assert np.hypot(record.vertical, record.horizontal).max() < 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_energy_without_bound_is_a_divergence_though_the_rotor_hardly_moves(monkeypatch, method):
    """The limit is that of rotor and stators at the displacement limit; here it is lowered."""
    for module in ("modal_setup", "setup"):
        monkeypatch.setattr(f"rubhpc.integrate.{module}.energy_limit", lambda *_: 1e-4)
    case = {"speed": 300.0, "clearance": "100 um", "transient": 0, "revolutions": 2}
    record = simulate("mokhtar2017", **case, **method)
    assert record.reason.startswith("the mechanical energy passed 0.0001 J")


def test_energy_limit_is_that_of_the_fastest_whirl_at_the_displacement_limit():
    """Half of it is elastic in a whirl at the frequency of rotor and stator; rolling on a wall is faster."""
    rig = read_rig("mokhtar2017")
    model = assemble(rig)
    row, (stator,) = model.rotor.index(8, "v"), model.stators
    force = np.zeros(model.rotor.n_dof)
    force[row] = 1.0
    compliance = np.linalg.solve(model.rotor.stiffness, force)[row]
    assert stator.node == 8
    held = 1.0 / compliance + 1.0 / stator.axial_compliance
    assert energy_limit(model, 300.0, 0.08) == pytest.approx(0.08**2 * held)

    wall = assemble(replace(rig, stator=(LumpedStator(node=8, rigid=True, radius=0.3, angle=0.0),)))
    disc_alone = 0.5 * 2.646 * (3000.0 * 0.3) ** 2
    elastic = 0.5 * 0.08**2 / compliance
    for spin in (3000.0, -3000.0):
        kinetic = energy_limit(wall, spin, 0.08) - elastic
        assert disc_alone < kinetic < 1.6 * disc_alone  # and the shaft of 1.96 kg, of which half moves less


def test_rolling_whirl_that_stays_bounded_is_no_divergence():
    """It is far faster than the spin. A full-order code of events settles at an orbit of 16.209 mm."""
    steel = {"youngs_modulus": 210e9, "shear_modulus": 80e9, "density": 7850.0}
    rotor = Rotor(
        shaft=(ShaftSection(length=0.5, outer_diameter=0.018, elements=6, **steel),),
        disc=(Disc(node=4, diameter=0.15, thickness=0.02, density=7850.0),),
        bearing=tuple(Bearing(node=node, stiffness=2e6, damping=50.0) for node in (1, 7)),
        unbalance=(Unbalance(node=4, mass=0.002, radius=0.03, phase=0.3),),
        torsion=Torsion(fixed_node=1),
        damping=Damping(alpha=3.0, beta=1e-6),
    )
    tip = {"mass": 0.02, "stiffness": 8e5, "damping": 60.0, "lateral_stiffness": 6e5, "lateral_damping": 30.0}
    ring = tuple(LumpedStator(node=4, angle=0.2 + 2.0 * math.pi * i / 8, **tip) for i in range(8))
    record = simulate(
        Rig(name="rolling", rotor=rotor, stator=ring),
        speed=120.0,
        clearance=5e-5,
        friction=0.5,
        friction_law="coulomb",
        initial={"horizontal_velocity": -1.5},
        transient=4,
        revolutions=6,
        samples_per_revolution=64,
    )
    assert record.status == DONE
    assert np.hypot(record.vertical, record.horizontal).max() == pytest.approx(16.209e-3, rel=5e-3)


def test_free_twist_is_refused_with_the_fix():
    rig = trial_rig(1)
    free = replace(rig, rotor=replace(rig.rotor, torsion=Torsion(free=True)))
    with pytest.raises(InputError, match='method = "central-difference"'):
        simulate(free, **RUB)
    assert simulate(free, **RUB, method="central-difference", step="2 us").status == DONE


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_signals_are_answered_however_long_a_revolution_lasts(normal):
    """A mass that bounces for ever off a wall, 200 times a second, and a sample every 100 s."""

    asked = []

    def check():
        asked.append(time.perf_counter())
        if len(asked) == 4:
            raise KeyboardInterrupt

    wall = LumpedStator(node=1, rigid=True, radius=1.0)
    setup = prepared(
        Rig.from_matrices([[1.0]], None, [[4e5]], degrees=[(1, "v")], stators=[wall]),
        turn(1600.0),
        samples=16,
        normal=normal,
        restitution=1.0,
    )
    thrown = replace(State.at_rest(setup.model), rotor_velocity=np.array([0.1]))
    with pytest.raises(KeyboardInterrupt):
        run_case(
            setup,
            clearance=1e-5,
            friction=0.0,
            recording=Recording(transient=0, revolutions=1, samples_per_revolution=16),
            initial=thrown,
            check=check,
        )
    assert max(np.diff(asked[1:])) < 5.0  # 0.1 s where nothing else runs
