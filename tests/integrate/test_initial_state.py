"""Where cases start: a motion carried to another clearance, the contact-free one, a displacement, a knock.

No gap is overlapped, none is pulled shut, and no energy is made.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, read_rig, simulate
from record_distance import MOTIONS
from set_ups import prepared
from trial_rig import trial_rig

from rubhpc import Bore, LumpedStator
from rubhpc import simulate as simulate_any
from rubhpc.errors import InputError
from rubhpc.fem.response import contact_free_amplitude
from rubhpc.integrate.case import run_case
from rubhpc.integrate.overlaps import gaps
from rubhpc.integrate.record import State
from rubhpc.integrate.setup import prepare
from rubhpc.integrate.start import _least_forces, at_rest, fit_to_gaps, start_of
from rubhpc.kernels.closed_form.mode_change import GAP_TOLERANCE
from rubhpc.study.initial import Initial
from rubhpc.study.study import Integrator, Recording

SPIN = 220.0  # rad/s
SHORT = Recording(transient=0, revolutions=2, samples_per_revolution=64)
METHODS = {
    "modal": (Integrator(), Contact()),
    "updated": (Integrator(), Contact(normal="updated")),
    "central": (Integrator(method="central-difference", step=1e-6), Contact()),
    "bouncing": (Integrator(), Contact(restitution=0.6)),
}


def setup_of(method: str, n_stator: int = 2, **changed):
    integrator, contact = METHODS[method]
    return prepare(
        trial_rig(n_stator, **changed),
        SPIN,
        contact=contact,
        integrator=integrator,
        samples_per_revolution=SHORT.samples_per_revolution,
    )


def settled(setup, clearance: float, initial: State | None = None) -> State:
    """Where the case is after some revolutions."""
    recording = replace(SHORT, transient=6)
    return run_case(setup, clearance=clearance, friction=0.1, recording=recording, initial=initial).final


def energy(setup, state: State) -> float:
    """Of rotor and stators, J."""
    total = 0.0
    bodies = setup.model.bodies
    parts = zip(
        (state.rotor_displacement, *state.stator_displacement),
        (state.rotor_velocity, *state.stator_velocity),
        strict=True,
    )
    for body, (u, v) in zip(bodies, parts, strict=True):
        total += 0.5 * (v @ body.mass @ v + u @ body.stiffness @ u)
    return float(total)


@pytest.mark.parametrize("method", METHODS)
def test_a_motion_that_goes_on_in_its_own_case_is_left_as_it_is(method):
    setup = setup_of(method)
    state = settled(setup, 1e-4)
    same = fit_to_gaps(state, setup, 1e-4)
    assert np.array_equal(same.packed()[:-2], state.packed()[:-2])


@pytest.mark.parametrize("method", METHODS)
def test_a_wall_that_moves_in_pushes_as_it_would_slowly(method):
    """The strain energy it adds is what the forces do over the way, and no body is thrown."""
    setup = setup_of(method)
    state = settled(setup, 1e-4)
    gap, gap_jacobian = gaps(state.displacement, setup, 1e-4)
    clearance = 1e-4 - float(gap.max()) - 2e-5  # every gap would be overlapped by 20 um and more
    start = fit_to_gaps(state, setup, clearance)
    after, _ = gaps(start.displacement, setup, clearance)
    assert np.all(after > -1e-12)
    assert after.min() == pytest.approx(0.0, abs=1e-12)
    assert np.array_equal(start.velocity, state.velocity)
    # By the laws of statics: K du = gap_jacobian^T F, with forces that press, and none where the gap is open.
    moved = start.displacement - state.displacement
    bodies = setup.model.bodies
    stiffness = [0.5 * (body.stiffness + body.stiffness.T) for body in bodies]
    parts = np.split(moved, np.cumsum([body.n_dof for body in bodies])[:-1])
    load = np.concatenate([k @ u for k, u in zip(stiffness, parts, strict=True)])
    force = np.linalg.lstsq(gap_jacobian.T, load, rcond=None)[0]
    if method != "updated":  # there the normals turn on the way
        assert np.linalg.norm(gap_jacobian.T @ force - load) < 1e-6 * np.linalg.norm(load)
        assert np.all(force > -1e-6 * force.max())
    # And what goes on from there is the motion of before, not a shock.
    before = run_case(setup, clearance=1e-4, friction=0.1, recording=SHORT, initial=state)
    beyond = run_case(setup, clearance=clearance, friction=0.1, recording=SHORT, initial=state)
    assert beyond.status == before.status
    assert np.abs(beyond.final.velocity).max() < 5 * np.abs(before.final.velocity).max()
    assert energy(setup, start) < 3 * energy(setup, state)


@pytest.mark.parametrize("method", METHODS)
def test_a_wall_that_moves_out_lets_go(method):
    setup = setup_of(method, 1)
    state = settled(setup, 1e-4)
    state = replace(state, contact_force=np.array([50.0]))  # pressed at that instant
    start = fit_to_gaps(state, setup, 1e-2)
    assert start.contact_force.tolist() == [0.0]
    assert np.array_equal(start.displacement, state.displacement)
    free = run_case(setup, clearance=1e-2, friction=0.1, recording=SHORT, initial=state)
    assert free.contact_fraction.tolist() == [0.0]


PENALTY, COULOMB = {"law": "penalty", "stiffness": 1e7, "damping": 300.0}, {"friction_law": "coulomb"}
ALL_LAWS = [{}, COULOMB, PENALTY, PENALTY | COULOMB, {"restitution": 0.5}, {"normal": "updated"}]
ALL_LAWS += [
    law | {"method": "central-difference", "step": "1 us"}
    for law in ({}, COULOMB, PENALTY, {"normal": "updated"})
]


@pytest.mark.parametrize("law", ALL_LAWS, ids=lambda law: " ".join(map(str, law.values())))
def test_two_runs_that_meet_amid_a_contact_are_one(law):
    """Forces, overlaps and stick follow from the state at the end, and no contact is counted twice.

    By collocation the second run takes other steps, as good as `accuracy`.
    """
    is_collocated = "method" not in law and law.keys() & {"law", "friction_law", "normal"}
    rel = 1e-6 if is_collocated else 1e-8
    given = {"speed": 170.0, "clearance": "20 um", "friction": 0.2, "accuracy": 1e-6} | law
    whole = simulate(trial_rig(3), **given, transient=0, revolutions=4)
    first = simulate(trial_rig(3), **given, transient=0, revolutions=3)
    assert first.final.contact_force.max() > 0.1
    second = simulate(trial_rig(3), **given, transient=0, revolutions=1, initial=first.final)
    for name in (*MOTIONS, "contact_force"):
        expected = getattr(whole, name)[..., 768:]
        assert getattr(second, name) == pytest.approx(expected, rel=0, abs=rel * abs(expected).max()), name
    for name in ("contacts_per_revolution", "contact_impulse"):
        parts = 3 * getattr(first, name) + getattr(second, name)
        assert parts == pytest.approx(4 * getattr(whole, name), rel=rel), name
    for name in ("rotor_displacement", "rotor_velocity"):
        expected = getattr(whole.final, name)
        scale = rel * abs(expected).max()
        assert getattr(second.final, name) == pytest.approx(expected, rel=0, abs=scale), name


def test_what_a_penalty_overlaps_stays_and_what_a_wall_adds_goes():
    contact = Contact(law="penalty", stiffness=1e6, damping=10.0)
    setup = prepared(trial_rig(1), SPIN, contact=contact)
    overlapped = None
    for n in range(20):  # until a revolution ends in contact
        state = settled(setup, (30 + n) * 1e-6, overlapped)
        if state.overlap[0] > 1e-7:
            break
    clearance = (30 + n) * 1e-6
    assert state.overlap[0] > 1e-7
    assert np.array_equal(fit_to_gaps(state, setup, clearance).displacement, state.displacement)
    start = fit_to_gaps(state, setup, clearance - 1e-5)
    gap, _ = gaps(start.displacement, setup, clearance - 1e-5)
    assert gap[0] == pytest.approx(-state.overlap[0], abs=1e-12)


def test_a_rig_of_other_degrees_is_refused_in_a_line():
    record = simulate("mokhtar2017", speed_ratio=0.75, clearance="100 um", transient=0, revolutions=1)
    with pytest.raises(
        InputError, match=r"initial: a state of \d+ numbers for a rig of \d+; use it only for"
    ):
        simulate(
            "mokhtar2017",
            speed_ratio=0.75,
            clearance="100 um",
            overrides={"stator.elements": 3},
            transient=0,
            revolutions=1,
            initial=record.final,
        )


@pytest.mark.parametrize("friction_law", ["sliding", "coulomb"])
def test_a_shaft_rests_on_the_walls_that_its_sag_overlaps(friction_law):
    """In a ring of eight, of which it overlaps four: two of them carry it."""
    walls = tuple(LumpedStator(node=8, angle=0.55 + i * math.pi / 4.0, rigid=True) for i in range(8))
    packaged = read_rig("mokhtar2017")
    rig = replace(packaged, rotor=replace(packaged.rotor, gravity=9.81), stator=walls)
    setup = prepared(rig, SPIN, samples=SHORT.samples_per_revolution, friction_law=friction_law)
    clearance = 5e-6
    over, _ = gaps(State.at_rest(setup.model).displacement, setup, clearance)
    state = at_rest(setup, clearance)
    left, _ = gaps(state.displacement, setup, clearance)
    carries = state.contact_force > 1.0
    assert np.count_nonzero(over < 0.0) == 4
    assert left.min() > -1e-15
    assert np.count_nonzero(carries) == 2
    assert abs(left[carries]).max() < 1e-15
    record = run_case(setup, clearance=clearance, friction=0.1, recording=SHORT)
    assert record.reason == ""
    # Each contact leaves the weight times the tolerance of a gap; impacts and damping take some 0.1 mJ.
    n_contact = SHORT.revolutions * record.contacts_per_revolution.sum()
    left = n_contact * state.contact_force.max() * GAP_TOLERANCE
    assert record.energy_residual < left / 1e-4


def test_walls_that_leave_no_room_are_named():
    with pytest.raises(InputError, match="leave no room"):
        _least_forces(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([-1e-5, -1e-5]))


BRIEF = {"transient": 0, "revolutions": 4, "samples_per_revolution": 64, "friction": 0.1}


@pytest.mark.parametrize("speed", [150.0, -SPIN])
def test_the_contact_free_motion_needs_no_transient(speed):
    record = simulate(trial_rig(1), speed=speed, clearance="5 mm", initial={"from": "contact_free"}, **BRIEF)
    turns = record.signals["vertical"].reshape(4, 64), record.signals["horizontal"].reshape(4, 64)
    size = contact_free_amplitude(prepared(trial_rig(1), speed).model, speed)
    for turn in turns:
        np.testing.assert_allclose(turn, turn[[0, 0, 0, 0]], atol=1e-6 * size)
    assert np.hypot(*turns).max() <= size * (1 + 1e-6)


@pytest.mark.parametrize("method", ["modal", "central"])
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
        **BRIEF,
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
