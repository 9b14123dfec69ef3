"""Memory of the matrices of a run-up or drive is bounded, however many ranges of speed it passes."""

import gc

import numpy as np
import pytest
from closed_form import run_up
from equal_stators import in_ring
from overhung_pump import pump

from rubhpc import recent
from rubhpc.integrate.changing_speed import pieces, speed_ranges

DRIVE = {"torque": "60 N m", "start": "300 rad/s", "revolutions": 5, "inertia": "0.02 kg m^2"}
BENDS = {"speed_law": [(0.0, 300.0), (0.05, 310.0), (0.07, 330.0), (0.12, 334.0)]}


@pytest.mark.parametrize(
    ("motion", "budget"),
    [({"drive": DRIVE}, "MOST_DRIVEN_BYTES"), (BENDS, "MOST_BYTES")],
    ids=["drive", "run-up"],
)
def test_memory_of_many_ranges_is_bounded(motion, budget, monkeypatch):
    rig, made, hold = in_ring(pump(), 8, first=0.2), [], speed_ranges.SpeedRanges.hold

    def noted(*args):
        made.append(hold(*args))
        return made[-1]

    def n_byte():
        return sum(held.n_byte for held in made)

    monkeypatch.setattr(speed_ranges.SpeedRanges, "hold", noted)
    monkeypatch.setattr(speed_ranges, "WIDEST", 0.005)  # narrow ranges
    case = motion | {"clearance": 1e-4, "friction": 0.05, "samples_per_revolution": 64}
    pieces._KNOWN.clear()
    first, of_all = run_up(rig, **case), n_byte()
    greatest = max(held.n_byte for held in made)
    again, n_made = run_up(rig, **case), len(made)
    assert n_made > 1 + pieces.MOST_AT_HAND
    most = of_all // 8
    assert most + 2 * greatest < 0.7 * of_all
    monkeypatch.setattr(pieces, budget, most)
    monkeypatch.setattr(pieces, "MOST_AT_HAND", 1)
    found = run_up(rig, **case)
    assert n_byte() <= most + 2 * greatest
    for other in (again, found):
        for name in ("vertical", "torsion", "speed"):
            assert np.array_equal(other[name].values, first[name].values), name


def test_what_is_kept_of_a_set_up_goes_with_it():
    """Hundreds of megabytes of a machine, in a process that computes other ones after it."""
    run_up(in_ring(pump(), 8, first=0.2), clearance=1e-4, friction=0.05, samples_per_revolution=64, **BENDS)
    kept = pieces._KNOWN, pieces._RIPPLES, speed_ranges._BUFFERS
    assert all(kept)
    recent.forget()
    gc.collect()
    assert not any(kept)
