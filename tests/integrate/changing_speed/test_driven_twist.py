"""The pieces of a drive: the twist does not jump between them, and touches make them short."""

import math

import numpy as np
import pytest
from closed_form import run_up
from equal_stators import in_ring
from overhung_pump import pump

from rubhpc import LumpedStator, Probe, Rig, Unbalance
from rubhpc.integrate.changing_speed.free_piece import Spin
from rubhpc.integrate.changing_speed.piece_integrator import PieceIntegrator

DRIVE = {"torque": [8.0, 2.0], "speed": [0.0, 600.0], "inertia": 5e-3, "start": 320.0, "revolutions": 12}


def test_twist_of_pieces_by_default_is_that_of_short_ones():
    """The torque goes with the speed, of which touches take a part: where it jumped, it rang the shaft."""
    case = {
        "drive": DRIVE,
        "clearance": 1.5e-4,
        "friction": 0.1,
        "law": "penalty",
        "stiffness": 1e6,
        "damping": 50.0,
        "initial": {"from": "rest"},
        "samples_per_revolution": 128,
        "probes": (Probe(name="twist", node=6, quantity="twist_acceleration"),),
        "accuracy": 1e-3,
    }
    rig = in_ring(pump(), 8, first=0.2)
    found, fine = run_up(rig, **case), run_up(rig, **case, pieces_per_revolution=32)
    assert fine.contact_fraction.max() > 0.1
    window = np.hanning(fine.sizes["sample"])
    own, short = np.fft.rfft((found.probe_twist.values, fine.probe_twist.values) * window)[:, :88]
    error = np.linalg.norm(own - short) / np.linalg.norm(short)
    assert error < 5e-3  # what is asked of accelerations


LIGHT = Rig.from_matrices(
    np.diag([5.0, 5.0, 4e-3]),
    np.diag([40.0, 40.0, 0.1]),
    np.diag([2e5, 2.4e5, 9e3]),
    degrees=[(1, "v"), (1, "w"), (1, "thx")],
    stators=[LumpedStator(node=1, mass=0.2, stiffness=3e5, damping=30.0, radius=0.05)],
    unbalance=[Unbalance(node=1, mass=0.01, radius=0.05)],
)


def test_pieces_of_an_odd_number_of_samples_end_no_record():
    """The speed grows by 5 % a revolution, for which half of one is too long; 17 samples cannot be halved."""
    case = {"drive": {"torque": 6.0, "start": 180.0, "revolutions": 6, "inertia": 8e-3}, "clearance": 1.0}
    odd, even = (run_up(LIGHT, **case, samples_per_revolution=n) for n in (34, 32))
    assert odd.record_end == even.record_end == "all_revolutions"
    assert odd.last_speed == pytest.approx(even.last_speed, rel=1e-5)


def test_touches_make_pieces_short():
    """Between them the speed is not on its mean line, which turned the unbalance back and forth."""
    case = {
        "drive": {"torque": 0.0, "start": 205.0, "revolutions": 12, "inertia": 0.05},
        "clearance": 2e-4,
        "friction": 0.3,
        "initial": {"from": "rest"},
        "samples_per_revolution": 64,
        "probes": (Probe(name="across", node=1, angle=math.pi / 2, quantity="acceleration"),),
    }
    found, fine = run_up(LIGHT, **case), run_up(LIGHT, **case, pieces_per_revolution=32)
    assert fine.contact_fraction.max() > 0.1
    error = np.linalg.norm(found.probe_across - fine.probe_across) / np.linalg.norm(fine.probe_across)
    assert error < 1e-3


def test_rub_that_comes_back_is_foreseen(monkeypatch):
    """Pieces alternate with and without touches: what braked a revolution ago is what brakes now."""
    passed, pieces = [], []
    take, take_piece = PieceIntegrator.take, Spin.take

    def counted(*at, **keys):
        pieces.append(take_piece(*at, **keys))
        return pieces[-1]

    monkeypatch.setattr(PieceIntegrator, "take", lambda *at, **keys: passed.append(at) or take(*at, **keys))
    monkeypatch.setattr(Spin, "take", counted)
    drive = {"torque": 0.3, "start": "1300 rpm", "revolutions": 60, "inertia": 0.02}
    found = run_up("mokhtar2017", drive=drive, clearance=1e-4, friction=0.2, samples_per_revolution=64)
    n_piece = sum(piece is not None for piece in pieces)
    assert found.contact_fraction[-20:].min() > 0.05
    assert len(passed) < 1.1 * n_piece  # 1.7 with what braked the piece before
