"""The twist that a drive gives a pump which touches its ring: pieces leave it without jumps."""

import math
from dataclasses import replace

import numpy as np
from overhung_pump import SEGMENT, pump

from rubhpc import LumpedStator, Probe, run_up

TIPS = tuple(LumpedStator(node=6, angle=0.2 + i * math.pi / 4, **SEGMENT) for i in range(8))
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
    rig = replace(pump(), stator=TIPS)
    found, fine = run_up(rig, **case), run_up(rig, **case, pieces_per_revolution=32)
    assert fine.contact_fraction.max() > 0.1
    window = np.hanning(fine.sizes["sample"])
    own, short = np.fft.rfft((found.probe_twist.values, fine.probe_twist.values) * window)[:, :88]
    error = np.linalg.norm(own - short) / np.linalg.norm(short)
    assert error < 5e-3  # what is asked of accelerations
