"""Gravity and other constant loads: the sag of beams, motion about it, and oscillators under a load."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, read_rig, simulate
from lone_bodies import body, set_up, set_up_modal, tip
from set_ups import prepared
from trial_rig import STEEL

from rubhpc import Carrier, InputError, Load, LumpedStator, MatrixStator, Rig, assemble
from rubhpc.fem.assemble import model_at
from rubhpc.integrate.case import run_case
from rubhpc.integrate.record import State
from rubhpc.integrate.start import at_rest
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Bearing, ShaftSection
from rubhpc.rig.reading import with_keys
from rubhpc.rig.rotors import Rotor
from rubhpc.study.study import Recording

G = 9.81  # m/s2
FAST = 50 * math.pi  # rad/s, 1500 rpm
METHODS = ["modal", "central-difference"]
WALL = tip(body(1.0, 1.0, ((1, "axial"),)), math.pi, axial=-1)  # below, and held


def heavy(**keys):
    return with_keys(read_rig("mokhtar2017"), {"rotor.gravity": G} | keys)


def sag_at(rig, node, name="v"):
    model = assemble(rig)
    return model.sag[model.rotor.index(node, name)]


def test_beam_sags_as_timoshenko_has_it():
    """5 w L^4 / 384 E I + w L^2 / 8 k G A in the middle, on supports that give by half the weight over k."""
    length, diameter, stiffness = 0.8, 0.05, 1e7
    section = ShaftSection(length=length, outer_diameter=diameter, elements=4, **STEEL)
    bearings = tuple(Bearing(node=node, stiffness=stiffness) for node in (1, 5))
    rig = Rig(name="beam", rotor=Rotor(shaft=(section,), bearing=bearings, gravity=G))
    area, inertia = math.pi * diameter**2 / 4, math.pi * diameter**4 / 64
    weight = STEEL["density"] * area * G  # a metre
    nu = STEEL["youngs_modulus"] / (2 * STEEL["shear_modulus"]) - 1
    shear = 6 * (1 + nu) / (7 + 6 * nu) * STEEL["shear_modulus"] * area
    bending = 5 * weight * length**4 / (384 * STEEL["youngs_modulus"] * inertia)
    expected = bending + weight * length**2 / (8 * shear) + weight * length / (2 * stiffness)
    assert sag_at(rig, 3) == pytest.approx(-expected, rel=1e-6)
    assert sag_at(rig, 3, "w") == 0.0
    assert sag_at(rig, 1) == pytest.approx(-weight * length / (2 * stiffness), rel=1e-9)


def test_load_on_the_disc_bends_the_shaft_by_its_stiffness():
    rig = read_rig("mokhtar2017")
    pulled = replace(rig, rotor=replace(rig.rotor, load=(Load(node=8, vertical=-50.0, horizontal=20.0),)))
    assert sag_at(pulled, 8) == pytest.approx(-50 / 143343.35, rel=1e-4)  # L6
    assert sag_at(pulled, 8, "w") == pytest.approx(20 / 143343.35, rel=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_motion_without_contact_is_the_sag_and_the_unbalance_response(method):
    case = {"speed_ratio": 1.5, "clearance": 1.0, "method": method, "transient": 2, "revolutions": 2}
    case |= {"step": "1 us"} if method == "central-difference" else {}
    light, loaded = simulate("mokhtar2017", **case), simulate(heavy(), **case)
    assert loaded.vertical == pytest.approx(light.vertical + sag_at(heavy(), 8), abs=1e-17)
    assert np.array_equal(loaded.horizontal, light.horizontal)
    assert loaded.peak_to_peak_vertical == pytest.approx(light.peak_to_peak_vertical, rel=1e-12)
    assert loaded.contact_free_amplitude == light.contact_free_amplitude
    assert loaded.spectrum_vertical[1:] == pytest.approx(light.spectrum_vertical[1:], abs=1e-16)


def oscillator(method, contact, load, per_revolution=2000):
    """A mass of 1 kg on a spring of 1 N/m under a load, above a wall."""
    given = body(1.0, 1.0, ((1, "v"),)), [WALL], 0.5, per_revolution, contact
    if method == "modal":
        return set_up_modal(*given, load=[load], step=1e-4)
    return set_up(*given, load=[load], steps_per_sample=4)


@pytest.mark.parametrize("method", METHODS)
def test_oscillator_let_go_under_a_load_meets_a_spring(method):
    """From rest, unloaded, 3 m above where the load would hold it; a stop of 99 N/m begins 1 m below."""
    load, gap, stop = -3.0, 1.0, 99.0
    setup = oscillator(method, Contact(law="penalty", stiffness=stop), load)
    start = replace(State.at_rest(setup.model), rotor_displacement=np.zeros(1))
    recording = Recording(transient=0, revolutions=1, samples_per_revolution=2000)
    record = run_case(setup, clearance=gap, friction=0.0, recording=recording, initial=start)
    # u = -3 (1 - cos t) down to -1; then about (load - stop gap) / 100 at the frequency 10.
    arrives, speed = math.acos(2 / 3), 3 * math.sin(math.acos(2 / 3))
    middle = (load - stop * gap) / 100
    swing = math.hypot(middle + gap, speed / 10)
    stays = 2 * (math.pi - math.acos((-gap - middle) / swing)) / 10
    assert record.vertical[0] == 0.0
    assert record.peak_contact_force[0] == pytest.approx(stop * (swing - gap - middle), rel=3e-4)
    assert record.contact_duration[0] == pytest.approx(stays, rel=1e-2)
    touch = np.flatnonzero(record.contact_force[0])[0] * 2 * math.pi / 0.5 / 2000
    assert touch == pytest.approx(arrives, abs=2 * math.pi / 0.5 / 2000)


@pytest.mark.parametrize("method", METHODS)
def test_bounces_under_a_load_die_out_on_the_wall(method):
    """Let go 1 m above a wall that is 1 m above the sag: after the last bounce the load rests on the wall."""
    setup = oscillator(method, Contact(restitution=0.5), -2.0, 4000)
    start = replace(State.at_rest(setup.model), rotor_displacement=np.zeros(1))
    recording = Recording(transient=0, revolutions=3, samples_per_revolution=4000)
    record = run_case(setup, clearance=1.0, friction=0.0, recording=recording, initial=start)
    # Energy about the sag at -2: 4/2 when let go, 1/2 at the wall; the impact at sqrt 3 m/s halves the speed.
    assert record.contacts_per_revolution[0] > 1
    first = np.flatnonzero(record.contact_force[0])[0]
    rises = record.vertical[first:][: round(2.0 / (4 * math.pi / 4000))].max()
    assert rises == pytest.approx(-2.0 + math.sqrt(1.0 + 3.0 / 4.0), abs=1e-4)
    assert record.vertical[-2000:] == pytest.approx(np.full(2000, -1.0), abs=1e-6)
    assert record.contact_force[0, -2000:] == pytest.approx(np.full(2000, 1.0), rel=1e-3)


def crossed(rig, table=False):
    """The rig on bearings with circulation: kyz = -kzy = 3e5 N/m, at 1500 rpm where they are tabulated."""
    keys = {"kyy": 1e6, "kzz": 1e6, "kyz": 3e5, "kzy": -3e5}
    bearings = [Bearing(node=node, **keys) for node in (1, 15)]
    if table:
        keys |= {"kyz": [0.0, 6e5], "kzy": [0.0, -6e5], "damping": 0.0}
        bearings = [BearingTable(node=node, speed=[0.0, 2 * FAST], **keys) for node in (1, 15)]
    return replace(rig, rotor=replace(rig.rotor, bearing=tuple(bearings)))


def carried(rig):
    casing = Carrier(name="casing", mass=2.0, stiffness=5e5, inertia=0.02, torsional_stiffness=2e4)
    return replace(rig, stator=(replace(rig.stator[0], carrier="casing"),), carrier=(casing,))


ON_STATOR = heavy(**{"stator.angle": math.pi, "stator.youngs_modulus": 3e10, "rotor.unbalance.mass": 0.0})
PAIR = tuple(replace(ON_STATOR.stator[0], angle=math.pi + turn) for turn in (-0.3, 0.3))


@pytest.mark.parametrize(
    ("rig", "keys"),
    [
        (crossed(ON_STATOR), {}),
        (crossed(ON_STATOR), {"normal": "updated"}),
        (crossed(ON_STATOR), {"restitution": 0.5}),
        (crossed(ON_STATOR), {"friction_law": "coulomb"}),
        (crossed(ON_STATOR), {"law": "penalty", "stiffness": 5e6}),
        (crossed(ON_STATOR), {"method": "central-difference", "step": "0.5 us"}),
        (crossed(ON_STATOR, table=True), {}),
        (crossed(carried(ON_STATOR)), {}),
        (crossed(replace(ON_STATOR, stator=PAIR)), {}),
        (crossed(with_keys(ON_STATOR, {"stator.geometry": "second_order"})), {"normal": "updated"}),
        (ON_STATOR, {"law": "penalty", "stiffness": 5e6, "friction_law": "coulomb"}),
        (ON_STATOR, {"law": "penalty", "stiffness": 5e6, "normal": "updated"}),
        (ON_STATOR, {"law": "penalty", "stiffness": 5e6, "initial": {"impulse": 1e-15}}),
        (ON_STATOR, {"law": "penalty", "stiffness": 5e6, "method": "central-difference", "step": "0.5 us"}),
    ],
)
def test_rest_on_a_stator_is_an_equilibrium(rig, keys):
    """Also with circulation, of which no strain energy knows, on a penalty's springs, and after no knock."""
    record = simulate(rig, speed=FAST, clearance="150 um", friction=0.0, transient=0, revolutions=1, **keys)
    assert (record.contact_force[:, 0] > 5.0).all()
    assert np.ptp(record.vertical) < 1e-11
    assert np.ptp(record.horizontal) < 1e-11
    assert record.contact_force[:, -1] == pytest.approx(record.contact_force[:, 0], rel=1e-6)


