"""The energy balance: exact in closed form, and by collocation as good as `accuracy`."""

import math
from dataclasses import replace

import pytest
from closed_form import read_rig, simulate
from equal_stators import in_ring
from trial_rig import trial_rig

from rubhpc import LumpedStator
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.rig.reading import with_keys
from rubhpc.rig.rotors import Load

STIFF = with_keys(read_rig("mokhtar2017"), {"stator.youngs_modulus": 3e10})
COULOMB = {"friction_law": "coulomb"}
LAWS = [
    {},
    COULOMB,
    {"restitution": 0.3},
    {"restitution": 0.8},
    COULOMB | {"restitution": 0.8},
    {"law": "penalty", "stiffness": 1e7, "damping": 100.0},
]
ACCURACY = 1e-5  # of what is computed by collocation
FEW = {"transient": 10, "revolutions": 6, "samples_per_revolution": 64, "keep": ()}


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize(
    ("rig", "case"),
    [
        (STIFF, {"speed_ratio": 1.5, "clearance": "40 um", "friction": 0.5}),  # irregular
        (in_ring(STIFF, 3), {"speed_ratio": 0.75, "clearance": "60 um", "friction": 0.15}),
        (trial_rig(3, cross=5e4), {"speed": 240.0, "clearance": "60 um", "friction": 0.3}),
    ],
    ids=["one", "three", "cross-coupled"],
)
def test_energy_balances_under_every_law(rig, case, law):
    is_closed = not law.keys() & {"friction_law", "law"}
    record = simulate(rig, **case, **law, **FEW, accuracy=1e-3 if is_closed else ACCURACY)
    assert record.measures["scheme"] == (0 if is_closed else 4)  # from event to event, or by collocation
    assert record.contact_impulse.max() > 0.0
    assert record.energy_residual < (1e-8 if is_closed else ACCURACY)


def test_energy_balances_where_a_ring_bounces_thousands_of_times_a_revolution():
    """Light stators all around a rotor that turns within 10 um of them: their bounces end by themselves."""
    bouncing = LumpedStator(node=8, mass=0.1, stiffness=1e5, damping=5.0, radius=0.06)
    rig = in_ring(replace(STIFF, stator=(bouncing,)), 8)
    case = {"speed_ratio": 1.2, "clearance": "10 um", "friction": 0.1, "restitution": 0.8}
    record = simulate(rig, **case, **COULOMB, **FEW | {"transient": 1, "revolutions": 2})
    assert record.measures["left_closed_form"] == 0
    assert record.energy_residual < 1e-6


@pytest.mark.parametrize("law", [{}, COULOMB, {"normal": "updated"}], ids=str)
def test_masses_that_throw_each_other_open_come_to_rest(law):
    """In a ring with a clearance of 0.5 um; bounces within the tolerance of gaps would be 92 000 contacts."""
    mass = LumpedStator(node=3, radius=0.03, mass=1.7, stiffness=1e6)
    rig, case = (
        in_ring(replace(trial_rig(1), stator=(mass,)), 8, first=0.3),
        {"speed": 45.0, "clearance": "0.5 um"},
    )
    record = simulate(rig, **case, friction=0.2, **law, **FEW | {"transient": 0, "revolutions": 1})
    assert 50.0 < record.contacts_per_revolution.sum() < 1000.0
    assert record.energy_residual < 5e-7


@pytest.mark.parametrize("law", [{}, COULOMB], ids=str)
@pytest.mark.parametrize("kind", ["walls", "masses"])
def test_gaps_close_where_bodies_touch(kind, law):
    """A gap that closes early or late leaves its width times the force: many hard contacts."""
    if kind == "walls":
        spread, height = (-0.83, 0.67), 0.0012
        walls = (LumpedStator(node=8, rigid=True, radius=0.06, angle=math.pi + at) for at in spread)
        rotor = replace(STIFF.rotor, gravity=9.81, load=(Load(node=8, vertical=-300.0),))
        rig = replace(STIFF, rotor=rotor, stator=tuple(walls))
        initial = {"from": "rest", "vertical": height, "vertical_velocity": -0.28}
        case = {"speed": 5.0, "clearance": "31 um", "friction": 0.52, "initial": initial}
    else:
        mass = LumpedStator(node=3, mass=0.111, stiffness=7.76e6)
        rig = in_ring(replace(trial_rig(1), stator=(mass,)), 12, first=5.086)
        case = {"speed": 49.5, "clearance": "0.88 um", "friction": 0.256}
    record = simulate(rig, **case, **law, **FEW | {"transient": 0, "revolutions": 1}, accuracy=ACCURACY)
    assert record.contacts_per_revolution.sum() > 100.0
    assert record.energy_residual < (ACCURACY if law else 4e-7)


@pytest.mark.parametrize("law", [{}, COULOMB], ids=str)
def test_energy_balances_where_a_loaded_rotor_stands_and_rubs(law):
    """On two walls below the shaft: friction dissipates 2.5 kJ, and nothing moves."""
    walls = tuple(LumpedStator(node=8, rigid=True, radius=0.06, angle=math.pi + at) for at in (-0.7, 0.7))
    rotor = replace(STIFF.rotor, gravity=9.81, load=(Load(node=8, vertical=-300.0),))
    case = {"speed": 20.0, "clearance": "20 um", "friction": 0.8}
    given = FEW | {"revolutions": 32, "accuracy": ACCURACY}
    record = simulate(replace(STIFF, rotor=rotor, stator=walls), **case, **law, **given)
    assert record.contact_fraction == pytest.approx([1.0, 1.0])
    assert record.friction_work.sum() > 10.0
    assert record.energy_residual < (ACCURACY if law else 1e-8)


def test_energy_residual_shows_friction_that_does_not_act(monkeypatch):
    case = {"speed_ratio": 1.5, "clearance": "40 um", "friction": 0.5}
    forces = ModeLibrary._friction_of
    monkeypatch.setattr(ModeLibrary, "_friction_of", lambda self, mode: 0.0 * forces(self, mode))
    assert simulate(STIFF, **case, **FEW).energy_residual > 1e-3


def test_peak_force_does_not_grow_with_the_mesh():
    """On the shaft itself; the force of the tip's damper at touch grows in proportion to the elements."""
    stator = replace(STIFF.stator[0], node=5, radius=0.01)
    given = FEW | {"transient": 2, "revolutions": 4, "accuracy": 1e-9}
    case = {"speed_ratio": 1.1, "clearance": "100 um"}
    peaks = []
    for n in (3, 12, 24):
        rig = replace(STIFF, stator=(replace(stator, elements=n),))
        peaks.append(float(simulate(rig, **case, **given).peak_contact_force[0]))
    assert peaks == pytest.approx([219.27] * 3, rel=1e-4)
