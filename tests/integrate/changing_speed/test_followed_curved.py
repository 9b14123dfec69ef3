"""Curved gaps in bearings that depend on the speed: modes and sag follow it, as those of other laws do."""

import numpy as np
import pytest
from closed_form import Contact, run_up
from test_steep_run_ups import machine

from rubhpc import Probe
from rubhpc.integrate import case
from rubhpc.integrate.changing_speed.case import record_run_up
from rubhpc.integrate.marches.contact_stepping import ContactSteppingMarch
from rubhpc.integrate.scheme import Scheme
from rubhpc.integrate.setup import prepare
from rubhpc.study.initial import CONTACT_FREE, Initial
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import Integrator, Recording

PROBES = [Probe(name=f"at_{node}", node=node, quantity="bearing_force") for node in (1, 7)]
LAW = {"start": 240.0, "stop": 300.0, "time": 0.4, "samples_per_revolution": 128}  # rad/s, s


def apart(found, other, name):
    """Largest difference of a signal over its extent."""
    expected = np.asarray(other[name])
    return np.abs(np.asarray(found[name]) - expected).max() / np.ptp(expected)


def test_without_contact_the_normal_does_not_matter():
    """Matrices held in ranges, about one sag each, erred by 6e-4 in bearing forces, 2e-2 in soft bearings.

    Pieces begin alike but for the rest that entering a mode leaves (`contact_modes.enter_rest`).
    """
    given = LAW | {"clearance": 1.0, "probes": PROBES}
    found, other = (run_up(machine(), **given, normal=normal) for normal in ("updated", "fixed"))
    for name in ("vertical", "horizontal", "probe_at_1", "probe_at_7"):
        assert apart(found, other, name) < 1e-6, name


def test_a_round_rim_in_a_ring_moves_as_in_short_steps(monkeypatch):
    """Contacts also end next to the end of a piece, where modes are entered with errors of some 1e-10 m.

    Such an overlap of a pair that parts is no event: there were 75 000 steps more.
    """
    law = SpeedLaw(time=(0.0, 0.6), speed=(340.0, 380.0))
    recording = Recording(transient=0, revolutions=law.n_revolution, samples_per_revolution=128)
    case_ = {
        "clearance": 1.2e-4,
        "friction": 0.1,
        "initial": Initial(from_=CONTACT_FREE),
        "recording": recording,
    }
    contact = Contact(normal="updated")
    records = []
    for step in (None, 1e-6):
        integrator = Integrator() if step is None else Integrator(step=step)
        setup = prepare(machine(3), 380.0, contact=contact, integrator=integrator, samples_per_revolution=128)
        records.append(record_run_up(setup, law, **case_))
        monkeypatch.setitem(case.MARCHES, Scheme.CURVED, ContactSteppingMarch)
    found, other = records
    assert found.measures["contact_fraction"].min() > 0.3
    assert found.measures["steps"] < 25000
    for name in ("vertical", "horizontal"):
        assert apart(found.arrays, other.arrays, name) < 1e-3
    work = other.measures["friction_work"]  # an impact on the end of a revolution may count for the next one
    assert found.measures["friction_work"] == pytest.approx(work, rel=2e-3)
