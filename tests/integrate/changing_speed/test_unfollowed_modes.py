"""Contact modes that cannot be followed are solved at each piece: the motion is the same."""

import numpy as np
import pytest
from closed_form import Contact
from equal_stators import in_ring
from overhung_pump import pump
from set_ups import prepared
from test_steep_run_ups import machine

from rubhpc.integrate.changing_speed import range_library
from rubhpc.integrate.changing_speed.case import record_run_up
from rubhpc.study.initial import CONTACT_FREE, Initial
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import Recording

SAMPLES = 64
LAW = SpeedLaw(time=(0.0, 0.15), speed=(300.0, 360.0))
CASE = {"clearance": 1.5e-4, "friction": 0.05, "initial": Initial(from_=CONTACT_FREE)}


def run(contact):
    setup = prepared(in_ring(pump(), 6, first=0.2), 360.0, samples=SAMPLES, contact=contact)
    recording = Recording(transient=0, revolutions=LAW.n_revolution, samples_per_revolution=SAMPLES)
    return record_run_up(setup, LAW, recording=recording, **CASE).arrays


@pytest.mark.parametrize("refused", ["every other", "all"])
def test_modes_that_are_solved_at_each_piece(monkeypatch, refused):
    followed, matched = run(Contact()), range_library.matched
    n_refused = 0

    def none_for_some(mode, other):
        nonlocal n_refused
        if refused == "all" or mode.mask.bit_count() % 2:
            n_refused += 1
            return None
        return matched(mode, other)

    monkeypatch.setattr(range_library, "matched", none_for_some)
    solved = run(Contact())
    assert n_refused > 0
    assert followed["contact_force"].max() > 0.0
    for name in ("vertical", "horizontal", "torsion"):
        size = np.sqrt(np.mean(followed[name] ** 2))
        assert np.sqrt(np.mean((solved[name] - followed[name]) ** 2)) < 1e-4 * size, name


def test_a_case_without_contact_does_not_depend_on_one_with_contact():
    """In the same matrices, whose contact modes some pieces cannot follow: not by its last digits."""
    law = SpeedLaw(time=(0.0, 0.3), speed=(350.0, 420.0))
    recording = Recording(transient=0, revolutions=law.n_revolution, samples_per_revolution=SAMPLES)

    def run_both(clearances):
        setup = prepared(machine(1), 420.0, samples=SAMPLES)
        case = {"recording": recording, "friction": 0.1, "initial": CASE["initial"]}
        return [record_run_up(setup, law, clearance=c, **case).arrays for c in clearances]

    (alone,), (rub, after) = run_both([5e-3]), run_both([1.6e-4, 5e-3])
    assert rub["contact_force"].max() > 0.0
    for name, values in alone.items():
        assert np.array_equal(after[name], values, equal_nan=True), name
