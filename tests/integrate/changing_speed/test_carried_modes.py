"""What a change of range does to a motion amid contacts of equal stators."""

import numpy as np
from closed_form import run_up
from equal_stators import in_ring
from trial_rig import trial_rig

from rubhpc.integrate.changing_speed import speed_ranges
from rubhpc.integrate.changing_speed.piece_integrator import PieceIntegrator

DRIVE = {"torque": 0.3, "inertia": 2e-3, "lowest": 20.0, "start": 250.0, "revolutions": 8}


def whip_of(monkeypatch, count):
    """A drive in a ring, and how much of its velocity each change of range takes, by pairs closed."""
    changes, goes_over = [], PieceIntegrator.goes_over

    def watched(integrator, setup, begun, before, jump=0.0):
        found, moved = goes_over(integrator, setup, begun, before, jump), 0.0
        if found:
            march, n = integrator._march, begun.motion.size // 2
            first = march.motion()[n:].copy()
            march.keep_fast(integrator.left, setup.spin, before.time)
            moved = np.linalg.norm(march.motion()[n:] - first) / np.linalg.norm(first)
        if before is not None:
            changes.append((np.count_nonzero(begun.contact_force), moved))
        return found

    monkeypatch.setattr(PieceIntegrator, "goes_over", watched)
    monkeypatch.setattr(speed_ranges, "WIDEST", 0.005)  # narrow ranges
    found = run_up(
        in_ring(trial_rig(1), count, first=0.3),
        drive=DRIVE,
        clearance=3e-5,
        friction=0.2,
        pieces_per_revolution=8,
    )
    return found, np.array(changes)


def test_modes_of_equal_stators_are_not_taken_for_one_another(monkeypatch):
    """Higher modes of several tips that press have one frequency, and no shape of their own."""
    found, changes = whip_of(monkeypatch, 8)
    assert changes[:, 0].max() >= 3
    assert changes[:, 1].max() < 2e-3
    assert found.energy_residual < 1e-6