def test_rest_with_circulation_solves_the_static_equations():
    model = model_at(assemble(crossed(ON_STATOR)), FAST)
    rotor, stator = model.rotor, model.stators[0]
    n, m = rotor.n_dof, stator.body.n_dof
    system, load = np.zeros((n + m + 1, n + m + 1)), np.zeros(n + m + 1)
    system[:n, :n], system[n : n + m, n : n + m] = rotor.stiffness, stator.body.stiffness
    # the gap opens as the disc rises, and as the tip below it moves away
    opens = np.zeros(n + m)
    opens[rotor.index(8, "v")], opens[n + stator.axial] = 1.0, 1.0
    system[:-1, -1], system[-1, :-1] = -opens, opens
    load[:n], load[-1] = model.load, -1.5e-4
    setup = prepared(crossed(ON_STATOR), FAST, samples=256)
    known, rest = np.linalg.solve(system, load), at_rest(setup, 1.5e-4)
    assert rest.contact_force == pytest.approx(known[-1:], rel=1e-6)
    at = [rotor.index(8, name) for name in ("v", "w")]
    assert rest.rotor_displacement[at] == pytest.approx(known[at], rel=1e-6)


def test_a_stator_that_is_free_to_move_gives_no_rest():
    loose = MatrixStator(node=8, angle=math.pi, radius=0.06, mass=[[0.1]], stiffness=[[0.0]])
    case = {"speed": FAST, "friction": 0.0, "transient": 0, "revolutions": 1, "step": "0.5 us"}
    case["method"] = "central-difference"
    rig = replace(ON_STATOR, stator=(loose,))
    with pytest.raises(InputError, match="finds no rest on the stators that it reaches; constrain them"):
        simulate(rig, **case, clearance="150 um")
    assert not simulate(rig, **case, clearance="1 mm").contact_force.any()


def test_mean_of_a_rub_is_the_sag_less_what_contact_holds_up():
    """E1 under gravity: over whole periods inertia and unbalance average out."""
    rig = heavy(**{"stator.angle": math.pi})
    record = simulate(rig, speed_ratio=1.5, clearance="250 um", friction=0.2, transient=60, revolutions=32)
    force = record.contact_force.mean()
    assert record.period > 0
    assert force > 10.0
    lifted = force / 143343.35
    assert record.vertical.mean() == pytest.approx(sag_at(rig, 8) + lifted, abs=1e-4 * lifted)
    assert record.horizontal.mean() == pytest.approx(0.2 * lifted, rel=1e-3)
    assert record.torsion.mean() == pytest.approx(-0.2 * 0.06 * force / 3125.88, rel=1e-3)


def test_matrices_take_gravity_and_loads_like_the_beam():
    rig = heavy()
    body_ = assemble(rig).rotor
    stop = LumpedStator(node=8, mass=1e-3, stiffness=1e6, radius=0.06)
    given = {"degrees": body_.degrees, "stators": stop, "gravity": "9.81 m/s^2"}
    matrices = Rig.from_matrices(body_.mass, body_.damping, body_.stiffness, body_.gyroscopic, **given)
    assert assemble(matrices).sag == pytest.approx(assemble(rig).sag, rel=1e-9, abs=1e-15)
    given["load"] = Load(node=8, vertical=50.0)
    lifted = Rig.from_matrices(body_.mass, body_.damping, body_.stiffness, body_.gyroscopic, **given)
    assert sag_at(lifted, 8) - sag_at(rig, 8) == pytest.approx(50 / 143343.35, rel=1e-4)


def test_what_nothing_holds_is_refused():
    wall = LumpedStator(node=1, rigid=True, radius=1.0)
    with pytest.raises(InputError, match="floats freely: its bearings do not hold it; add a bearing"):
        assemble(Rig.from_matrices([[1.0]], K=[[0.0]], degrees=[(1, "v")], stators=wall, gravity=G))
    with pytest.raises(InputError, match=r"gravity: cannot be applied to the coordinates q\.\.\."):
        Rig.from_matrices(np.eye(2), K=np.eye(2), degrees=[(1, "v"), (1, "q1")], stators=wall, gravity=G)
    rotor = read_rig("mokhtar2017").rotor
    with pytest.raises(InputError, match=r"load\.1\.node: 99 is not on the shaft"):
        replace(rotor, load=(Load(node=99, vertical=1.0),))
    with pytest.raises(InputError, match=r"gravity: -9\.81 m/s\^2 is out of range"):
        heavy(**{"rotor.gravity": -G})
    with pytest.raises(InputError, match='has neither "v" nor "w"'):
        Rig.from_matrices([[1.0]], K=[[1.0]], degrees=[(1, "v")], stators=wall, load=Load(node=2))
